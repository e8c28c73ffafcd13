//! `symmetry`: does the latent know that turning Reacher's arm and goal together changes nothing that matters?

mod rows;

use std::path::PathBuf;

use rand::seq::SliceRandom;
use serde_json::json;
use vibes_data::{About, Latents, Spec};

use super::invariance::{ends, text};
use super::session::{Input, Session};
use super::{Globals, Outcome, wrong};
use crate::figures::{Bar, BarGroup, Bars, Figure, NeighbourSheet, SheetColumn, Thumb};
use crate::input::Frames;
use crate::output::Column;
use rows::Rows;
use vibes_measure::intervals::Interval;
use vibes_measure::numbers::{Number, Numbers};
use vibes_measure::symmetry::{
    ReacherState, SymmetricPair, Symmetry, SymmetryOptions, matches, rotated_pairs, symmetry,
};

/// Measure whether reacher's latents ignore rotation: distance between a row and its rotated state, against a row that looks as different.
///
/// Rotations are found in the data, or made: `vibes-collect render RECORDING --rotate 90 -o TURNED`, `vibes-train encode RUN TURNED -o turned.arrow`,
/// then `vibes-analyze symmetry LATENTS --rotated turned.arrow` compares every row with its own rotation under the same distractor.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    input: Input,
    /// Most pairs to compare.
    #[arg(long, default_value_t = PAIRS)]
    pairs: usize,
    /// Most that arm and goal of a pair may differ once turned back, metres.
    #[arg(long, default_value_t = TOLERANCE)]
    tolerance: f64,
    /// Latents of the same rows turned about the origin (of a recording by `vibes-collect render --rotate`), in place of rotations found in the data.
    #[arg(long, value_name = "LATENTS")]
    rotated: Option<PathBuf>,
    /// The recording of the rotated latents [default: the one that they name].
    #[arg(long, value_name = "FOLDER", requires = "rotated")]
    rotated_recording: Option<PathBuf>,
}

/// Most pairs, unless another number is asked for.
const PAIRS: usize = 500;
/// How far a pair may differ, unless told otherwise, metres.
const TOLERANCE: f64 = 0.02;

impl Options {
    /// The options of a verb that is run by another: what is not named has its default.
    pub(super) fn of(input: Input) -> Self {
        Self { input, pairs: PAIRS, tolerance: TOLERANCE, rotated: None, rotated_recording: None }
    }
}

