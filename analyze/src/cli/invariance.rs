//! `invariance`: same state, other distractor: same latent?

use serde_json::{Value, json};

use super::session::{Input, Session};
use super::{Globals, Outcome};
use crate::actions::action_features;
use crate::figures::{Bar, BarGroup, Bars, Figure};
use crate::output::Column;
use vibes_measure::Table;
use vibes_measure::intervals::Interval;
use vibes_measure::invariance::{Grid, Retrieval, RetrievalOptions, VarianceSplit, retrieval, variance};

/// How much of the latents' variance the state explains, how much the distractor, and how often the same state is found again under another
/// distractor. Needs latents of a grid.
///
/// Beside each number stands that of the action-only control: all cells of a row of the grid share their actions, so an encoder that sees only
/// actions scores well.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    input: Input,
    /// Neighbours looked at by the retrievals.
    #[arg(long, short, value_delimiter = ',', default_values_t = [1, 5])]
    k: Vec<usize>,
    /// A neighbour of the same state trajectory counts if it is at most this many steps away.
    #[arg(long, default_value_t = 2)]
    tolerance: u32,
    /// Most rows the retrievals ask for.
    #[arg(long, default_value_t = 2000)]
    queries: usize,
}

/// The numbers of one table.
struct Measured {
    split: VarianceSplit,
    retrievals: Vec<Retrieval>,
}

/// A number with its interval and what needs no latent, by what it is of and what it is called.
pub(super) type Named = (String, String, Interval, f64);

impl Measured {
    fn rows(&self, source: &str) -> Vec<Named> {
        let row =
            |name: &str, interval: Interval, chance: f64| (source.to_string(), name.to_string(), interval, chance);
        let split = &self.split;
        let mut rows = vec![
            row("variance share of state", split.state, split.state_of_noise),
            row("variance share of distractor", split.distractor, f64::NAN),
            row("variance share of interaction", split.interaction, f64::NAN),
            row("variance within a state", split.within_state, f64::NAN),
        ];
        rows.extend(self.retrievals.iter().map(|r| row(&format!("retrieval@{}", r.k), r.found, r.chance)));
        rows
    }
}

/// Writes numbers with their intervals as `STEM.arrow`; NaN where there is no interval or no chance level.
pub(super) fn write_intervals(session: &mut Session, stem: &str, of: &str, rows: &[Named]) -> anyhow::Result<()> {
    let numbers = |number: fn(&Named) -> f64| Column::Float64(rows.iter().map(number).collect());
    let columns = [
        (of, Column::Text(rows.iter().map(|row| row.0.clone()).collect())),
        ("measure", Column::Text(rows.iter().map(|row| row.1.clone()).collect())),
        ("estimate", numbers(|row| row.2.estimate)),
        ("low", numbers(|row| row.2.low)),
        ("high", numbers(|row| row.2.high)),
        ("chance", numbers(|row| row.3)),
    ];
    session.write_arrow(stem, &columns)
}

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    let mut session = Session::open(
        &options.input,
        globals,
        "invariance",
        json!({ "k": options.k, "tolerance": options.tolerance, "queries": options.queries }),
    )?;
    let (measured, dropped, size) = {
        let grid = grid(session.table()?)?;
        (
            measure(&grid, options, &session)?,
            grid.dropped().clone(),
            (grid.states().len(), grid.distractors().len(), grid.steps().len()),
        )
    };
    for (kind, dropped) in [("state", &dropped.states), ("distractor", &dropped.distractors)] {
        if !dropped.is_empty() {
            session
                .remark(format!("the grid has holes: {kind} trajectories {dropped:?} lack a cell and were left out"));
        }
    }
    let control = control(options, &mut session)?;
    let bars = draw(&session, &measured, control.as_ref());
    session.save(&Figure::Bars(bars), "invariance")?;
    let numbers = |m: &Measured| json!({ "variance": m.split, "retrieval": m.retrievals });
    let mut document = numbers(&measured);
    document["grid"] = json!({ "states": size.0, "distractors": size.1, "steps": size.2, "dropped": dropped });
    document["action_only"] = control.as_ref().map_or(Value::Null, numbers);
    session.write_json("invariance", &document)?;
    let mut rows = measured.rows("latent");
    rows.extend(control.iter().flat_map(|control| control.rows("past_actions")));
    write_intervals(&mut session, "invariance", "source", &rows)?;
    let first = measured.retrievals.first().map_or_else(String::new, |r| {
        format!("; same state found under another distractor: {} (chance {:.3})", text(&r.found), r.chance)
    });
    let s = &measured.split;
    let line = format!(
        "invariance: of the latents' variance {} state, {} distractor, {} interaction{first}",
        text(&s.state),
        text(&s.distractor),
        text(&s.interaction)
    );
    Ok(session.finish(line))
}

