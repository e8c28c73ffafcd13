//! `grid`: Figure 4a of the paper for any n × m.

use std::collections::BTreeSet;
use std::fmt;
use std::str::FromStr;

use serde_json::json;
use vibes_command::Given;

use super::maps::{MapOptions, coloring};
use super::session::{Session, TableInput};
use super::{Globals, Outcome, wrong};
use crate::figures::{Figure, Panel, Panels};
use crate::input::choices;

/// Draw state × distractor trajectories on one map, a panel each.
///
/// Every panel shows all latents in grey and its own trajectory in colours: of time, or of a column.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    given: Given,
    #[command(flatten)]
    input: TableInput,
    #[command(flatten)]
    map: MapOptions,
    /// Panels to draw, states x distractors; the whole grid if it is smaller.
    #[arg(long, value_name = "NxM", default_value_t = PANELS)]
    panels: Size,
    /// State trajectories to draw, in place of the first N.
    #[arg(long, value_name = "S,…", value_delimiter = ',')]
    states: Vec<u32>,
    /// Distractor trajectories to draw, in place of the first M.
    #[arg(long, value_name = "D,…", value_delimiter = ',')]
    distractors: Vec<u32>,
    /// A column to colour the trajectories by, in place of time: of the latents' table or of one that is joined.
    #[arg(long, value_name = "COLUMN")]
    color: Option<String>,
}

/// Panels that are drawn unless others are asked for.
const PANELS: Size = Size { states: 4, distractors: 4 };

impl Options {
    /// The options of a verb that is run by another: what is not named has its default.
    pub(super) fn of(input: TableInput) -> Self {
        Self {
            given: Given::default(),
            input,
            map: MapOptions::default(),
            panels: PANELS,
            states: Vec::new(),
            distractors: Vec::new(),
            color: None,
        }
    }
}

/// A grid's size as it is typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Size {
    states: usize,
    distractors: usize,
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.states, self.distractors)
    }
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |n: &str| n.trim().parse().ok().filter(|n| (1..=40).contains(n));
        let parsed =
            text.split_once(['x', '×']).and_then(|(n, m)| Some(Self { states: side(n)?, distractors: side(m)? }));
        parsed.ok_or_else(|| format!("{text:?} is no size; NxM is expected, each from 1 to 40, as in 4x4"))
    }
}

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    if !options.states.is_empty() && !options.distractors.is_empty() && options.given.first_of(["panels"]).is_some() {
        return Err(wrong("--panels has no effect where --states and --distractors name all panels; leave it out"));
    }
    let given = json!({ "panels": options.panels.to_string(), "color": options.color });
    let color: Vec<String> = options.color.iter().cloned().collect();
    let mut session = Session::open_with(&(&options.input).into(), globals, "grid", given, &color)?;
    let coloring = session.columns.first().map(|column| coloring(column, session.latents.len())).transpose()?;
    let all = cells(&session)?;
    let states = choose("--states", &options.states, all.iter().map(|c| c.0).collect(), options.panels.states)?;
    let distractors =
        choose("--distractors", &options.distractors, all.iter().map(|c| c.1).collect(), options.panels.distractors)?;
    let made = options.map.map_or_other(&mut session, globals)?;
    let panels = panels(&session, &states, &distractors);
    let holes = states.len() * distractors.len() - panels.len();
    // Of a cell without rows that are chosen, nothing here says whether it was recorded.
    let (absent, fact) = if session.chooses_rows() {
        ("not chosen", "have no row that --where chooses")
    } else {
        ("not recorded", "were not recorded")
    };
    if holes > 0 {
        let cells = states.len() * distractors.len();
        session.remark(format!("{holes} of {cells} cells {fact} and are drawn as such"));
    }
    let line = format!(
        "grid: {} of {} state x {} of {} distractor trajectories on a map with {}",
        states.len(),
        all.iter().map(|c| c.0).collect::<BTreeSet<_>>().len(),
        distractors.len(),
        all.iter().map(|c| c.1).collect::<BTreeSet<_>>().len(),
        made.quality_text()
    );
    let keys: Vec<_> =
        panels.iter().map(|p| json!({ "state": p.state, "distractor": p.distractor, "rows": p.rows.len() })).collect();
    let heading = session.heading("One trajectory a panel, over all latents");
    // Points of an old map that this one was placed on belong to the grey ones.
    let points = [made.points(), made.backdrop()].concat();
    let figure = Panels {
        heading,
        points,
        states: states.clone(),
        distractors: distractors.clone(),
        panels,
        absent,
        steps: session.latents.step.clone(),
        coloring,
    };
    session.save(&Figure::Panels(figure), "grid")?;
    session.write_json("grid", &json!({ "states": states, "distractors": distractors, "cells": keys, "holes": holes, "quality": made.quality }))?;
    Ok(session.finish(line))
}

/// The cells that the table has rows of.
fn cells(session: &Session) -> anyhow::Result<BTreeSet<(u32, u32)>> {
    let l = &session.latents;
    let cells: BTreeSet<(u32, u32)> = l.state.iter().zip(&l.distractor).filter_map(|(s, d)| s.zip(*d)).collect();
    if cells.is_empty() {
        return Err(wrong(format!(
            "these latents are not of a grid (columns state and distractor are empty); name the recording with --recording if it is one, or record one with `vibes-collect --grid 10x10`: {}",
            session.path.display()
        )));
    }
    Ok(cells)
}

/// The rows or columns to draw: those named, or the first ones.
fn choose(option: &str, named: &[u32], there: BTreeSet<u32>, count: usize) -> anyhow::Result<Vec<u32>> {
    if let Some(missing) = named.iter().find(|n| !there.contains(n)) {
        let list: Vec<String> = there.iter().map(u32::to_string).collect();
        let list = choices(&missing.to_string(), list.iter().map(String::as_str));
        return Err(wrong(format!("{option} {missing} is not in these latents, choose among {list}")));
    }
    Ok(if named.is_empty() { there.into_iter().take(count).collect() } else { named.to_vec() })
}

/// The rows of each cell in order of time.
fn panels(session: &Session, states: &[u32], distractors: &[u32]) -> Vec<Panel> {
    let l = &session.latents;
    let mut panels = Vec::new();
    for &state in states {
        for &distractor in distractors {
            let mut rows: Vec<usize> =
                (0..l.len()).filter(|&r| l.state[r] == Some(state) && l.distractor[r] == Some(distractor)).collect();
            rows.sort_by_key(|&r| (l.episode[r], l.step[r]));
            if !rows.is_empty() {
                panels.push(Panel { state, distractor, rows });
            }
        }
    }
    panels
}
