//! A trained run as one more policy.
//!
//! In: a run's folder. Out: a [`vibes_env::Policy`] that sees the pictures, or the vector observation, that the run was trained on, and what the
//! manifest says of it ([`ActedBy`]). The one place where the collector knows about networks.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use vibes_data::{GivenFrom, HeadStart, Metrics, RunFolder};
use vibes_env::distractors::DistractorSettings;
use vibes_env::render::{Look, RenderSettings};
use vibes_env::videos::VideoSource;
use vibes_env::{EnvironmentOptions, Error as WorldError, Policy, PolicySpec, Trained};
use vibes_model::ObservationKind;
use vibes_model::actions::Choice;
use vibes_model::player::Player;
use vibes_model::trained::{TrainedAgent, actor_file};

use crate::{Error, Result};

/// Who acted, as the manifest keeps it: the same recording made by another checkpoint is another recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ActedBy {
    /// The run's name: its folder's last part.
    pub run: String,
    /// Which of its checkpoints, by what never changes about it, such as its number of updates and a checksum.
    pub checkpoint: String,
    /// Size and look of the pictures it saw; none for a policy of vector observations.
    pub pictures: Option<RenderSettings>,
}

impl ActedBy {
    /// Whether the other is the same actor. Names do not count: a folder is moved, or reached by a link.
    pub fn is_same(&self, other: &Self) -> bool {
        (&self.checkpoint, self.pictures) == (&other.checkpoint, other.pictures)
    }
}

/// Makes a policy, trained or not, for a task.
///
/// # Errors
/// When a run cannot be loaded or was trained on another task, and as [`PolicySpec::policy`].
pub fn policy(spec: &PolicySpec, task: &str, options: EnvironmentOptions) -> Result<Box<dyn Policy>> {
    match spec {
        PolicySpec::Run { path } => load(path, &newest(path)?, task).map(|(policy, _)| policy),
        PolicySpec::Random { .. } | PolicySpec::Planner { .. } | PolicySpec::Actions { .. } => {
            Ok(spec.policy(task, options)?)
        }
    }
}

/// Makes policies as [`policy`] does, of trained runs from the very checkpoints that a manifest names: a run that learns on meanwhile saves newer ones, which are not those that
/// the recording says.
///
/// # Errors
/// As [`policy`], or the run's checkpoint is gone.
pub fn as_named(
    acting: &[ActedBy],
) -> impl Fn(&PolicySpec, &str, EnvironmentOptions) -> Result<Box<dyn Policy>> + Sync + '_ {
    |spec, task, options| match spec {
        PolicySpec::Run { path } => named(path, task, acting),
        PolicySpec::Random { .. } | PolicySpec::Planner { .. } | PolicySpec::Actions { .. } => {
            policy(spec, task, options)
        }
    }
}

/// The actor of a run's checkpoint that is among those that are named.
fn named(path: &Path, task: &str, acting: &[ActedBy]) -> Result<Box<dyn Policy>> {
    let folder = RunFolder::at(path);
    for update in folder.checkpoints().into_iter().rev() {
        let checkpoint = folder.checkpoint_path(update);
        // Without looking into those that have another name.
        if !acting.iter().any(|acted| acted.checkpoint.starts_with(&format!("{},", last_part(&checkpoint)))) {
            continue;
        }
        match load(path, &checkpoint, task)? {
            (policy, found) if acting.iter().any(|acted| acted.is_same(&found)) => return Ok(policy),
            _ => {}
        }
    }
    let known: Vec<&str> = acting.iter().map(|acted| acted.checkpoint.as_str()).collect();
    Err(refused(
        path,
        format!("the checkpoint that acts in this recording ({}) is gone", known.join(" or ")),
        "a run that keeps it, or another folder (-o)",
    ))
}

/// What the manifest says of a run that acts: of its newest checkpoint.
///
/// # Errors
/// As [`policy`].
pub fn acted_by(path: &Path, task: &str) -> Result<ActedBy> {
    load(path, &newest(path)?, task).map(|(_, acted_by)| acted_by)
}

/// What a run was trained in, for options that were not typed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Home {
    /// Its task.
    pub task: Option<String>,
    /// Control steps an action was held.
    pub action_repeat: Option<u32>,
    /// Its distractors.
    pub distractors: Option<DistractorSettings>,
    /// Where its background videos come from.
    pub videos: Option<VideoSource>,
    /// How many of a set there are, if it was asked for.
    pub video_count: Option<usize>,
    /// Side of its pictures, if it has any.
    pub size: Option<u32>,
    /// How its pictures were drawn.
    pub look: Look,
    /// Whether samples of the actor are evaluated rather than its mode.
    pub(crate) evaluates_samples: bool,
    /// The protocol whose settings these are, with the episodes that it asks for, of a run that has lived through all its control steps.
    pub protocol: Option<(String, u32)>,
    /// The held-out videos of its folder as they were when it was begun, where it says them.
    pub held_out_videos: Option<Vec<String>>,
    /// Control steps of the recordings that it began with, which it did not live through itself.
    pub given_control_steps: Option<u64>,
    /// What that number is known from, where that is not the recordings.
    pub given_from: Option<String>,
}

