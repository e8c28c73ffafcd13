//! `symmetry`: does the latent know that turning Reacher's arm and goal together changes nothing that matters?

use rand::seq::SliceRandom;
use serde_json::json;

use super::invariance::{ends, text};
use super::session::{Input, Session};
use super::{Globals, Outcome, wrong};
use crate::figures::{Bar, BarGroup, Bars, Figure, NeighbourSheet, SheetColumn, Thumb};
use crate::input::Frames;
use crate::symmetry::{ReacherState, Symmetry, SymmetryOptions, rotated_pairs, symmetry};

/// Reacher: latent distance between a row and a rotation of its state found in the data, against a row whose picture is as far away.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    input: Input,
    /// Most pairs to compare.
    #[arg(long, default_value_t = 500)]
    pairs: usize,
    /// Most that arm and goal of a pair may differ once turned back, metres.
    #[arg(long, default_value_t = 0.02)]
    tolerance: f64,
}

/// Pairs shown as pictures.
const SHOWN: usize = 6;

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    let mut session = Session::open(
        &options.input,
        globals,
        "symmetry",
        json!({ "pairs": options.pairs, "tolerance": options.tolerance }),
    )?;
    let frames = session.needed_frames("symmetry")?;
    let states = states(&session, &frames)?;
    let asked = SymmetryOptions { pairs: options.pairs, tolerance: options.tolerance, ..SymmetryOptions::default() };
    let measured = {
        let mut rng = session.rng();
        let table = session.table()?;
        let pairs = rotated_pairs(&table, &states, asked, &mut rng)?;
        symmetry(&table, &pairs, |a, b| image_distance(&session, &frames, a, b), asked, &mut rng)?
    };
    let bars = bars(&session, &measured);
    session.save(&Figure::Bars(bars), "symmetry")?;
    if frames.recording().manifest().spec.pixels.is_some() {
        let sheet = sheet(&session, &frames, &measured);
        session.save(&Figure::NeighbourSheet(sheet), "symmetry-pairs")?;
    }
    let key = |row: usize| [session.latents.episode[row], session.latents.step[row]];
    let pairs: Vec<_> = measured
        .pairs
        .iter()
        .map(|p| json!({ "row": key(p.row), "rotated": key(p.rotated), "latent": p.latent, "image": p.image, "matched": key(p.matched), "matched_latent": p.matched_latent, "matched_image": p.matched_image }))
        .collect();
    session.write_json("symmetry", &json!({ "ratio": measured.ratio, "closer": measured.closer, "pairs": pairs }))?;
    let line = format!(
        "symmetry: rotated pairs are {} times as far apart as pairs that look as different (0 is symmetric, 1 is not), over {} pairs",
        text(&measured.ratio),
        measured.pairs.len()
    );
    Ok(session.finish(line))
}

/// The arm's joints and the goal of every row: `qpos`, and the goal from the episode's model overrides or the observation `to_target`.
fn states(session: &Session, frames: &Frames) -> anyhow::Result<Vec<ReacherState>> {
    let manifest = frames.recording().manifest();
    let not_reacher = || {
        wrong(format!(
            "symmetry is about reacher, this recording is of {}: {}",
            manifest.spec.task,
            frames.recording().path().display()
        ))
    };
    if !manifest.spec.task.starts_with("reacher") || manifest.spec.qpos != 2 {
        return Err(not_reacher());
    }
    let l = &session.latents;
    let at = manifest.spec.observation.iter().scan(0, |at, part| {
        let from = *at;
        *at += part.len;
        Some((from, part))
    });
    let to_target = at.into_iter().find(|(_, part)| part.name == "to_target" && part.len == 2).map(|(from, _)| from);
    let Some(from) = to_target else {
        return Err(wrong(format!(
            "symmetry needs the observation to_target of reacher: {}",
            frames.recording().path().display()
        )));
    };
    let state = |row: usize| {
        let view = frames.view(l.episode[row])?;
        let step = l.step[row] as usize;
        let (qpos, observation) = (view.qpos(step), view.observation(step));
        let joints = [qpos[0], qpos[1]];
        let finger = finger(joints);
        Some(ReacherState {
            joints,
            target: [finger[0] + f64::from(observation[from]), finger[1] + f64::from(observation[from + 1])],
        })
    };
    (0..l.len()).map(|row| state(row).ok_or_else(not_reacher)).collect()
}

/// Where the finger is, metres: two links of 0.12 m.
fn finger([shoulder, wrist]: [f64; 2]) -> [f64; 2] {
    const LINK: f64 = 0.12;
    [LINK * (shoulder.cos() + (shoulder + wrist).cos()), LINK * (shoulder.sin() + (shoulder + wrist).sin())]
}

/// Root mean square difference of two rows' pictures, of 255.
fn image_distance(session: &Session, frames: &Frames, a: usize, b: usize) -> f64 {
    let pixels = |row: usize| {
        frames.view(session.latents.episode[row]).map_or(&[][..], |v| v.pixels(session.latents.step[row] as usize))
    };
    let (a, b) = (pixels(a), pixels(b));
    let sum: u64 = a.iter().zip(b).map(|(&x, &y)| u64::from(x.abs_diff(y)).pow(2)).sum();
    (sum as f64 / a.len().max(1) as f64).sqrt()
}

fn bars(session: &Session, measured: &Symmetry) -> Bars {
    let mean = |of: fn(&crate::symmetry::SymmetricPair) -> f64| {
        measured.pairs.iter().map(of).sum::<f64>() / measured.pairs.len() as f64
    };
    let plain = |label: &str, value: f64| Bar { label: label.into(), value, interval: None, chance: None };
    let with = |label: &str, i: &crate::intervals::Interval, chance: f64| Bar {
        label: label.into(),
        value: i.estimate,
        interval: ends(i),
        chance: Some(chance),
    };
    Bars {
        heading: session.heading("Is the latent symmetric under rotation?"),
        groups: vec![
            BarGroup {
                axis: "mean latent distance (standardized L2)".into(),
                range: None,
                bars: vec![
                    plain("rotated state", mean(|p| p.latent)),
                    plain("picture as different", mean(|p| p.matched_latent)),
                ],
            },
            BarGroup {
                axis: "ratio of the two: 0 is symmetric".into(),
                range: None,
                bars: vec![with("rotated / as different", &measured.ratio, 1.0)],
            },
            BarGroup {
                axis: "share of rows closer to their rotation".into(),
                range: Some((0.0, 1.0)),
                bars: vec![with("rotation is closer", &measured.closer, 0.5)],
            },
        ],
    }
}

/// Some pairs: the row, its rotation, the row whose picture is as far away.
fn sheet(session: &Session, frames: &Frames, measured: &Symmetry) -> NeighbourSheet {
    let mut pairs = measured.pairs.clone();
    pairs.shuffle(&mut session.rng());
    let l = &session.latents;
    let thumb = |row: usize| Thumb {
        name: format!("{}:{}", l.episode[row], l.step[row]),
        pixels: frames.picture(l.episode[row], l.step[row]),
    };
    let column = |p: &crate::symmetry::SymmetricPair| SheetColumn {
        query: thumb(p.row),
        remark: String::new(),
        neighbours: vec![(thumb(p.rotated), p.latent), (thumb(p.matched), p.matched_latent)],
    };
    NeighbourSheet {
        heading: session.heading("A row, a rotation of its state (1), a picture as different (2)"),
        distance: "standardized L2 distance to the row on top".into(),
        columns: pairs.iter().take(SHOWN).map(column).collect(),
    }
}
