//! `scene`: a Rerun recording to walk through.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::Context;
use serde_json::json;
use vibes_command::{Given, options_of};
use vibes_data::{Decoded, Recording};

use super::maps::MapOptions;
use super::nn::rows_elsewhere;
use super::session::{Input, Session};
use super::{Globals, Outcome, wrong};
use crate::input::{Run, newest_latents};
use crate::metrics::HELD_OUT_RETURN;
use crate::scene::Scene;
use crate::scene::progress::Progress;
use vibes_measure::neighbours::{Exclude, Metric, Space, nearest};

/// Write a Rerun scene (.rrd) to walk through: frame, latent, map, neighbours, reward and distractors on one timeline.
///
/// Of an online run that has no latents, or with --replay, it shows the episodes as the policy improved, on the timeline of control steps. Open it
/// with `rerun scene.rrd` (Rerun 0.36).
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    given: Given,
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    map: MapOptions,
    /// Episodes to show, in place of as many as make up --max-rows.
    #[arg(long, value_name = "E,…", value_delimiter = ',', conflicts_with = "max_rows")]
    episodes: Vec<u32>,
    /// Most rows to show when episodes are not named.
    #[arg(long, default_value_t = 2000)]
    max_rows: usize,
    /// Show the episodes of an online run (RUN/replay) as the policy improved, in place of latents.
    #[arg(long)]
    replay: bool,
    /// A column to colour the map by: of the latents' table or of one that is joined.
    #[arg(long, value_name = "COLUMN")]
    color: Option<String>,
    /// Neighbours shown beside each row.
    #[arg(long, short, default_value_t = 5)]
    k: usize,
}

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    if options.max_rows == 0 {
        return Err(wrong("--max-rows is 0, at least 1 is needed"));
    }
    let run = options.input.folder();
    let lived = run.filter(|run| run.join("replay/manifest.json").is_file());
    match lived {
        Some(run) if options.replay || newest_latents(run).is_err() => return progress(options, run),
        None if options.replay => {
            return Err(wrong("--replay shows an online run; name its folder (it has a folder `replay`)"));
        }
        _ => {}
    }
    let given =
        json!({ "episodes": options.episodes, "max_rows": options.max_rows, "k": options.k, "color": options.color });
    let color: Vec<String> = options.color.iter().cloned().collect();
    let mut session = Session::open_with(&options.input, globals, "scene", given, &color)?;
    let (rows, episodes) = choose(options, &session)?;
    let frames = session.frames()?;
    if frames.is_none() && !session.without_frames() {
        session.remark("these latents name no recording, so the scene has no pictures (name one with --recording)");
    }
    let made = options.map.map_or_other(&mut session, globals)?;
    let (k, exclude) = match rows_elsewhere(&session.latents.episode) {
        0 => {
            session.remark("these latents are of one episode, so that its own rows count as neighbours");
            (options.k.min(session.latents.len() - 1), Exclude::Itself)
        }
        elsewhere => (options.k.min(elsewhere), Exclude::Trajectory),
    };
    if k < options.k {
        session.remark(format!("every row has {k} neighbours rather than {}: there are no more that count", options.k));
    }
    let neighbours = nearest(&Space::new(session.table()?, Metric::Standardized)?, &rows, k, exclude)?;
    // Only the decoder's own rows have its pictures; it is left out where it drew another recording's.
    let drawn = session.path.parent().map(|run| run.join("decoded.arrow")).and_then(|path| Decoded::read(&path).ok());
    let decoded = drawn.filter(|decoded| decoded.recording == session.latents.source.recording);
    let path = session.out.join("scene.rrd");
    let scene = Scene {
        latents: &session.latents,
        frames: frames.as_ref(),
        positions: &made.positions,
        color: session.columns.first().map(|(_, column)| column),
        rows: &rows,
        neighbours: &neighbours,
        decoded: decoded.as_ref(),
        note: session.note(),
    };
    scene.write(&path)?;
    let line = format!(
        "scene: {} rows of {} episodes with {} neighbours each; open it with `rerun {}`",
        rows.len(),
        episodes.len(),
        k,
        path.display()
    );
    session.outcome.files.push(path);
    session.write_json("scene", &json!({ "episodes": episodes, "rows": rows.len(), "quality": made.quality }))?;
    Ok(session.finish(line))
}

