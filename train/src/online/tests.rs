//! What a panic of the thread that acts leaves behind. It is caused where a driver or a network would cause it, on the stage between two episodes of the thread's own.

use std::path::Path;

use vibes_data::{RunFolder, verify_recording};
use vibes_env::distractors::{Axes, DistractorSettings};

use super::model_free::folder::{FORMAT, Folder, ModelFreeOptions};
use super::model_free::model_free_living;
use super::*;
use crate::learners::model_free::AgentOptions;
use crate::learners::sac::options::{SacOptions, Size};
use crate::options::Options;

/// The number of the episode that is not lived through.
const FATAL: u32 = 4;

fn struck(stage: &mut actor::Stage<'_>, task: Task) -> Result<Lived> {
    assert!(task.keep.as_ref().is_none_or(|(number, _)| *number != FATAL), "the driver lost its context");
    stage.live(task)
}

fn options() -> OnlineOptions {
    let world = prepare::default_world("known-slide").unwrap();
    let distractors = DistractorSettings { axes: Axes::NONE, ..world.distractors };
    let world = options::WorldOptions { steps: 20, size: None, distractors, ..world };
    OnlineOptions {
        control_steps: 8 * 40,
        rows_per_step: 8.0,
        prefill: 2,
        first_updates: 4,
        evaluate_every: 0,
        evaluation_episodes: 1,
        final_episodes: 1,
        ..prepare::default_options(world, false)
    }
}

/// The run at `path` as far as it gets, by an actor's thread that lives in this way.
fn with_a_world_model(path: &Path, live: Living) -> Result<End> {
    let mut model = Options::preset("tiny").unwrap();
    model.settings.checkpoint_every = 8;
    let prepared = prepare::from_nothing(path, &model, options()).unwrap();
    let setup =
        Setup { run: &prepared.run, options: &prepared.options, given: &prepared.given, device: &Device::flex() };
    online_living(live, &setup, &mut |_| Go::On)
}

/// The same from pictures, without a world model.
fn without(path: &Path, live: Living) -> Result<End> {
    let agent = match AgentOptions::system("sac-drq", Size::Small).unwrap() {
        AgentOptions::Stacks(system) => AgentOptions::Stacks(SacOptions { batch: 4, ..system }),
        other @ AgentOptions::Recurrent(_) => other,
    };
    let online = OnlineOptions { world: options::WorldOptions { size: Some(24), ..options().world }, ..options() };
    let options = ModelFreeOptions {
        format: FORMAT.to_owned(),
        system: "sac-drq".to_owned(),
        size: Size::Small,
        seed: 0,
        agent,
        updates_per_step: 0.1,
        save_every: 1,
        online,
    };
    model_free_living(live, &Folder::create_or_open(path, options).unwrap(), &Device::flex(), &mut |_| Go::On)
}

/// Weights of the newest checkpoint and everything that was lived through, by their places.
fn left_behind(run: &Path) -> Vec<(String, Vec<u8>)> {
    let newest = RunFolder::at(run).newest_checkpoint().unwrap();
    let files = |folder: &Path, ending: &str| {
        let names = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let mut found: Vec<_> = names.filter(|path| path.to_string_lossy().ends_with(ending)).collect();
        found.sort();
        found
    };
    let all = [files(&newest, ".safetensors"), files(&run.join("replay/episodes"), ".arrow")].concat();
    let place = |path: &Path| path.strip_prefix(run).unwrap().display().to_string();
    all.iter().map(|path| (place(path), std::fs::read(path).unwrap())).collect()
}

#[test]
fn a_thread_that_panics_is_an_error_with_its_words_and_the_run_goes_on_later() {
    let loops: [fn(&Path, Living) -> Result<End>; 2] = [with_a_world_model, without];
    for train in loops {
        let folder = tempfile::tempdir().unwrap();
        let [undisturbed, shaken] = ["undisturbed", "shaken"].map(|name| folder.path().join(name));
        assert_eq!(train(&undisturbed, actor::as_it_is).unwrap(), End::Updates);
        let error = train(&shaken, struck).unwrap_err();
        assert!(matches!(&error, TrainError::Panicked { panic, .. } if panic.contains("lost its context")), "{error}");
        let said = error.to_string();
        assert!(
            said.contains("everything up to the last checkpoint is kept") && said.contains("same command"),
            "{said}"
        );
        let replay = Recording::open(&shaken.join("replay")).unwrap();
        assert_eq!(replay.episodes().len(), FATAL as usize, "every whole episode is listed");
        assert!(verify_recording(&replay).is_empty());
        assert_eq!(train(&shaken, actor::as_it_is).unwrap(), End::Updates);
        let (wanted, found) = (left_behind(&undisturbed), left_behind(&shaken));
        assert!(wanted.len() > 8);
        for ((place, wanted), (other, found)) in wanted.iter().zip(&found) {
            assert!(place == other && wanted == found, "{place} {other}");
        }
    }
}
