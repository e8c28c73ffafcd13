//! `symmetry`: does the latent know that turning Reacher's arm and goal together changes nothing that matters?

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use rand::Rng;
use rand::seq::SliceRandom;
use rand::seq::index::sample;
use serde_json::json;
use vibes_data::{About, Latents, Spec};

use super::invariance::{ends, text};
use super::session::{Input, Session};
use super::{Globals, Outcome, wrong};
use crate::actions::action_features;
use crate::figures::{Bar, BarGroup, Bars, Figure, NeighbourSheet, SheetColumn, Thumb};
use crate::input::{Asked, Frames, Origin, ReadLatents, find_recording, read_beside};
use crate::output::Column;
use vibes_measure::Table;
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

/// Rows that show one state, once as it is and once turned or reflected.
type Pairs = Vec<(usize, usize)>;

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    if options.pairs == 0 {
        return Err(wrong("--pairs is 0; at least one must be compared"));
    }
    let mut session = Session::open(
        &options.input,
        globals,
        "symmetry",
        json!({ "pairs": options.pairs, "tolerance": options.tolerance, "rotated": options.rotated }),
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
    let mut rows = Rows { latents: session.latents.clone(), frames: vec![frames], own: session.latents.len() };
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
    let measured = symmetry(&table, &drawn, asked, &mut session.rng())?;
    let (dims, actions) = rows.past_actions();
    let of_actions = symmetry(&rows.table_of(dims, &actions)?, &drawn, asked, &mut session.rng()).ok();
    let distances = ReacherState::distance_table(&all_states);
    let of_distance = symmetry(&rows.table_of(1, &distances)?, &drawn, asked, &mut session.rng()).ok();
    let numbers = numbers(&measured, of_actions.as_ref());
    let bars = bars(&session, &measured, of_actions.as_ref(), of_distance.as_ref());
    session.save(&Figure::Bars(bars), "symmetry")?;
    let sheet = sheet(&session, &rows, &measured);
    session.save(&Figure::NeighbourSheet(sheet), "symmetry-pairs")?;
    let key = |row: usize| rows.key(row);
    let pairs: Vec<_> = measured
        .pairs
        .iter()
        .map(|p| json!({ "row": key(p.row), "rotated": key(p.rotated), "latent": p.latent, "image": p.image, "matched": key(p.matched), "matched_is_rotated": p.matched >= rows.own, "matched_latent": p.matched_latent, "matched_image": p.matched_image }))
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
        "symmetry: rotated pairs are {} times as far apart as pairs that look as different (0 is symmetric, 1 is not), over {} pairs; a twin is nearer than {} of the rows that look as different, {} of those whose target is equally far (0.5 says nothing)",
        text(&measured.ratio),
        measured.pairs.len(),
        text(&measured.percentile),
        text(&measured.percentile_equal_distance)
    );
    Ok(session.finish(line))
}

/// The rows that are compared: the table's own, and after them rotated ones of another recording, under episode numbers of their own.
struct Rows {
    latents: Latents,
    /// The recording of the own rows, and that of the rotated ones.
    frames: Vec<Frames>,
    own: usize,
}

