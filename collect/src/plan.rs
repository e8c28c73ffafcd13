//! What a recording is asked to be, and the list of episodes that follows from it.
//!
//! In: [`RecordOptions`], resolved and serialisable, which the manifest keeps. Out: one [`PlannedEpisode`] per episode: which state trajectory,
//! which distractor trajectory, and the seeds of both, which depend on the recording's seed and the trajectory's number alone. So a
//! recording can be stopped, gone on with and extended, and always holds the same episodes.

mod world;

use std::path::Path;

use serde::{Deserialize, Serialize};
use vibes_data::{Cell, Grid, MOST_ACTION_REPEAT, MOST_EPISODES, MOST_STEPS};

use crate::played::PlayedFile;
use crate::trained::{ActedBy, Home};
use crate::{Error, Result};
use vibes_env::PolicyMix;
use vibes_env::distractors::DistractorSettings;
use vibes_env::render::{Look, MAX_SIZE};
use vibes_env::videos::{MOST_VIDEOS, VideoSet, VideoSource};
pub use vibes_env::{ChosenSeeds, distractor_seed, state_seed};

/// Everything that decides what a recording holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordOptions {
    /// The task's name.
    pub task: String,
    /// Behaviour policies with their shares, as [`vibes_env::PolicyMix`] writes them.
    pub policy: String,
    /// The grid; without one, every episode has distractors of its own.
    pub grid: Option<Grid>,
    /// Number of episodes; with a grid, its number of cells.
    pub episodes: u32,
    /// Agent steps an episode.
    pub steps: u32,
    /// Control steps an agent step.
    pub action_repeat: u32,
    /// One torque per joint instead of the swimmer's wave.
    pub raw_torques: bool,
    /// Which distractors, how strong, and whether they move.
    pub distractors: DistractorSettings,
    /// Where background videos come from.
    pub videos: VideoSource,
    /// Training or held-out videos.
    pub video_set: VideoSet,
    /// How many videos; the suite's number for the difficulty when none is given.
    pub video_count: Option<usize>,
    /// Side of the pictures in pixels; none records no pictures.
    pub size: Option<u32>,
    /// How pictures are drawn.
    pub look: Look,
    /// Seeds of single axes.
    #[serde(default, skip_serializing_if = "ChosenSeeds::is_empty")]
    pub axis_seeds: ChosenSeeds,
    /// The trained runs among the policies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub acting: Vec<ActedBy>,
    /// The files of actions among the policies, in the order of the mix; none of a recording from before they were kept.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub actions: Vec<PlayedFile>,
    /// The protocol of the trained run that acts, where whole episodes of that run's own world are recorded: numbers of another world are not the protocol's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub protocol: Option<String>,
    /// Degrees by which the states were turned about the origin after they were simulated; see [`vibes_env::Task::rotate`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotated: Option<f64>,
    /// Whether policies that saw pictures acted under other distractors than these: their states were drawn again under new ones.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub redrawn: bool,
}

/// One episode to be recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlannedEpisode {
    /// Its number.
    pub index: u32,
    /// Its place in the grid.
    pub cell: Option<Cell>,
    /// Which state trajectory.
    pub state: u32,
    /// Which distractor trajectory.
    pub distractor: u32,
}

impl RecordOptions {
    /// The policies with their shares.
    ///
    /// # Errors
    /// [`vibes_env::Error::Policy`] where they are no mix, as of what an online run or Python recorded.
    pub fn mix(&self) -> Result<PolicyMix> {
        Ok(PolicyMix::written(&self.policy)?)
    }

    /// The episodes, by number: a grid row by row, or one distractor trajectory per state trajectory.
    pub fn episodes(&self) -> impl Iterator<Item = PlannedEpisode> + use<> {
        let grid = self.grid;
        (0..self.episodes).map(move |index| match grid {
            None => PlannedEpisode { index, cell: None, state: index, distractor: index },
            Some(Grid { distractors, .. }) => {
                let (state, distractor) = (index / distractors.max(1), index % distractors.max(1));
                PlannedEpisode { index, cell: Some(Cell { state, distractor }), state, distractor }
            }
        })
    }
}