/// Reads what a run was trained in; nothing of a folder that is no run.
pub fn home(run: &Path) -> Home {
    let info = RunFolder::at(run).open_info().ok();
    let online = info.as_ref().and_then(|info| info.options.get("online")).cloned();
    let read = || serde_json::from_str(&std::fs::read_to_string(run.join("online.json")).ok()?).ok();
    let online: serde_json::Value = online.or_else(read).unwrap_or_default();
    let world = &online["world"];
    let videos: Option<VideoSource> = serde_json::from_value(world["videos"].clone()).ok();
    let began_with = info.as_ref().and_then(|info| info.began_with);
    let (given_control_steps, given_from) = given(run, &online, began_with);
    Home {
        distractors: serde_json::from_value(world["distractors"].clone()).ok(),
        videos: videos.map(|videos| videos.found(run)),
        video_count: world["video_count"].as_u64().and_then(|count| usize::try_from(count).ok()),
        task: info.as_ref().and_then(|info| info.task()).map(str::to_owned),
        action_repeat: world["action_repeat"].as_u64().and_then(|repeat| u32::try_from(repeat).ok()),
        size: world["size"].as_u64().and_then(|size| u32::try_from(size).ok()),
        look: serde_json::from_value(world["look"].clone()).unwrap_or_default(),
        evaluates_samples: online["evaluate_mode"] == false,
        protocol: online["protocol"].as_str().and_then(|name| {
            let wanted = online["control_steps"].as_u64()?;
            let episodes = online["final_episodes"].as_u64().and_then(|count| u32::try_from(count).ok())?;
            (lived(run)? >= wanted).then(|| (name.to_owned(), episodes))
        }),
        held_out_videos: serde_json::from_value(online["held_out_videos"].clone()).ok(),
        given_control_steps,
        given_from,
    }
}

/// The control steps that a run began with, and what they are known from where that is not the recordings; of one that was begun before its options said so, as a copy of it that was kept
/// says, or its evaluations.
fn given(run: &Path, online: &serde_json::Value, kept: Option<HeadStart>) -> (Option<u64>, Option<String>) {
    if let Some(from) = online["given_from"].as_str() {
        let is_told = from != "recordings" && from != "unknown";
        return (online["given_control_steps"].as_u64(), is_told.then(|| from.to_owned()));
    }
    if let Some(kept) = kept {
        let is_told = kept.given_from == GivenFrom::RunFile;
        return (kept.given_control_steps, is_told.then(|| "run.json".to_owned()));
    }
    let evaluations = Metrics::read(&RunFolder::at(run).evaluations_path()).unwrap_or_default();
    let last = evaluations.lines.last();
    (last.and_then(|line| line.get("given_control_steps")?.as_u64()), None)
}

/// Control steps that a run had lived through at its newest checkpoint.
fn lived(run: &Path) -> Option<u64> {
    let checkpoint = RunFolder::at(run).newest_checkpoint().ok()?;
    let read = |file: &str| -> Option<serde_json::Value> {
        serde_json::from_str(&std::fs::read_to_string(checkpoint.join(file)).ok()?).ok()
    };
    // Beside a world model, and without one.
    ["online.json", "state.json"].into_iter().find_map(|file| read(file)?["control_steps"].as_u64())
}

/// What a run that can act is.
const TRAINED: &str = "a run that `vibes-train online` has trained";

fn refused(path: &Path, fact: String, expected: &str) -> Error {
    let text = path.display().to_string();
    Error::from(WorldError::Policy { text, fact, expected: expected.to_owned() })
}