/// Pairs shown as pictures.
const SHOWN: usize = 6;

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    if options.pairs == 0 {
        return Err(wrong("--pairs is 0; at least one must be compared"));
    }
    let mut session = Session::open(
        &options.input,
        globals,
        "symmetry",
        json!({ "pairs": options.pairs, "tolerance": options.tolerance, "rotated": options.rotated, "rotated_recording": options.rotated_recording }),
    )?;
    let frames = session.needed_frames("symmetry")?;
    if frames.recording().manifest().spec.pixels.is_none() {
        return Err(wrong(format!(
            "a state and its rotated twin are compared with rows that look as different, and this recording has no pictures; draw it with vibes-collect render: {}",
            frames.recording().path().display()
        )));
    }
    let asked = SymmetryOptions { pairs: options.pairs, tolerance: options.tolerance, ..SymmetryOptions::default() };
    let mut rng = session.rng();
    let mut all_states = states(&session.latents, &frames)?;
    let mut rows = Rows::new(session.latents.clone(), frames);
    let pairs = match &options.rotated {
        None => rotated_pairs(&rows.table()?, &all_states, asked, &mut rng)?,
        Some(path) => {
            let turned = (path.as_path(), options.rotated_recording.as_deref());
            let (pairs, remarks) = rows.append_rotated(turned, &session.origin, &mut all_states, asked, &mut rng)?;
            remarks.into_iter().for_each(|remark| session.remark(format!("rotated: {remark}")));
            pairs
        }
    };
    let table = rows.table()?;
    let drawn = matches(&table, &all_states, &pairs, |a, b| rows.image_distance(a, b), asked, &mut rng)?;
    let measured = symmetry(&table, &drawn, asked)?;
    let (dims, actions) = rows.past_actions();
    let of_actions = symmetry(&rows.table_of(dims, &actions)?, &drawn, asked).ok();
    let distances = ReacherState::distance_table(&all_states);
    let of_distance = symmetry(&rows.table_of(1, &distances)?, &drawn, asked).ok();
    let numbers = numbers(&measured, of_actions.as_ref());
    let groups = groups(&measured, of_actions.as_ref(), of_distance.as_ref());
    let bars = Bars { heading: session.heading("Is the latent symmetric under rotation?"), groups };
    session.save(&Figure::Bars(bars), "symmetry")?;
    let sheet = sheet(&session, &rows, &measured);
    session.save(&Figure::NeighbourSheet(sheet), "symmetry-pairs")?;
    let key = |row: usize| rows.key(row);
    let pairs: Vec<_> = measured
        .pairs
        .iter()
        .map(|p| json!({ "row": key(p.row), "rotated": key(p.rotated), "latent": p.latent, "image": p.image, "matched": key(p.matched), "matched_is_rotated": rows.is_rotated(p.matched), "matched_latent": p.matched_latent, "matched_image": p.matched_image }))
        .collect();
    let of_distance = of_distance.as_ref().map(|control| self::numbers(control, None));
    session.write_json("symmetry", &json!({ "numbers": numbers, "distance_only": of_distance, "pairs": pairs }))?;
    let keys = |part: usize, of: fn(&SymmetricPair) -> usize| {
        Column::UInt32(measured.pairs.iter().map(|p| rows.key(of(p))[part]).collect())
    };
    let column = |of: fn(&SymmetricPair) -> f64| Column::Float64(measured.pairs.iter().map(of).collect());
    let columns = [
        ("episode", keys(0, |p| p.row)),
        ("step", keys(1, |p| p.row)),
        ("rotated_episode", keys(0, |p| p.rotated)),
        ("rotated_step", keys(1, |p| p.rotated)),
        ("latent", column(|p| p.latent)),
        ("image", column(|p| p.image)),
        ("matched_episode", keys(0, |p| p.matched)),
        ("matched_step", keys(1, |p| p.matched)),
        ("matched_latent", column(|p| p.matched_latent)),
        ("matched_image", column(|p| p.matched_image)),
        ("percentile", column(|p| p.percentile)),
    ];
    session.write_arrow("symmetry", &columns)?;
    let line = format!(
        "symmetry: rotated pairs are {} times as far apart as pairs that look as different (0 is symmetric, 1 is not), over {} pairs; a twin is nearer than {} of the rows that look as different, {} of those whose target is as far as the twin's (0.5 says nothing)",
        text(&measured.ratio),
        measured.pairs.len(),
        text(&measured.percentile),
        text(&measured.percentile_equal_distance)
    );
    Ok(session.finish(line))
}

/// Whether the recording is of a task with the symmetry, and has all that the measure needs.
pub(super) fn applies(frames: &Frames) -> bool {
    let spec = &frames.recording().manifest().spec;
    spec.pixels.is_some() && place_of_target(spec).is_some()
}

/// Where the vector from the finger to the target begins in the observation, of a task that says of itself that it has the symmetry (an older recording says nothing) and has
/// the shape of Reacher.
fn place_of_target(spec: &Spec) -> Option<usize> {
    let says_so =
        spec.quantities.is_empty() || spec.quantities.iter().any(|quantity| quantity.about == About::Symmetry);
    let parts = spec.observation.iter().scan(0, |next, part| {
        let from = *next;
        *next += part.len;
        Some((from, part))
    });
    let mut found = parts.filter(|(_, part)| part.name == "to_target" && part.len == 2).map(|(from, _)| from);
    found.next().filter(|_| says_so && spec.qpos == 2)
}

/// The arm's joints and the goal of every row: `qpos`, and the goal from the observation `to_target`.
fn states(l: &Latents, frames: &Frames) -> anyhow::Result<Vec<ReacherState>> {
    let recording = frames.recording();
    let spec = &recording.manifest().spec;
    let not_reacher = || {
        wrong(format!(
            "symmetry is about a two-link arm and its target, as in reacher-easy: two joints and the observation to_target; this recording is of {}: {}",
            spec.task,
            recording.path().display()
        ))
    };
    let from = place_of_target(spec).ok_or_else(not_reacher)?;
    let state = |row: usize| {
        let view = frames.view(l.episode[row])?;
        let step = l.step[row] as usize;
        let (qpos, observation) = (view.qpos(step), view.observation(step));
        let to_target = [from, from + 1].map(|at| f64::from(observation[at]));
        Some(ReacherState::seen_from_the_finger([qpos[0], qpos[1]], to_target))
    };
    (0..l.len()).map(|row| state(row).ok_or_else(not_reacher)).collect()
}

