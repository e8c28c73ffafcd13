//! `vibes-collect info PATH`: what a recording holds.

mod words;

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use vibes_data::{EpisodeEntry, Manifest, Recording};

use super::record::source_name;
use super::{Outcome, OutputArgs, idle, show};
use crate::care::merge::{MergedPart, merged_parts};
use crate::returns::{Returns, acted};
use crate::stored::missing;
use vibes_env::names::by_number;
use words::{broken, distractors, first_few, logs, others, part_of, pixels, videos};

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
    let acted = acted(recording);
    let mut lines = of_episodes(recording);
    lines.push(("returns", returns(recording, &acted)));
    lines.extend(by_policy(recording.episodes(), &acted).into_iter().map(|line| ("", line)));
    lines.extend(of_rows(recording.manifest()));
    lines.iter().map(|(key, value)| format!("{key:12} {value}\n")).collect()
}

/// How many episodes there are, of what, and whether they are whole.
fn of_episodes(recording: &Recording) -> Vec<(&'static str, String)> {
    let Manifest { spec, grid, options, .. } = recording.manifest();
    let episodes = recording.episodes();
    let steps: u64 = episodes.iter().map(|entry| u64::from(entry.steps)).sum();
    let clock = format!("{} control steps of {} s per agent step", spec.action_repeat, spec.control_timestep);
    let (count, rows) = (episodes.len(), steps + episodes.len() as u64);
    let size = show::bytes(recording.bytes());
    let mut lines = vec![
        ("recording", recording.path().display().to_string()),
        ("task", format!("{}, {clock}", spec.task)),
        ("episodes", format!("{count}{}, {steps} steps, {rows} rows, {size}", missing(recording))),
    ];
    lines.extend(broken(recording).map(|line| ("files", line)));
    lines.extend(others(recording).map(|line| ("others", line)));
    lines.push(("logs", logs(episodes)));
    lines.extend(part_of(options).map(|line| ("part of", line)));
    if let Some(grid) = grid {
        let size = format!("{} state trajectories x {} distractor trajectories", grid.states, grid.distractors);
        lines.push(("grid", size));
        let (cells, all) = (count as u64, u64::from(grid.states) * u64::from(grid.distractors));
        lines.extend((cells < all).then(|| ("cells", format!("{cells} of {all}"))));
    }
    lines.extend(protocol(recording).map(|line| ("protocol", line)));
    lines
}

/// What a row holds, and where it comes from.
fn of_rows(manifest: &Manifest) -> Vec<(&'static str, String)> {
    let Manifest { spec, versions, seed, options, .. } = manifest;
    let parts = spec.observation.iter().map(|part| format!("{} {}", part.name, part.len));
    let mut lines = vec![
        ("action", format!("{} numbers in {:?} to {:?}", spec.action_len(), spec.action.min, spec.action.max)),
        ("observation", parts.collect::<Vec<_>>().join(", ")),
        ("state", format!("qpos {}, qvel {}", spec.qpos, spec.qvel)),
        ("pixels", pixels(manifest)),
    ];
    let parts = merged_parts(manifest);
    if parts.is_none() {
        lines.push(("distractors", distractors(options)));
    }
    lines.push(("videos", videos(&manifest.videos)));
    match parts {
        None => lines.push(("seed", seed.to_string())),
        Some(parts) => lines.extend(name_parts(&parts).into_iter().map(|line| ("part", line))),
    }
    let versions = versions.iter().map(|(name, version)| format!("{name} {version}"));
    lines.push(("versions", versions.collect::<Vec<_>>().join(", ")));
    lines
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
fn returns(recording: &Recording, acted: &[u32]) -> String {
    let found = Returns::of_episodes(earned(recording.episodes(), acted));
    let Some(Returns { mean_return, returns, .. }) = found else { return "none yet".into() };
    let (low, high) = returns
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| (low.min(value), high.max(value)));
    format!("mean {mean_return:.1}, lowest {low:.1}, highest {high:.1}, of {} state trajectories", returns.len())
}

/// The return and the state trajectory of every episode.
fn earned<'e>(episodes: &'e [EpisodeEntry], acted: &'e [u32]) -> impl Iterator<Item = (f64, u32)> + 'e {
    episodes.iter().map(|entry| entry.episode_return).zip(acted.iter().copied())
}

/// The policies in the order in which people count, of many the first few.
fn by_policy(episodes: &[EpisodeEntry], acted: &[u32]) -> Vec<String> {
    let mut policies: BTreeMap<&str, Vec<(f64, u32)>> = BTreeMap::new();
    for (entry, earned) in episodes.iter().zip(earned(episodes, acted)) {
        policies.entry(&entry.policy).or_default().push(earned);
    }
    let mut policies: Vec<_> = policies.into_iter().collect();
    policies.sort_by(|(one, _), (other, _)| by_number(one, other));
    let line = |(policy, earned): &(&str, Vec<(f64, u32)>)| {
        let mean = Returns::of_episodes(earned.iter().copied()).map_or(f64::NAN, |returns| returns.mean_return);
        format!("{policy}: {} episodes, mean return {mean:.1}", earned.len())
    };
    first_few(policies.iter().map(line), "policies")
}

/// What a recording was merged of, each part with the seed and the distractors that were its own.
fn name_parts(parts: &[MergedPart]) -> Vec<String> {
    let line = |part: &MergedPart| {
        let MergedPart { name, episodes, seed, options, .. } = part;
        format!("{name}: {episodes} episodes, seed {seed}, distractors {}", distractors(options))
    };
    first_few(parts.iter().map(line), "parts")
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

#[cfg(test)]
mod tests {
    use serde_json::Value;

    use super::words::NAMED;
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
        let acted: Vec<u32> = (1..=12).collect();
        let lines = by_policy(&entries, &acted);
        assert_eq!(lines.len(), NAMED + 1);
        assert_eq!(lines[1], "run, update 2: 1 episodes, mean return 2.0");
        assert_eq!(lines[NAMED], "… 12 policies in all");
        assert_eq!(by_policy(&entries[..NAMED], &acted[..NAMED]).len(), NAMED);
        let views = by_policy(&[0; 3].map(|_| entries[0].clone()), &[7, 7, 7]);
        assert_eq!(views, ["run, update 1: 3 episodes, mean return 1.0"]);
    }
}
