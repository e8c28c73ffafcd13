//! Protocols: settings that numbers are published under, by one name, so that a number says what it is. In: a name and a task. Out: the settings.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use vibes_env::distractors::DistractorSettings;
use vibes_env::suite_tasks;

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

/// What a protocol fixes for a task.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Control steps an action is held.
    pub action_repeat: u32,
    /// Control steps in all.
    pub control_steps: u64,
    /// Episodes of the last evaluation.
    pub final_episodes: u32,
    /// The distractors; of videos as many as the suite has at their difficulty.
    pub distractors: DistractorSettings,
}

impl Protocol {
    /// Its settings for a task; none for a task that it does not have.
    pub fn settings(self, task: &str) -> Option<Settings> {
        let (_, action_repeat) = suite_tasks().into_iter().find(|(name, _)| *name == task)?;
        Some(Settings {
            action_repeat,
            control_steps: CONTROL_STEPS,
            final_episodes: FINAL_EPISODES,
            distractors: DistractorSettings::default(),
        })
    }

    /// Its tasks.
    pub fn tasks(self) -> impl Iterator<Item = &'static str> {
        suite_tasks().into_iter().map(|(task, _)| task)
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
    use vibes_env::distractors::Difficulty;

    use super::*;

    #[test]
    fn its_name_is_what_is_typed_and_written() {
        let protocol: Protocol = "dcs-easy-dynamic-500k".parse().unwrap();
        assert_eq!(serde_json::to_string(&protocol).unwrap(), format!("\"{protocol}\""));
        assert!("dcs".parse::<Protocol>().unwrap_err().to_string().contains("dcs-easy-dynamic-500k"));
    }

    #[test]
    fn it_has_settings_for_the_tasks_of_the_suite_and_no_other() {
        let protocol = Protocol::DcsEasyDynamic500k;
        for (task, action_repeat) in suite_tasks() {
            assert_eq!(protocol.settings(task).map(|settings| settings.action_repeat), Some(action_repeat), "{task}");
        }
        assert_eq!(protocol.tasks().count(), 6);
        assert_eq!(protocol.settings("swimmer-5"), None);
    }

    #[test]
    fn its_distractors_are_easy_and_move() {
        let settings = Protocol::DcsEasyDynamic500k.settings("walker-walk").unwrap();
        assert_eq!((settings.distractors.difficulty, settings.distractors.dynamic), (Difficulty::Easy, true));
    }
}
