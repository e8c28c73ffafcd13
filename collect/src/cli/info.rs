//! `vibes-collect info PATH`: what a recording holds.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use vibes_data::{EpisodeEntry, Manifest, Recording, Video};

use super::{Outcome, OutputArgs, idle, show};
use crate::stored::missing;

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
    lines.push(("returns", returns(episodes)));
    let policies = by_policy(episodes);
    lines.extend(policies.iter().map(|line| ("", line.clone())));
    lines.push(("action", format!("{} numbers in {:?} to {:?}", spec.action_len(), spec.action.min, spec.action.max)));
    lines.push(("observation", parts.collect::<Vec<_>>().join(", ")));
    lines.push(("state", format!("qpos {}, qvel {}", spec.qpos, spec.qvel)));
    lines.push(("pixels", spec.pixels.map_or("none".into(), |size| format!("{} x {} RGB", size.height, size.width))));
    lines.push(("distractors", options.get("distractors").map_or("unknown".into(), ToString::to_string)));
    lines.push(("videos", name_videos(videos)));
    lines.push(("seed", seed.to_string()));
    lines.push((
        "versions",
        versions.iter().map(|(name, version)| format!("{name} {version}")).collect::<Vec<_>>().join(", "),
    ));
    lines.iter().map(|(key, value)| format!("{key:12} {value}\n")).collect()
}

fn returns(episodes: &[EpisodeEntry]) -> String {
    let values = episodes.iter().map(|entry| entry.episode_return);
    let (low, high) =
        values.clone().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    match episodes.len() {
        0 => "none yet".into(),
        count => format!("mean {:.1}, lowest {low:.1}, highest {high:.1}", values.sum::<f64>() / count as f64),
    }
}

fn by_policy(episodes: &[EpisodeEntry]) -> Vec<String> {
    let mut policies: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for entry in episodes {
        policies.entry(&entry.policy).or_default().push(entry.episode_return);
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    policies
        .iter()
        .map(|(policy, values)| format!("{policy}: {} episodes, mean return {:.1}", values.len(), mean(values)))
        .collect()
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
    const NAMED: usize = 8;
    let mut names: Vec<String> =
        videos.iter().take(NAMED).map(|video| format!("{} ({} frames)", video.name, video.frames)).collect();
    match videos.len() {
        0 => "none".into(),
        count if count > NAMED => {
            names.push(format!("… {count} in all"));
            names.join(", ")
        }
        _ => names.join(", "),
    }
}