/// The numbers under their names, beside those of past actions.
fn numbers(measured: &Symmetry, of_actions: Option<&Symmetry>) -> Numbers {
    let number = |name: &str, of: fn(&Symmetry) -> Interval, chance: f64| Number {
        name: name.to_owned(),
        value: of(measured),
        chance,
        past_actions: of_actions.map(of),
    };
    [
        number("symmetry_ratio", |s| s.ratio, 1.0),
        number("symmetry_percentile", |s| s.percentile, 0.5),
        number("symmetry_percentile_equal_distance", |s| s.percentile_equal_distance, 0.5),
    ]
    .into_iter()
    .collect()
}

/// The numbers of the latent and of both controls, one axis for each. The titles are as long as a column is wide.
fn groups(measured: &Symmetry, of_actions: Option<&Symmetry>, of_distance: Option<&Symmetry>) -> Vec<BarGroup> {
    let sources =
        [("latent", Some(measured)), ("past actions only", of_actions), ("distance to target only", of_distance)];
    let group = |axis: &str, range, of: fn(&Symmetry) -> Interval, chance: f64| BarGroup {
        axis: axis.into(),
        range,
        bars: sources
            .iter()
            .filter_map(|(label, found)| Some((label, of((*found)?))))
            .map(|(label, i)| Bar {
                label: (*label).into(),
                value: i.estimate,
                interval: ends(&i),
                chance: Some(chance),
            })
            .collect(),
    };
    let ratio = "latent distance: rotated twin / row as different (0: symmetric)";
    let of_different = "share farther than the twin, among rows that look as different";
    let of_equal = "share farther than the twin, among rows whose target is as far";
    let whole = Some((0.0, 1.0));
    vec![
        group(ratio, None, |s| s.ratio, 1.0),
        group(of_different, whole, |s| s.percentile, 0.5),
        group(of_equal, whole, |s| s.percentile_equal_distance, 0.5),
    ]
}

/// Some pairs: the row, its rotation, the row whose picture is as far away.
fn sheet(session: &Session, rows: &Rows, measured: &Symmetry) -> NeighbourSheet {
    let mut pairs = measured.pairs.clone();
    pairs.shuffle(&mut session.rng());
    let thumb = |row: usize| {
        let [episode, step] = rows.key(row);
        Thumb { name: format!("{episode}:{step}"), pixels: rows.frames(row).picture(episode, step) }
    };
    let column = |p: &SymmetricPair| SheetColumn {
        query: thumb(p.row),
        remark: String::new(),
        neighbours: vec![(thumb(p.rotated), p.latent), (thumb(p.matched), p.matched_latent)],
    };
    NeighbourSheet {
        heading: session.heading("A row, a rotation of its state, and a row that looks as different"),
        distance: "standardized L2 distance".into(),
        rows: ["row", "rotated", "looks as different"].map(String::from).to_vec(),
        columns: pairs.iter().take(SHOWN).map(column).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::Heading;
    use crate::picture::Shape;

    /// The end of a title says which number would be symmetric, or among which rows a share is taken.
    #[test]
    fn no_title_of_an_axis_is_cut() {
        let number = Interval { estimate: 0.4, low: 0.2, high: 0.6 };
        let measured =
            Symmetry { ratio: number, percentile: number, percentile_equal_distance: number, pairs: Vec::new() };
        let bars = Bars {
            heading: Heading::new("Is the latent symmetric under rotation?"),
            groups: groups(&measured, Some(&measured), Some(&measured)),
        };
        let picture = bars.draw();
        let written = |wanted: &str| {
            picture.shapes.iter().any(|shape| matches!(shape, Shape::Text { text, .. } if text.as_str() == wanted))
        };
        for group in &bars.groups {
            assert!(written(&group.axis), "{} is cut", group.axis);
            assert!(group.bars.iter().all(|bar| written(&bar.label)), "a label is cut");
        }
    }
}
