//! The readers of `vibes-model` and `vibes-train`: checkpoints, run folders that are gone on with, and plans of sweeps.

#[path = "../../model/tests/made_up/mod.rs"]
mod made_up;

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::Path;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use vibes_data::RUN_FORMAT;
use vibes_model::actions::ActionDistribution;
use vibes_model::behaviour::Behaviour;
use vibes_model::checkpoint::save_tensors;
use vibes_model::config::BehaviourConfig;
use vibes_model::guard::Guard;
use vibes_model::parameters::read_parameters;
use vibes_model::recurrent::networks::{RecurrentConfig, RecurrentNetworks};
use vibes_model::sac::config::SacConfig;
use vibes_model::sac::networks::SacNetworks;
use vibes_model::trained::TrainedAgent;
use vibes_model::values::ValueDistribution;
use vibes_model::{Model, ModelConfig, ObservationKind, cpu};
use vibes_train::learners::sac::update::SacLearner;
use vibes_train::options::Options;
use vibes_train::run::{Run, RunInfo};
use vibes_train::sweep::Plan;
use vibes_train::trained::TrainedRun;

use crate::readers::{Part, Reader};

/// All of them.
pub(crate) const PART: Part = Part { readers: &READERS, make };

const READERS: [Reader; 8] = [
    Reader { name: "model", file: "world/model.safetensors", read: checkpoint },
    Reader { name: "behaviour", file: "world/behaviour.safetensors", read: checkpoint },
    Reader { name: "sac", file: "stacks/sac.safetensors", read: checkpoint },
    Reader { name: "recurrent", file: "recurrent/recurrent.safetensors", read: checkpoint },
    Reader { name: "run_options", file: "trained/run.json", read: run },
    Reader { name: "plan", file: "plan.toml", read: plan },
    Reader { name: "guard", file: "world/guard.safetensors", read: guard },
    Reader { name: "moments", file: "learner/sac_optimizer.safetensors", read: learner },
];

const PLAN: &str = r#"output = "runs/plan"
seeds = 2
stages = ["vibes-train offline a --seed {seed} --objective {objective} --{key} {value} --depth {depth} -o {run}/run"]

[grid]
objective = ["vibes", "no-adversary"]

[zip]
key = ["latent", "hidden"]
value = [8, 16]

[[list]]
depth = 4
"#;

/// Makes the valid files.
fn make(folder: &Path) {
    make_checkpoints(folder);
    let info = RunInfo {
        format: RUN_FORMAT.into(),
        options: Options::preset("tiny").unwrap(),
        model: config(),
        recordings: vec!["../recording".into()],
        from: None,
        began_with: None,
        episodes: 1,
        steps: 9,
        versions: BTreeMap::new(),
    };
    Run::create_or_open(&folder.join("trained"), info, &[]).unwrap();
    fs::write(folder.join("plan.toml"), PLAN).unwrap();
}

/// Checkpoints of the three kinds of agents.
fn make_checkpoints(folder: &Path) {
    let (mut rng, device) = (ChaCha8Rng::seed_from_u64(0), cpu());
    let at = |name: &str| {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        path
    };
    Model::init(config(), &mut rng, &device).unwrap().save(&at("world/model.safetensors")).unwrap();
    let (actions, values) = (ActionDistribution::BoundedNormal, ValueDistribution::Gaussian);
    let behaviour = BehaviourConfig { actions, values, hidden: 4 };
    Behaviour::init(&config(), behaviour, &mut rng, &device).save(&at("world/behaviour.safetensors")).unwrap();
    let observation = ObservationKind::Pixels { height: 15, width: 15 };
    let model = ModelConfig { observation, adversary: false, decoder: false, ..config() };
    let recurrent = RecurrentConfig { model, picture: [15, 15], hidden: 4 };
    let networks = RecurrentNetworks::init(recurrent, &mut rng, &device).unwrap();
    networks.save(&at("recurrent/recurrent.safetensors")).unwrap();
    let networks = SacNetworks::init(stacks(), &mut rng, &device).unwrap();
    networks.save(&at("stacks/sac.safetensors")).unwrap();
    Guard::init(&config(), 2, &mut rng, &device).save(&at("world/guard.safetensors")).unwrap();
    // As after steps of the critics.
    let moments = ["critic.first", "critic.second"].map(|prefix| read_parameters(&networks.critic, prefix));
    let file = at("learner/sac_optimizer.safetensors");
    SacLearner::new(networks, &device).save(&folder.join("learner")).unwrap();
    save_tensors(&file, &moments.into_iter().flatten().collect(), HashMap::new()).unwrap();
}

/// The smallest networks over stacks that have all their parts.
fn stacks() -> SacConfig {
    SacConfig {
        task: "made-up".into(),
        picture: [15, 15],
        view: [15, 15],
        stack: 1,
        action_min: vec![-1.0],
        action_max: vec![1.0],
        feature: 2,
        hidden: 4,
        squash: true,
        search: None,
        random_share: 0.0,
        bilinear: true,
        transition: true,
        sequence: 2,
        log_std_min: -10.0,
    }
}

/// The smallest model that has all its parts.
fn config() -> ModelConfig {
    let (action_min, action_max) = (vec![-1.0], vec![1.0]);
    let all = made_up::config(ObservationKind::Vector { len: 3 });
    ModelConfig { action_min, action_max, depth: 1, hidden: 4, head: 4, latent: 2, ..all }
}

/// What acts, of the checkpoint in whose folder the file lies.
fn checkpoint(_: &Path, path: &Path) -> bool {
    TrainedAgent::load(path.parent().unwrap(), &cpu()).is_ok()
}

/// The reward heads of the model that is described here.
fn guard(_: &Path, path: &Path) -> bool {
    Guard::load(path, &config(), &cpu()).is_ok()
}

/// The learner in whose folder the file lies.
fn learner(_: &Path, path: &Path) -> bool {
    SacLearner::load(path.parent().unwrap(), &cpu()).is_ok()
}

/// The run in whose folder the file lies.
fn run(_: &Path, path: &Path) -> bool {
    TrainedRun::open(path.parent().unwrap()).is_ok()
}

/// A plan and the runs it stands for.
fn plan(_: &Path, path: &Path) -> bool {
    Plan::read(path).and_then(|plan| plan.expand()).is_ok()
}
