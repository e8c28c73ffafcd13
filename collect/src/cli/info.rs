//! `vibes-collect info PATH`: what a recording holds.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use serde_json::Value;
use vibes_data::{EpisodeEntry, Manifest, Recording, Video};

use super::record::source_name;
use super::{Outcome, OutputArgs, idle, show};
use crate::care::merge::{MergedPart, merged_parts};
use crate::returns::Returns;
use crate::stored::missing;
use vibes_env::names::by_number;

/// Of a longer list this many are named.
const NAMED: usize = 8;

#[derive(Debug, Args)]
pub(super) struct InfoArgs {
    /// The recording's folder.
    path: PathBuf,
    /// List every episode; --json always does.
    #[arg(long)]
    episodes: bool,
}

#[allow(clippy::print_stdout, reason = "the command line's result")]
pub(super) fn run(args: &InfoArgs, output: OutputArgs) -> Result<Outcome> {
    if args.episodes && output.json {
        return Err(idle::option("--episodes", "--json lists every episode", "leave it out").into());
    }
    let recording = Recording::open(&args.path)?;
    if output.json {
        println!("{}", serde_json::to_string_pretty(recording.manifest())?);
        return Ok(Outcome::Done);
    }
    print!("{}", describe(&recording));
    if args.episodes {
        print!("{}", list(recording.episodes()));
    }
    Ok(Outcome::Done)
}

fn describe(recording: &Recording) -> String {
    let Manifest { spec, grid, videos, versions, seed, options, .. } = recording.manifest();
    let episodes = recording.episodes();
    let steps: u64 = episodes.iter().map(|entry| u64::from(entry.steps)).sum();
    let size: u64 = recording.bytes();
    let parts = spec.observation.iter().map(|part| format!("{} {}", part.name, part.len));
    let mut lines = vec![
        ("recording", recording.path().display().to_string()),
        (
            "task",
            format!(
                "{}, {} control steps of {} s per agent step",
                spec.task, spec.action_repeat, spec.control_timestep
            ),
        ),
        (
            "episodes",
            format!(
                "{}{}, {} steps, {} rows, {}",
                episodes.len(),
                missing(recording),
                steps,
                steps + episodes.len() as u64,
                show::bytes(size)
            ),
        ),
    ];
    if let Some(grid) = grid {
        lines.push((
            "grid",
            format!("{} state trajectories x {} distractor trajectories", grid.states, grid.distractors),
        ));
    }
    lines.extend(protocol(recording).map(|line| ("protocol", line)));
    lines.push(("returns", returns(recording)));
    let policies = by_policy(episodes);
    lines.extend(policies.iter().map(|line| ("", line.clone())));
    lines.push(("action", format!("{} numbers in {:?} to {:?}", spec.action_len(), spec.action.min, spec.action.max)));
    lines.push(("observation", parts.collect::<Vec<_>>().join(", ")));
    lines.push(("state", format!("qpos {}, qvel {}", spec.qpos, spec.qvel)));
    lines.push(("pixels", spec.pixels.map_or("none".into(), |size| format!("{} x {} RGB", size.height, size.width))));
    let parts = merged_parts(recording.manifest());
    if parts.is_none() {
        lines.push(("distractors", distractors(options)));
    }
    lines.push(("videos", name_videos(videos)));
    match parts {
        None => lines.push(("seed", seed.to_string())),
        Some(parts) => lines.extend(name_parts(&parts).into_iter().map(|line| ("part", line))),
    }
    lines.push((
        "versions",
        versions.iter().map(|(name, version)| format!("{name} {version}")).collect::<Vec<_>>().join(", "),
    ));
    lines.iter().map(|(key, value)| format!("{key:12} {value}\n")).collect()
}

/// The protocol, and whether the returns are its result: a run's replay is what was learned from, and fewer episodes than were asked for are not the protocol's.
fn protocol(recording: &Recording) -> Option<String> {
    let options = &recording.manifest().options;
    let (name, videos) = (options["protocol"].as_str()?, source_name(options)?);
    let state = match options["episodes"].as_u64() {
        None | Some(0) => "; what a run under it lived through, and no result of it",
        Some(asked) if (recording.episodes().len() as u64) < asked => "; no result of it until all episodes are there",
        Some(_) => "",
    };
    Some(format!("{name}, videos {videos}{state}"))
}

