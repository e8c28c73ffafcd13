//! A trained run as one more policy.
//!
//! In: a run's folder. Out: a [`vibes_env::Policy`] that sees the pictures, or the vector observation, that the run was trained on, and what the
//! manifest says of it ([`ActedBy`]). The one place where the collector knows about networks.

use std::path::Path;

use serde::{Deserialize, Serialize};
use vibes_data::RunFolder;
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

/// Makes a policy, trained or not, for a task.
///
/// # Errors
/// When a run cannot be loaded or was trained on another task, and as [`PolicySpec::policy`].
pub fn policy(spec: &PolicySpec, task: &str, options: EnvironmentOptions) -> Result<Box<dyn Policy>> {
    match spec {
        PolicySpec::Run { path } => load(path, task).map(|(policy, _)| policy),
        PolicySpec::Random { .. } | PolicySpec::Planner { .. } | PolicySpec::Actions { .. } => {
            Ok(spec.policy(task, options)?)
        }
    }
}

/// What the manifest says of a run that acts.
///
/// # Errors
/// As [`policy`].
pub fn acted_by(path: &Path, task: &str) -> Result<ActedBy> {
    load(path, task).map(|(_, acted_by)| acted_by)
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
    /// How its pictures were drawn.
    look: Look,
    /// Whether samples of the actor are evaluated rather than its mode.
    evaluates_samples: bool,
    /// The protocol whose settings these are, with the episodes that it asks for, of a run that has lived through all its control steps.
    pub protocol: Option<(String, u32)>,
}

/// Reads what a run was trained in; nothing of a folder that is no run.
pub fn home(run: &Path) -> Home {
    let info = RunFolder::at(run).open_info().ok();
    let online = info.as_ref().and_then(|info| info.options.get("online")).cloned();
    let read = || serde_json::from_str(&std::fs::read_to_string(run.join("online.json")).ok()?).ok();
    let online: serde_json::Value = online.or_else(read).unwrap_or_default();
    let world = &online["world"];
    let videos: Option<VideoSource> = serde_json::from_value(world["videos"].clone()).ok();
    Home {
        distractors: serde_json::from_value(world["distractors"].clone()).ok(),
        videos: videos.map(|videos| videos.found(run)),
        video_count: world["video_count"].as_u64().and_then(|count| usize::try_from(count).ok()),
        task: info.as_ref().and_then(|info| info.task()).map(str::to_owned),
        action_repeat: world["action_repeat"].as_u64().and_then(|repeat| u32::try_from(repeat).ok()),
        look: serde_json::from_value(world["look"].clone()).unwrap_or_default(),
        evaluates_samples: online["evaluate_mode"] == false,
        protocol: online["protocol"].as_str().and_then(|name| {
            let wanted = online["control_steps"].as_u64()?;
            let episodes = online["final_episodes"].as_u64().and_then(|count| u32::try_from(count).ok())?;
            (lived(run)? >= wanted).then(|| (name.to_owned(), episodes))
        }),
    }
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

/// Loads the actor of a run's newest checkpoint.
fn load(path: &Path, task: &str) -> Result<(Box<dyn Policy>, ActedBy)> {
    let refuse = |fact: String, expected: &str| {
        let text = path.display().to_string();
        Error::from(WorldError::Policy { text, fact, expected: expected.to_owned() })
    };
    let trained = "a run that `vibes-train online` has trained";
    let checkpoint = RunFolder::at(path)
        .newest_checkpoint()
        .map_err(|_none| refuse("it holds no checkpoint".to_owned(), trained))?;
    let file = actor_file(&checkpoint).ok_or_else(|| refuse("it holds no actor".to_owned(), trained))?;
    let file = checkpoint.join(file);
    let agent =
        TrainedAgent::load(&checkpoint, &vibes_model::cpu()).map_err(|error| refuse(error.to_string(), trained))?;
    if agent.task() != task {
        return Err(refuse(format!("it was trained on {}", agent.task()), &format!("a run of {task}")));
    }
    let home = home(path);
    let pictures = match agent.observation() {
        ObservationKind::Pixels { height, .. } => Some(RenderSettings { size: height, look: home.look }),
        ObservationKind::Vector { .. } => None,
    };
    let weights = std::fs::read(&file).map_err(Error::io("read", &file))?;
    let last_part = |path: &Path| path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let whole = std::path::absolute(path).map_err(Error::io("find", path))?;
    let acted_by = ActedBy {
        run: last_part(&whole),
        checkpoint: format!("{}, {}", last_part(&checkpoint), &vibes_data::sha256_hex(&weights)[..12]),
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
            "action_repeat": 3, "distractors": settings, "videos": { "folder": "../../films" }, "video_count": 7, "look": "suite",
        });
        std::fs::write(run.join("online.json"), serde_json::json!({ "world": world }).to_string()).unwrap();
        let found = home(&run);
        assert_eq!((found.action_repeat, found.distractors, found.video_count), (Some(3), Some(settings), Some(7)));
        let Some(VideoSource::Folder(place)) = found.videos else { panic!("{:?}", found.videos) };
        assert_eq!(place.canonicalize().unwrap(), videos.canonicalize().unwrap());
        assert_eq!(found.look, Look::Suite);
        assert_eq!(home(folder.path()), Home::default(), "no run");
    }
}
