//! `scene`: a Rerun recording to walk through.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::json;

use super::maps::MapOptions;
use super::session::{Input, Session};
use super::{Globals, Outcome, wrong};
use crate::scene::Scene;
use vibes_measure::neighbours::{Exclude, Metric, Space, nearest};

/// A Rerun scene (.rrd): frame, latent, map with the current point lit, nearest neighbours, reward and distractors on one timeline.
///
/// Open it with `rerun scene.rrd` (Rerun 0.36).
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    input: Input,
    #[command(flatten)]
    map: MapOptions,
    /// Episodes to show, in place of as many as make up --max-rows.
    #[arg(long, value_name = "E,…", value_delimiter = ',')]
    episodes: Vec<u32>,
    /// Most rows to show when episodes are not named.
    #[arg(long, default_value_t = 2000)]
    max_rows: usize,
    /// Neighbours shown beside each row.
    #[arg(long, short, default_value_t = 5)]
    k: usize,
}

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    let given = json!({ "map": options.map.json(), "episodes": options.episodes, "max_rows": options.max_rows, "k": options.k });
    let mut session = Session::open(&options.input, globals, "scene", given)?;
    let (rows, episodes) = choose(options, &session)?;
    let frames = session.frames()?;
    if frames.is_none() && !session.without_frames() {
        session.remark("these latents name no recording, so the scene has no pictures (name one with --recording)");
    }
    let made = options.map.map(&mut session, globals)?;
    let neighbours =
        nearest(&Space::new(session.table()?, Metric::Standardized)?, &rows, options.k, Exclude::Trajectory)?;
    let path = session.out.join("scene.rrd");
    let scene = Scene {
        latents: &session.latents,
        frames: frames.as_ref(),
        positions: &made.positions,
        rows: &rows,
        neighbours: &neighbours,
        note: session.note(),
    };
    scene.write(&path)?;
    let line = format!(
        "scene: {} rows of {} episodes with {} neighbours each; open it with `rerun {}`",
        rows.len(),
        episodes.len(),
        options.k,
        path.display()
    );
    session.outcome.files.push(path);
    session.write_json("scene", &json!({ "episodes": episodes, "rows": rows.len(), "quality": made.quality }))?;
    Ok(session.finish(line))
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
