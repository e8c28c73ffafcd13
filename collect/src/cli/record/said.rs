//! What recording, or evaluating without a recording, says at its end. In: episodes, their returns, what the run began with that acts. Out: JSON, or one line for people.

use std::path::Path;

use serde::Serialize;
use serde_json::Value;
use vibes_data::Recording;

use super::super::show;
use crate::returns::Returns;
use crate::trained::Home;
use vibes_env::videos::VideoSource;

/// The result as JSON; the returns stand beside the others.
#[derive(Serialize)]
pub(super) struct Said<'a> {
    /// The recording's folder; none of an evaluation without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    recording: Option<&'a Path>,
    episodes: usize,
    seconds: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    protocol: Option<&'a str>,
    /// Where the videos of a protocol come from: `procedural`, or the name of a folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    videos: Option<String>,
    /// How the pictures were drawn that the policy saw under a protocol, which leaves that free.
    #[serde(skip_serializing_if = "Option::is_none")]
    look: Option<&'a str>,
    /// Control steps of the recordings that the run began with which acts.
    #[serde(skip_serializing_if = "Option::is_none")]
    given_control_steps: Option<u64>,
    /// What that number is known from, where that is not the recordings: those that are gone are counted with every view of an episode.
    #[serde(skip_serializing_if = "Option::is_none")]
    given_from: Option<&'a str>,
    #[serde(flatten)]
    returns: Option<Returns>,
}

/// The source of the videos that options name: `procedural`, or the name of a folder.
pub(crate) fn source_name(options: &Value) -> Option<String> {
    let source: VideoSource = serde_json::from_value(options["videos"].clone()).ok()?;
    Some(source.name())
}

impl<'a> Said<'a> {
    /// Of a recording, of which so many episodes were `wanted`, by a run with this home, if one acts.
    pub(super) fn of(
        recording: &'a Recording,
        folder: &'a Path,
        (wanted, home): (u64, &'a Home),
        seconds: f64,
    ) -> Self {
        let (episodes, options) = (recording.episodes().len(), &recording.manifest().options);
        // Fewer episodes than were asked for are not the protocol's.
        let options = (episodes as u64 >= wanted).then_some(options);
        let said = Self::earned(episodes, options, home, (Returns::of(recording), seconds));
        Self { recording: Some(folder), ..said }
    }

    /// Of so many episodes of which nothing is kept; under the protocol that the `options` name, if they are given.
    pub(super) fn earned(
        episodes: usize,
        options: Option<&'a Value>,
        home: &'a Home,
        (returns, seconds): (Option<Returns>, f64),
    ) -> Self {
        let options = options.filter(|options| options["protocol"].is_string());
        Self {
            recording: None,
            episodes,
            seconds,
            protocol: options.and_then(|options| options["protocol"].as_str()),
            videos: options.and_then(source_name),
            look: options.and_then(|options| options["look"].as_str()),
            given_control_steps: home.given_control_steps,
            given_from: home.given_from.as_deref(),
            returns,
        }
    }

    /// The same in one line.
    pub(super) fn in_words(&self, recording: &Recording) -> String {
        let frames: u64 = recording.episodes().iter().map(|entry| u64::from(entry.steps) + 1).sum();
        format!(
            "{}: {} episodes, {frames} frames, {}{}, in {:.1} s",
            recording.path().display(),
            self.episodes,
            show::bytes(recording.bytes()),
            self.returned(),
            self.seconds
        )
    }

    /// The same of an evaluation that leaves no recording.
    pub(super) fn in_words_alone(&self) -> String {
        format!("not recorded: {} episodes{}, in {:.1} s", self.episodes, self.returned(), self.seconds)
    }

    /// `, mean return 123.4 (95% interval 120.0 to 126.8)`, and under what.
    fn returned(&self) -> String {
        let returns = self.returns.as_ref().map_or_else(String::new, |Returns { mean_return, interval, .. }| {
            let interval =
                interval.map_or_else(String::new, |[low, high]| format!(" (95% interval {low:.1} to {high:.1})"));
            format!(", mean return {mean_return:.1}{interval}")
        });
        returns + &self.under()
    }

    /// `, under PROTOCOL (videos procedural)` where it is under one, and what the run that acts began with.
    fn under(&self) -> String {
        let videos = self.videos.as_deref().unwrap_or("unknown");
        let protocol = self.protocol.map_or_else(String::new, |name| format!(", under {name} (videos {videos})"));
        let given = self.given_control_steps.map_or_else(String::new, |steps| {
            let gone = if self.given_from.is_some() { ", every view of those that are gone counted" } else { "" };
            format!(", by a run that began with {steps} control steps of recordings and of runs before it{gone}")
        });
        protocol + &given
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_recording_names_its_protocol_and_what_the_run_that_acts_began_with() {
        let folder = tempfile::tempdir().unwrap();
        let sample = concat!(env!("CARGO_MANIFEST_DIR"), "/../data/sample/manifest.json");
        let mut manifest: Value = serde_json::from_slice(&std::fs::read(sample).unwrap()).unwrap();
        manifest["options"]["protocol"] = "dcs-easy-dynamic-500k".into();
        std::fs::write(folder.path().join("manifest.json"), manifest.to_string()).unwrap();
        let recording = Recording::open(folder.path()).unwrap();
        let (whole, given_from) = (recording.episodes().len() as u64, Some("run.json".to_owned()));
        let home = Home { given_control_steps: Some(1_500_000), given_from, ..Home::default() };
        let said = Said::of(&recording, folder.path(), (whole, &home), 1.0);
        let line = said.in_words(&recording);
        assert!(line.contains(", under dcs-easy-dynamic-500k (videos procedural), by a run that began with"), "{line}");
        assert!(line.contains("1500000 control steps of recordings and of runs before it, every view"), "{line}");
        let json = serde_json::to_value(&said).unwrap();
        assert_eq!(json["protocol"], "dcs-easy-dynamic-500k");
        assert_eq!((&json["given_control_steps"], &json["given_from"]), (&1_500_000.into(), &"run.json".into()));
        let home = Home::default();
        let part = Said::of(&recording, folder.path(), (whole + 1, &home), 1.0);
        let (line, json) = (part.in_words(&recording), serde_json::to_value(&part).unwrap());
        assert!(!line.contains(", under ") && !line.contains(" began with "), "{line}");
        assert!(json.get("protocol").is_none() && json.get("given_control_steps").is_none(), "{json}");
    }

    #[test]
    fn an_evaluation_without_a_recording_says_the_same_of_what_was_earned() {
        let options =
            serde_json::json!({ "protocol": "dcs-easy-dynamic-500k", "videos": "procedural", "look": "fast" });
        let home = Home { given_control_steps: Some(640), ..Home::default() };
        let said = Said::earned(2, Some(&options), &home, (Returns::of_episodes([(1.0, 0), (3.0, 1)]), 1.0));
        let (line, json) = (said.in_words_alone(), serde_json::to_value(&said).unwrap());
        assert!(line.starts_with("not recorded: 2 episodes, mean return 2.0 (95% interval "), "{line}");
        assert!(
            line.contains(", under dcs-easy-dynamic-500k (videos procedural), by a run that began with 640"),
            "{line}"
        );
        assert_eq!((&json["mean_return"], &json["returns"]), (&2.0.into(), &serde_json::json!([1.0, 3.0])));
        assert_eq!((&json["protocol"], &json["look"]), (&"dcs-easy-dynamic-500k".into(), &"fast".into()));
        assert!(json.get("recording").is_none(), "{json}");
    }
}