impl RecordOptions {
    /// That its numbers are such as the command line takes. Those of a manifest, or of the run that acts, may be any: a damaged one would name billions of videos, or
    /// hold an action for as many steps. `place` is the recording.
    ///
    /// # Errors
    /// [`Error::Malformed`] names the first number that is not.
    pub fn check(&self, place: &Path) -> Result<()> {
        let bounds = [
            ("action_repeat", u64::from(self.action_repeat), 1, u64::from(MOST_ACTION_REPEAT)),
            ("video_count", self.video_count.map_or(1, |count| count as u64), 1, u64::from(MOST_VIDEOS)),
            ("size", self.size.map_or(1, u64::from), 1, MAX_SIZE as u64),
            ("steps", u64::from(self.steps), 0, u64::from(MOST_STEPS)),
            ("episodes", u64::from(self.episodes), 0, u64::from(MOST_EPISODES)),
        ];
        let wrong = bounds.into_iter().find(|&(_, found, least, most)| !(least..=most).contains(&found));
        wrong.map_or(Ok(()), |(name, found, least, most)| {
            let fact = format!("its option {name} is {found}");
            Err(Error::malformed(place, fact, format!("right is {least} to {most}")))
        })
    }

    /// The protocol of what is recorded: that of the run which acts, where nothing of its world is changed, videos are held out (in a folder still the same ones) and there are as many
    /// whole episodes as it asks for.
    pub fn protocol_of(&self, home: &Home) -> Option<String> {
        let (name, episodes) = home.protocol.as_ref()?;
        let whole = vibes_env::EPISODE_CONTROL_STEPS.div_ceil(self.action_repeat);
        let is_own = home.distractors == Some(self.distractors)
            && home.videos.as_ref() == Some(&self.videos)
            && self.videos_used(home.video_count) == self.videos_used(self.video_count)
            && home.action_repeat == Some(self.action_repeat)
            && home.look == self.look
            && self.steps == whole
            && self.axis_seeds.is_empty()
            && self.video_set == VideoSet::Val
            && self.grid.is_none()
            && self.episodes >= *episodes
            && self.holds_out_the_same(home);
        is_own.then(|| name.clone())
    }

    /// Whether the folder of the run's videos still holds out those that it did when the run was begun, where the run says them.
    fn holds_out_the_same(&self, home: &Home) -> bool {
        let Some(before) = &home.held_out_videos else { return true };
        self.videos.list(VideoSet::Val, self.videos_used(self.video_count)).is_ok_and(|now| now == *before)
    }

    /// How many videos of a set are used, where so many were asked for; the suite's number for the difficulty unless any were.
    fn videos_used(&self, asked: Option<usize>) -> Option<usize> {
        asked.or(self.distractors.difficulty.videos())
    }
}