/// Episodes shown of an online run unless they are named.
const SHOWN: usize = 12;

/// The scene of an online run.
fn progress(options: &Options, run: &Path) -> anyhow::Result<Outcome> {
    let of_map = options_of::<MapOptions>();
    let of_latents = ["recording", "no_frames", "seed", "note", "where", "join", "max_rows", "k", "color"];
    if let Some(option) = options.given.first_of(of_latents.into_iter().chain(of_map.iter().map(String::as_str))) {
        return Err(wrong(format!("{option} has no effect on the scene of an online run's episodes; leave it out")));
    }
    let replay = Recording::open(&run.join("replay")).context("the run's replay cannot be read")?;
    let all: Vec<u32> = replay.episodes().iter().map(|entry| entry.index).collect();
    if let Some(missing) = options.episodes.iter().find(|episode| !all.contains(episode)) {
        return Err(wrong(format!("--episodes {missing}: the replay has no such episode (it has {})", all.len())));
    }
    let count = SHOWN.min(all.len());
    // The first and the last are among them.
    let spread = (0..count).map(|i| all[i * (all.len() - 1) / (count - 1).max(1)]);
    let mut shown: Vec<u32> = if options.episodes.is_empty() { spread.collect() } else { options.episodes.clone() };
    shown.sort_unstable();
    shown.dedup();
    let read = Run::read(run).ok();
    let sees_videos = read.as_ref().is_some_and(Run::sees_videos);
    let evaluations = read.and_then(|run| run.series.get(HELD_OUT_RETURN).cloned()).unwrap_or_default();
    let name = run.file_name().map_or_else(|| "run".into(), |name| name.to_string_lossy().into_owned());
    let out = options.input.output().unwrap_or_else(|| run.join("figures"));
    std::fs::create_dir_all(&out).with_context(|| format!("cannot create the folder {}", out.display()))?;
    let path = out.join("scene.rrd");
    Progress { name: &name, replay: &replay, shown: &shown, evaluations: &evaluations, sees_videos }.write(&path)?;
    let line = format!(
        "scene: {} of the {} episodes of the run, as the policy improved; open it with `rerun {}`",
        shown.len(),
        all.len(),
        path.display()
    );
    let json = json!({ "episodes": shown, "of": all.len(), "evaluations": evaluations.len() });
    Ok(Outcome { line, remarks: Vec::new(), files: vec![path], json })
}

/// The rows to show, episode by episode in order of time, and the episodes.
fn choose(options: &Options, session: &Session) -> anyhow::Result<(Vec<usize>, Vec<u32>)> {
    let l = &session.latents;
    let mut by_episode: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for row in 0..l.len() {
        by_episode.entry(l.episode[row]).or_default().push(row);
    }
    if let Some(missing) = options.episodes.iter().find(|e| !by_episode.contains_key(e)) {
        return Err(wrong(format!(
            "--episodes {missing}: these latents have no such episode (they have {})",
            by_episode.len()
        )));
    }
    let named: BTreeSet<u32> = options.episodes.iter().copied().collect();
    let mut rows = Vec::new();
    let mut episodes = Vec::new();
    // Episodes spread over the table, so that a grid shows several states.
    let count = (options.max_rows / (l.len() / by_episode.len()).max(1)).clamp(1, by_episode.len());
    let stride = by_episode.len() as f64 / count as f64;
    let spread: BTreeSet<usize> = (0..count).map(|i| (i as f64 * stride) as usize).collect();
    for (i, (episode, mut its)) in by_episode.into_iter().enumerate() {
        if if named.is_empty() { spread.contains(&i) } else { named.contains(&episode) } {
            its.sort_by_key(|&row| l.step[row]);
            rows.extend(its);
            episodes.push(episode);
        }
    }
    Ok((rows, episodes))
}