/// Over state trajectories, as every recording says it at its end.
fn returns(recording: &Recording) -> String {
    let Some(Returns { mean_return, returns, .. }) = Returns::of(recording) else { return "none yet".into() };
    let (low, high) = returns
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| (low.min(value), high.max(value)));
    format!("mean {mean_return:.1}, lowest {low:.1}, highest {high:.1}, of {} state trajectories", returns.len())
}

/// The policies in the order in which people count, of many the first few.
fn by_policy(episodes: &[EpisodeEntry]) -> Vec<String> {
    let mut policies: BTreeMap<&str, Vec<&EpisodeEntry>> = BTreeMap::new();
    for entry in episodes {
        policies.entry(&entry.policy).or_default().push(entry);
    }
    let mut policies: Vec<_> = policies.into_iter().collect();
    policies.sort_by(|(one, _), (other, _)| by_number(one, other));
    let line = |(policy, entries): &(&str, Vec<&EpisodeEntry>)| {
        let mean = Returns::of_episodes(entries.iter().copied()).map_or(f64::NAN, |returns| returns.mean_return);
        format!("{policy}: {} episodes, mean return {mean:.1}", entries.len())
    };
    first_few(policies.iter().map(line), "policies")
}

/// What kinds of distractors there are, in the words of the options.
fn distractors(options: &Value) -> String {
    options.get("distractors").map_or("unknown".into(), ToString::to_string)
}

/// What a recording was merged of, each part with the seed and the distractors that were its own.
fn name_parts(parts: &[MergedPart]) -> Vec<String> {
    let line = |part: &MergedPart| {
        let MergedPart { name, episodes, seed, options, .. } = part;
        format!("{name}: {episodes} episodes, seed {seed}, distractors {}", distractors(options))
    };
    first_few(parts.iter().map(line), "parts")
}

/// The first few of a list, and how many there are.
fn first_few(list: impl ExactSizeIterator<Item = String>, what: &str) -> Vec<String> {
    let count = list.len();
    let more = (count > NAMED).then(|| format!("… {count} {what} in all"));
    list.take(NAMED).chain(more).collect()
}

fn list(episodes: &[EpisodeEntry]) -> String {
    let cell = |entry: &EpisodeEntry| {
        entry.cell.map_or(String::new(), |cell| format!("cell {},{}  ", cell.state, cell.distractor))
    };
    let line = |entry: &EpisodeEntry| {
        format!(
            "{:06}  {}{} steps  return {:.1}  {}\n",
            entry.index,
            cell(entry),
            entry.steps,
            entry.episode_return,
            entry.policy
        )
    };
    episodes.iter().map(line).collect()
}

/// The videos by name, of many the first few.
fn name_videos(videos: &[Video]) -> String {
    let named = videos.iter().map(|video| format!("{} ({} frames)", video.name, video.frames));
    if videos.is_empty() { "none".into() } else { first_few(named, "videos").join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn policies_are_counted_and_of_many_the_first_few_are_named() {
        let entry = |update: u32| EpisodeEntry {
            index: update,
            cell: None,
            steps: 1,
            episode_return: f64::from(update),
            policy: format!("run, update {update}"),
            seed: 0,
            model_overrides: Value::Null,
            arrow: vibes_data::FileEntry::default(),
            mcap: None,
        };
        let entries: Vec<EpisodeEntry> = (1..=12).map(entry).collect();
        let lines = by_policy(&entries);
        assert_eq!(lines.len(), NAMED + 1);
        assert_eq!(lines[1], "run, update 2: 1 episodes, mean return 2.0");
        assert_eq!(lines[NAMED], "… 12 policies in all");
        assert_eq!(by_policy(&entries[..NAMED]).len(), NAMED);
    }
}
