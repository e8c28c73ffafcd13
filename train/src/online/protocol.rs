//! Protocols: settings that numbers are published under, by one name, so that a number says what it is. In: a name and options. Out: the settings, or why
//! something asked for is not the protocol.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use vibes_env::distractors::{Difficulty, DistractorSettings};

use super::options::OnlineOptions;
use crate::error::{Result, TrainError};

/// A protocol.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Protocol {
    /// The Distracting Control Suite's easy dynamic benchmark as the paper reports it: the suite's action repeats, all three distractors, four training videos,
    /// 500,000 control steps, 100 final episodes on held-out videos.
    #[serde(rename = "dcs-easy-dynamic-500k")]
    DcsEasyDynamic500k,
}

const CONTROL_STEPS: u64 = 500_000;
const FINAL_EPISODES: u32 = 100;

/// The suite's action repeats.
const REPEATS: [(&str, u32); 6] = [
    ("ball_in_cup-catch", 4),
    ("cartpole-swingup", 8),
    ("cheetah-run", 4),
    ("finger-spin", 2),
    ("reacher-easy", 4),
    ("walker-walk", 2),
];

impl Protocol {
    /// Puts the protocol's settings in.
    pub fn settle(self, options: &mut OnlineOptions) {
        options.protocol = Some(self);
        options.control_steps = CONTROL_STEPS;
        options.final_episodes = FINAL_EPISODES;
        options.world.distractors = DistractorSettings::default();
        options.world.video_count = None;
        if let Some((_, repeat)) = REPEATS.iter().find(|(task, _)| *task == options.world.task) {
            options.world.action_repeat = *repeat;
        }
    }

    /// # Errors
    /// A setting is not the protocol's; the message names it.
    pub(super) fn check(self, options: &OnlineOptions) -> Result<()> {
        let world = &options.world;
        let refuse = |setting: &str, found: String, wanted: String| {
            Err(TrainError::Options(format!(
                "{self} has {setting} {wanted}, not {found}; leave out --protocol for other settings"
            )))
        };
        let Some((_, repeat)) = REPEATS.iter().find(|(task, _)| *task == world.task) else {
            let tasks = REPEATS.map(|(task, _)| task).join(", ");
            return refuse("the tasks", world.task.clone(), tasks);
        };
        if world.action_repeat != *repeat {
            return refuse("the action repeat", world.action_repeat.to_string(), repeat.to_string());
        }
        if options.control_steps != CONTROL_STEPS {
            return refuse("control steps", options.control_steps.to_string(), CONTROL_STEPS.to_string());
        }
        if options.final_episodes != FINAL_EPISODES {
            return refuse("final episodes", options.final_episodes.to_string(), FINAL_EPISODES.to_string());
        }
        let wanted = DistractorSettings::default();
        let is_easy = wanted.difficulty == Difficulty::Easy && wanted.dynamic;
        if !is_easy || world.distractors != wanted || world.video_count.is_some() {
            return refuse(
                "the distractors",
                "others".to_owned(),
                "all three axes, easy and dynamic, four videos".to_owned(),
            );
        }
        if world.size.is_none() {
            return refuse("observations", "vectors".to_owned(), "pictures".to_owned());
        }
        Ok(())
    }
}

impl fmt::Display for Protocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("dcs-easy-dynamic-500k")
    }
}

impl FromStr for Protocol {
    type Err = TrainError;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "dcs-easy-dynamic-500k" => Ok(Self::DcsEasyDynamic500k),
            _ => Err(TrainError::Options(format!("no protocol `{text}`; there is dcs-easy-dynamic-500k"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::prepare::{default_options, default_world};
    use super::*;

    fn settled(task: &str) -> OnlineOptions {
        let mut options = default_options(default_world(task).unwrap(), false);
        Protocol::DcsEasyDynamic500k.settle(&mut options);
        options
    }

    #[test]
    fn the_protocol_fixes_its_settings_and_refuses_others() {
        let options = settled("cartpole-swingup");
        assert_eq!((options.world.action_repeat, options.control_steps, options.final_episodes), (8, 500_000, 100));
        assert!(options.check().is_ok());
        let changes: [fn(&mut OnlineOptions); 5] = [
            |options| options.world.action_repeat = 4,
            |options| options.control_steps = 100_000,
            |options| options.final_episodes = 10,
            |options| options.world.distractors.dynamic = false,
            |options| options.world.size = None,
        ];
        for change in changes {
            let mut other = options.clone();
            change(&mut other);
            let error = other.check().unwrap_err().to_string();
            assert!(error.contains("dcs-easy-dynamic-500k has"), "{error}");
        }
        let error = settled("swimmer-10").check().unwrap_err().to_string();
        assert!(error.contains("walker-walk"), "{error}");
    }

    #[test]
    fn its_name_is_what_is_typed_and_written() {
        let protocol: Protocol = "dcs-easy-dynamic-500k".parse().unwrap();
        assert_eq!(serde_json::to_string(&protocol).unwrap(), format!("\"{protocol}\""));
        assert!("dcs".parse::<Protocol>().unwrap_err().to_string().contains("dcs-easy-dynamic-500k"));
    }
}