fn last_part(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// The folder of a run's newest checkpoint.
fn newest(path: &Path) -> Result<PathBuf> {
    RunFolder::at(path).newest_checkpoint().map_err(|_none| refused(path, "it holds no checkpoint".to_owned(), TRAINED))
}

/// Loads the actor of a checkpoint of a run.
fn load(path: &Path, checkpoint: &Path, task: &str) -> Result<(Box<dyn Policy>, ActedBy)> {
    let file = actor_file(checkpoint).ok_or_else(|| refused(path, "it holds no actor".to_owned(), TRAINED))?;
    let file = checkpoint.join(file);
    let agent = TrainedAgent::load(checkpoint, &vibes_model::cpu())
        .map_err(|error| refused(path, error.to_string(), TRAINED))?;
    if agent.task() != task {
        return Err(refused(path, format!("it was trained on {}", agent.task()), &format!("a run of {task}")));
    }
    let home = home(path);
    let pictures = match agent.observation() {
        ObservationKind::Pixels { height, .. } => Some(RenderSettings { size: height, look: home.look }),
        ObservationKind::Vector { .. } => None,
    };
    let weights = std::fs::read(&file).map_err(Error::io("read", &file))?;
    let whole = std::path::absolute(path).map_err(Error::io("find", path))?;
    let acted_by = ActedBy {
        run: last_part(&whole),
        checkpoint: format!("{}, {}", last_part(checkpoint), &vibes_data::sha256_hex(&weights)[..12]),
        pictures,
    };
    let name = path.display().to_string();
    // As the run evaluates itself: by the mode of its distribution, unless it was asked for samples.
    let choice = if home.evaluates_samples { Choice::Sample } else { Choice::Mode };
    let mut player = Player::new(agent, choice, 0.0);
    let policy = Trained::new(name, pictures, move |sight, is_first, mut rng| {
        player.act(is_first, sight.pixels, sight.observation, &mut rng).map_err(Into::into)
    });
    Ok((Box::new(policy), acted_by))
}

#[cfg(test)]
mod tests {
    use vibes_env::distractors::{Axes, Difficulty};

    use super::*;

    #[test]
    fn a_run_is_recorded_in_the_world_that_it_was_trained_in() {
        let folder = tempfile::tempdir().unwrap();
        let (run, videos) = (folder.path().join("runs/own"), folder.path().join("films"));
        std::fs::create_dir_all(&run).unwrap();
        std::fs::create_dir_all(&videos).unwrap();
        let settings = DistractorSettings { axes: Axes::NONE, difficulty: Difficulty::Hard, dynamic: false };
        let world = serde_json::json!({
            "action_repeat": 3, "distractors": settings, "videos": { "folder": "../../films" }, "video_count": 7, "look": "suite", "size": 84,
        });
        std::fs::write(run.join("online.json"), serde_json::json!({ "world": world }).to_string()).unwrap();
        let found = home(&run);
        assert_eq!((found.action_repeat, found.distractors, found.video_count), (Some(3), Some(settings), Some(7)));
        let Some(VideoSource::Folder(place)) = found.videos else { panic!("{:?}", found.videos) };
        assert_eq!(place.canonicalize().unwrap(), videos.canonicalize().unwrap());
        assert_eq!((found.look, found.size), (Look::Suite, Some(84)));
        assert_eq!((found.given_control_steps, found.held_out_videos), (None, None), "from nothing, and of no folder");
        assert_eq!(home(folder.path()), Home::default(), "no run");
    }

    /// What a run began with stands in its options, and of one that is older in its evaluations.
    #[test]
    fn what_a_run_began_with_is_known() {
        let folder = tempfile::tempdir().unwrap();
        let began = |online: serde_json::Value| {
            std::fs::write(folder.path().join("online.json"), online.to_string()).unwrap();
            let home = home(folder.path());
            (home.given_control_steps, home.given_from)
        };
        let told = |from: &str| serde_json::json!({ "given_control_steps": 1_500_000, "given_from": from });
        assert_eq!(began(told("run.json")), (Some(1_500_000), Some("run.json".to_owned())));
        assert_eq!(began(told("recordings")), (Some(1_500_000), None));
        let lines = "{\"given_control_steps\":320,\"update\":1}\n{\"given_control_steps\":640,\"update\":2}\n";
        std::fs::write(folder.path().join("evaluations.jsonl"), lines).unwrap();
        assert_eq!(began(serde_json::json!({})), (Some(640), None), "an older run");
        assert_eq!(began(serde_json::json!({ "given_from": "unknown" })), (None, None));
        let info = serde_json::json!({
            "format": "vibes-run/1", "options": {}, "model": {}, "recordings": [], "from": "runs/first", "episodes": 0, "steps": 0, "versions": {},
            "began_with": { "given_control_steps": 960, "given_from": "run.json" },
        });
        std::fs::write(folder.path().join("run.json"), info.to_string()).unwrap();
        assert_eq!(began(serde_json::json!({})), (Some(960), Some("run.json".to_owned())), "a copy of an older run");
    }

    /// A run that is recorded while it learns on must not act with weights that the manifest does not name.
    #[test]
    fn the_checkpoint_that_is_named_acts_though_there_are_newer_ones() {
        let kept = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../checkpoints/swimmer-100-online"));
        let found = newest(kept).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("run");
        let save = |update: &str| {
            let place = run.join("checkpoints").join(update);
            std::fs::create_dir_all(&place).unwrap();
            for file in std::fs::read_dir(&found).unwrap().map(|file| file.unwrap().path()) {
                std::fs::copy(&file, place.join(file.file_name().unwrap())).unwrap();
            }
            place
        };
        std::fs::create_dir_all(&run).unwrap();
        for file in ["run.json", "online.json"] {
            std::fs::copy(kept.join(file), run.join(file)).unwrap();
        }
        let first = save("000007");
        let acting = [acted_by(&run, "swimmer-100").unwrap()];
        let make = as_named(&acting);
        let spec = PolicySpec::Run { path: run.clone() };
        make(&spec, "swimmer-100", EnvironmentOptions::default()).unwrap();
        save("000009");
        make(&spec, "swimmer-100", EnvironmentOptions::default()).unwrap();
        assert_ne!(acted_by(&run, "swimmer-100").unwrap(), acting[0], "the newest is another");
        std::fs::remove_dir_all(first).unwrap();
        let gone = make(&spec, "swimmer-100", EnvironmentOptions::default()).err().unwrap().to_string();
        assert!(gone.contains("(000007, ") && gone.contains("is gone"), "{gone}");
    }
}