impl Rows {
    fn table(&self) -> Result<Table<'_>, vibes_measure::Error> {
        self.table_of(self.latents.dims, &self.latents.latent)
    }

    /// Other features of the same rows.
    fn table_of<'a>(&'a self, dims: usize, values: &'a [f32]) -> Result<Table<'a>, vibes_measure::Error> {
        let l = &self.latents;
        Table::new(dims, values, &l.episode, &l.step)?.with_grid(&l.state, &l.distractor)
    }

    /// Features of past actions of all rows, with their dimensions.
    fn past_actions(&self) -> (usize, Vec<f32>) {
        let part = |rows: std::ops::Range<usize>| Latents {
            episode: rows.clone().map(|row| self.key(row)[0]).collect(),
            step: self.latents.step[rows].to_vec(),
            ..Latents::default()
        };
        let (dims, mut values) = action_features(&part(0..self.own), &self.frames[0]);
        if let Some(frames) = self.frames.get(1) {
            values.extend(action_features(&part(self.own..self.latents.len()), frames).1);
        }
        (dims, values)
    }

    /// What is added to the episode numbers of rotated rows.
    fn shift(&self) -> u32 {
        self.latents.episode[..self.own].iter().max().map_or(0, |last| last + 1)
    }

    /// The row key in its own recording.
    fn key(&self, row: usize) -> [u32; 2] {
        let shift = if row < self.own { 0 } else { self.shift() };
        [self.latents.episode[row] - shift, self.latents.step[row]]
    }

    fn frames(&self, row: usize) -> &Frames {
        &self.frames[usize::from(row >= self.own).min(self.frames.len() - 1)]
    }

    /// Root mean square difference of two rows' pictures, of 255.
    fn image_distance(&self, a: usize, b: usize) -> f64 {
        let pixels = |row: usize| {
            let [episode, step] = self.key(row);
            self.frames(row).view(episode).map_or(&[][..], |view| view.pixels(step as usize))
        };
        let (a, b) = (pixels(a), pixels(b));
        let sum: u64 = a.iter().zip(b).map(|(&x, &y)| u64::from(x.abs_diff(y)).pow(2)).sum();
        (sum as f64 / a.len().max(1) as f64).sqrt()
    }

    /// Adds the rotated latents and pairs every row, or as many as are asked for, with its own rotation.
    fn append_rotated(
        &mut self,
        (path, recording): (&Path, Option<&Path>),
        origin: &Origin,
        all_states: &mut Vec<ReacherState>,
        options: SymmetryOptions,
        rng: &mut impl Rng,
    ) -> anyhow::Result<(Pairs, Vec<String>)> {
        // Distances between the two tables are measured, which must be about one origin.
        let ReadLatents { latents: turned, remarks, .. } = read_beside(path, &Asked::default(), origin)?;
        let l = &mut self.latents;
        if turned.dims != l.dims {
            return Err(wrong(format!(
                "the rotated latents have {} dimensions, the others {}: {}",
                turned.dims,
                l.dims,
                path.display()
            )));
        }
        let named = turned.source.recording.as_deref().and_then(|named| find_recording(named, path));
        let missing = || {
            wrong(format!(
                "the recording of the rotated latents is not there; name it with --rotated-recording: {}",
                path.display()
            ))
        };
        let recording = recording.map(Path::to_path_buf).or(named).ok_or_else(missing)?;
        let frames = Frames::open(&recording, &turned)?;
        let states_of_turned = states(&turned, &frames)?;
        let at: HashMap<(u32, u32), usize> =
            (0..turned.len()).map(|row| ((turned.episode[row], turned.step[row]), row)).collect();
        let partner = |row: usize| Some((row, *at.get(&(l.episode[row], l.step[row]))?));
        let mut pairs: Vec<(usize, usize)> = (0..self.own).filter_map(partner).collect();
        let is_rotation = |&(a, b): &(usize, usize)| all_states[a].is_rotation_of(states_of_turned[b], options);
        if pairs.is_empty() || !pairs.iter().all(is_rotation) {
            return Err(wrong(format!(
                "the rows of these latents are not rotations of the others' (by at least 45 degrees, within {} m); make them with `vibes-collect render --rotate`: {}",
                options.tolerance,
                recording.display()
            )));
        }
        pairs = sample(rng, pairs.len(), pairs.len().min(options.pairs)).into_iter().map(|at| pairs[at]).collect();
        let shift = l.episode.iter().max().map_or(0, |last| last + 1);
        l.episode.extend(turned.episode.iter().map(|episode| episode + shift));
        l.step.extend(&turned.step);
        l.state.extend(&turned.state);
        l.distractor.extend(&turned.distractor);
        l.latent.extend(&turned.latent);
        self.frames.push(frames);
        all_states.extend(states_of_turned);
        Ok((pairs.into_iter().map(|(row, turned)| (row, self.own + turned)).collect(), remarks))
    }
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

fn bars(session: &Session, measured: &Symmetry, of_actions: Option<&Symmetry>, of_distance: Option<&Symmetry>) -> Bars {
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
    let whole = Some((0.0, 1.0));
    Bars {
        heading: session.heading("Is the latent symmetric under rotation?"),
        groups: vec![
            group(
                "latent distance to the rotated twin / to a row that looks as different: 0 is symmetric",
                None,
                |s| s.ratio,
                1.0,
            ),
            group(
                "share of rows that look as different and lie farther away than the twin",
                whole,
                |s| s.percentile,
                0.5,
            ),
            group("the same among rows whose target is equally far", whole, |s| s.percentile_equal_distance, 0.5),
        ],
    }
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
        heading: session.heading("A row, a rotation of its state (1), a picture as different (2)"),
        distance: "standardized L2 distance".into(),
        columns: pairs.iter().take(SHOWN).map(column).collect(),
    }
}