/// The distractor trajectory under which a policy that sees pictures acts out a state trajectory: the one of the same number. It does not depend on the number of
/// columns, so that a grid can be made wider; on a square grid it is the diagonal, and without a grid every episode's own.
pub fn acting_distractor(state: u32) -> u32 {
    state
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trained::home;

    /// A hundred episodes in the world of a run.
    fn options() -> RecordOptions {
        RecordOptions {
            task: "reacher-easy".to_owned(),
            policy: "runs/own".to_owned(),
            grid: None,
            episodes: 100,
            steps: 250,
            action_repeat: 4,
            raw_torques: false,
            distractors: DistractorSettings::default(),
            videos: VideoSource::Procedural,
            video_set: VideoSet::Val,
            video_count: None,
            size: Some(64),
            look: Look::default(),
            axis_seeds: ChosenSeeds::default(),
            acting: Vec::new(),
            actions: Vec::new(),
            protocol: None,
            rotated: None,
            redrawn: false,
        }
    }

    #[test]
    fn numbers_that_the_command_line_does_not_take_are_refused() {
        let place = Path::new("recordings/damaged");
        options().check(place).unwrap();
        RecordOptions { video_count: Some(10_000), size: None, episodes: 0, ..options() }.check(place).unwrap();
        type Damage = fn(&mut RecordOptions);
        let damages: [(&str, Damage); 8] = [
            ("action_repeat is 0; right is 1 to 1000", |options| options.action_repeat = 0),
            ("action_repeat is 4294967295", |options| options.action_repeat = u32::MAX),
            ("video_count is 0; right is 1 to 10000", |options| options.video_count = Some(0)),
            ("video_count is 18446744073709551615", |options| options.video_count = Some(usize::MAX)),
            ("size is 0; right is 1 to 2048", |options| options.size = Some(0)),
            ("size is 4294967295", |options| options.size = Some(u32::MAX)),
            ("steps is 4294967295", |options| options.steps = u32::MAX),
            ("episodes is 4294967295", |options| options.episodes = u32::MAX),
        ];
        for (said, damage) in damages {
            let mut damaged = options();
            damage(&mut damaged);
            let error = damaged.check(place).unwrap_err().to_string();
            assert!(error.contains(said) && error.contains("recordings/damaged"), "{said}: {error}");
        }
    }

    /// What is recorded under other settings than the run's is not under its protocol.
    #[test]
    fn a_protocol_is_named_in_its_own_world_only() {
        let folder = tempfile::tempdir().unwrap();
        let settings = DistractorSettings::default();
        let world = serde_json::json!({ "action_repeat": 4, "distractors": settings, "videos": "procedural" });
        let online = serde_json::json!({
            "protocol": "dcs-easy-dynamic-500k", "world": world, "control_steps": 500_000, "final_episodes": 100,
        });
        std::fs::write(folder.path().join("online.json"), online.to_string()).unwrap();
        let checkpoint = folder.path().join("checkpoints/000009");
        std::fs::create_dir_all(&checkpoint).unwrap();
        let at = |control_steps: u32| {
            let state = serde_json::json!({ "control_steps": control_steps });
            std::fs::write(checkpoint.join("online.json"), state.to_string()).unwrap();
            home(folder.path())
        };
        let unfinished = at(499_000);
        let home = at(500_000);
        let own = options();
        assert_eq!(own.protocol_of(&home).as_deref(), Some("dcs-easy-dynamic-500k"));
        assert_eq!(own.protocol_of(&unfinished), None, "not all control steps");
        let in_words = RecordOptions { video_count: Some(4), ..own.clone() };
        assert_eq!(in_words.protocol_of(&home), own.protocol_of(&home), "as many videos as it has");
        let changes: [fn(&mut RecordOptions); 7] = [
            |options| options.look = Look::Suite,
            |options| options.steps = 100,
            |options| options.action_repeat = 2,
            |options| options.video_count = Some(300),
            |options| options.distractors.dynamic = false,
            |options| options.episodes = 3,
            |options| options.video_set = VideoSet::Train,
        ];
        for (place, change) in changes.into_iter().enumerate() {
            let mut other = own.clone();
            change(&mut other);
            assert_eq!(other.protocol_of(&home), None, "{place}");
        }
        assert_eq!(own.protocol_of(&Home::default()), None, "no protocol");
    }

    /// Returns under other films than the run's own evaluations are no numbers of its protocol.
    #[test]
    fn no_protocol_is_named_where_the_held_out_films_have_changed() {
        let folder = tempfile::tempdir().unwrap();
        let (run, films) = (folder.path().join("run"), folder.path().join("films"));
        for film in 0..8 {
            std::fs::create_dir_all(films.join(film.to_string())).unwrap();
            std::fs::write(films.join(film.to_string()).join("0.png"), []).unwrap();
        }
        let settings = DistractorSettings::default();
        let world =
            serde_json::json!({ "action_repeat": 4, "distractors": settings, "videos": { "folder": "../films" } });
        let online = serde_json::json!({
            "protocol": "dcs-easy-dynamic-500k", "world": world, "control_steps": 500_000, "final_episodes": 100,
            "held_out_videos": ["4", "5", "6", "7"],
        });
        std::fs::create_dir_all(run.join("checkpoints/000009")).unwrap();
        std::fs::write(run.join("online.json"), online.to_string()).unwrap();
        std::fs::write(run.join("checkpoints/000009/online.json"), "{\"control_steps\":500000}").unwrap();
        let home = home(&run);
        let own = RecordOptions { videos: home.videos.clone().unwrap(), ..options() };
        assert_eq!(own.protocol_of(&home).as_deref(), Some("dcs-easy-dynamic-500k"));
        let older = Home { held_out_videos: None, ..home.clone() };
        std::fs::rename(films.join("7"), films.join("9")).unwrap();
        assert_eq!(own.protocol_of(&home), None, "another film");
        assert_eq!(
            own.protocol_of(&older).as_deref(),
            Some("dcs-easy-dynamic-500k"),
            "an older run does not say its films"
        );
        std::fs::remove_dir_all(&films).unwrap();
        assert_eq!(own.protocol_of(&home), None, "none at all");
    }
}