/// The whole grid, or a complete part of one with holes.
pub(super) fn grid(table: Table<'_>) -> Result<Grid<'_>, vibes_measure::Error> {
    match Grid::new(table) {
        Err(vibes_measure::Error::GridHoles { .. }) => Grid::of_complete_part(table),
        grid => grid,
    }
}

/// `0.61 [0.57, 0.66]`, or without an interval if there is none.
pub(super) fn text(i: &Interval) -> String {
    if i.low.is_finite() && i.high.is_finite() {
        format!("{:.3} [{:.3}, {:.3}]", i.estimate, i.low, i.high)
    } else {
        format!("{:.3}", i.estimate)
    }
}

/// The interval's ends, if it has some.
pub(super) fn ends(i: &Interval) -> Option<(f64, f64)> {
    (i.low.is_finite() && i.high.is_finite()).then_some((i.low, i.high))
}

fn measure(grid: &Grid<'_>, options: &Options, session: &Session) -> anyhow::Result<Measured> {
    let mut rng = session.rng();
    let split = variance(grid)?;
    let ask = |k: usize| RetrievalOptions {
        k,
        tolerance: options.tolerance,
        queries: options.queries,
        ..RetrievalOptions::default()
    };
    let retrievals = options.k.iter().map(|&k| retrieval(grid, ask(k), &mut rng)).collect::<Result<_, _>>()?;
    Ok(Measured { split, retrievals })
}

/// The same numbers for features of past actions alone; none without a recording.
fn control(options: &Options, session: &mut Session) -> anyhow::Result<Option<Measured>> {
    let Some(frames) = session.frames()? else {
        if !session.without_frames() {
            session.remark("these latents name no recording, so there is no action-only control");
        }
        return Ok(None);
    };
    let (dims, values) = action_features(&session.latents, &frames);
    let l = &session.latents;
    let table = Table::new(dims, &values, &l.episode, &l.step)?.with_grid(&l.state, &l.distractor)?;
    Ok(Some(measure(&grid(table)?, options, session)?))
}

fn draw(session: &Session, measured: &Measured, control: Option<&Measured>) -> Bars {
    let bar =
        |label: &str, i: &Interval, chance| Bar { label: label.into(), value: i.estimate, interval: ends(i), chance };
    let s = &measured.split;
    let shares = vec![
        bar("state", &s.state, Some(s.state_of_noise)),
        bar("distractor", &s.distractor, None),
        bar("interaction", &s.interaction, None),
    ];
    let mut found: Vec<Bar> = measured
        .retrievals
        .iter()
        .map(|r| bar(&format!("latent, {} nearest", r.k), &r.found, Some(r.chance)))
        .collect();
    let controls = control.into_iter().flat_map(|c| &c.retrievals);
    found.extend(controls.map(|r| bar(&format!("actions only, {} nearest", r.k), &r.found, Some(r.chance))));
    let whole = Some((0.0, 1.0));
    Bars {
        heading: session.heading("Same state, other distractor: same latent?"),
        groups: vec![
            BarGroup { axis: "share of the latents' variance".into(), range: whole, bars: shares },
            BarGroup { axis: "share of rows whose state is found again".into(), range: whole, bars: found },
        ],
    }
}
