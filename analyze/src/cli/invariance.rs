//! `invariance`: same state, other distractor: same latent?

use serde_json::json;

use super::session::{Input, Session};
use super::{Globals, Outcome, wrong};
use crate::actions::action_features;
use crate::figures::{Bar, BarGroup, Bars, Figure};
use crate::output::Column;
use crate::picture::number::fixed;
use vibes_measure::Table;
use vibes_measure::intervals::Interval;
use vibes_measure::invariance::{Grid, variance};
use vibes_measure::numbers::{GridOptions, Number, Numbers, grid_numbers};

/// Measure how much of the latents' variance is state and how much distractor, and how often the same state is found under another distractor.
///
/// It needs latents of a grid. Beside each number stands that of the action-only control: all cells of a row of the grid share their actions, so an
/// encoder that sees only actions scores well.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    input: Input,
    /// Neighbours looked at by the retrievals.
    #[arg(long, short, value_delimiter = ',', default_values_t = GridOptions::default().k)]
    k: Vec<usize>,
    /// A neighbour of the same state trajectory counts if it is at most this many steps away.
    #[arg(long, default_value_t = GridOptions::default().tolerance)]
    tolerance: u32,
    /// Most rows that `retrieval_any_step` asks about; `retrieval_same_step` asks about every cell and step, and where this would compare more than
    /// 50 million pairs, about as many, drawn, as make up these.
    #[arg(long, default_value_t = GridOptions::default().queries)]
    queries: usize,
}

impl Options {
    /// The options of a verb that is run by another: what is not named has its default.
    pub(super) fn of(input: Input) -> Self {
        let GridOptions { k, tolerance, queries, .. } = GridOptions::default();
        Self { input, k, tolerance, queries }
    }
}

/// A number with its interval and what needs no latent, by what it is of and what it is called.
pub(super) type Named = (String, String, Interval, f64);

/// The numbers of the latents, and after them those of past actions alone.
pub(super) fn named(numbers: &Numbers) -> Vec<Named> {
    let latents = numbers.iter().map(|n| ("latent".to_string(), n.name.clone(), n.value, n.chance));
    let actions = |n: &Number| Some(("past_actions".to_string(), n.name.clone(), n.past_actions?, n.chance));
    latents.chain(numbers.iter().filter_map(actions)).collect()
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
    if options.queries == 0 || options.k.contains(&0) {
        return Err(wrong("retrieval asks for at least one row (--queries) and looks at one neighbour at least (-k)"));
    }
    let mut session = Session::open(
        &options.input,
        globals,
        "invariance",
        json!({ "k": options.k, "tolerance": options.tolerance, "queries": options.queries }),
    )?;
    let actions = past_actions(&mut session)?;
    let (numbers, split, dropped, size) = {
        let grid = Grid::of_complete_part(session.table()?)?;
        let control = actions.as_ref().map(|actions| table(&session, actions)).transpose()?;
        let control = control.map(Grid::of_complete_part).transpose()?;
        let asked = GridOptions {
            k: options.k.clone(),
            tolerance: options.tolerance,
            queries: options.queries,
            seed: session.seed,
        };
        (
            grid_numbers(&grid, control.as_ref(), &asked)?,
            variance(&grid)?,
            grid.dropped().clone(),
            (grid.states().len(), grid.distractors().len(), grid.steps().len()),
        )
    };
    dropped.remarks().into_iter().for_each(|remark| session.remark(remark));
    left_out(&options.k, &numbers).into_iter().for_each(|remark| session.remark(remark));
    let bars = draw(&session, &numbers);
    session.save(&Figure::Bars(bars), "invariance")?;
    let grid = json!({ "states": size.0, "distractors": size.1, "steps": size.2, "dropped": dropped });
    session.write_json("invariance", &json!({ "numbers": numbers, "by_step": split.by_step, "grid": grid }))?;
    write_intervals(&mut session, "invariance", "source", &named(&numbers))?;
    let found = numbers.iter().filter(|number| number.name.ends_with("@1"));
    let found: Vec<String> =
        found.map(|n| format!("; {} {} (chance {:.3})", n.name, text(&n.value), n.chance)).collect();
    let share = |name: &str| numbers.get(name).map_or_else(String::new, |number| text(&number.value));
    let line = format!(
        "invariance: of the latents' variance {} state, {} distractor, {} interaction{}",
        share("state_share"),
        share("distractor_share"),
        share("interaction_share"),
        found.concat()
    );
    Ok(session.finish(line))
}

/// The retrievals that a small grid has nothing to ask for, a sentence each.
fn left_out(k: &[usize], numbers: &Numbers) -> Vec<String> {
    let measures = [
        ("retrieval_same_step", "a step of this grid has fewer other cells"),
        ("retrieval_any_step", "this grid has fewer rows under other distractors"),
    ];
    let lacking = |(measure, why): (&str, &str)| -> Vec<String> {
        let names = k.iter().map(|k| format!("{measure}@{k}")).filter(|name| numbers.get(name).is_none());
        names.map(|name| format!("{name} is left out: {why}")).collect()
    };
    measures.into_iter().flat_map(lacking).collect()
}

/// `0.61 [0.57, 0.66]`, or without an interval if there is none.
pub(super) fn text(i: &Interval) -> String {
    if i.low.is_finite() && i.high.is_finite() {
        format!("{} [{}, {}]", fixed(i.estimate, 3), fixed(i.low, 3), fixed(i.high, 3))
    } else {
        fixed(i.estimate, 3)
    }
}

/// The interval's ends, if it has some.
pub(super) fn ends(i: &Interval) -> Option<(f64, f64)> {
    (i.low.is_finite() && i.high.is_finite()).then_some((i.low, i.high))
}

/// Features of past actions, with their dimensions; none without a recording.
pub(super) fn past_actions(session: &mut Session) -> anyhow::Result<Option<(usize, Vec<f32>)>> {
    let Some(frames) = session.frames()? else {
        if !session.without_frames() {
            session.remark("these latents name no recording, so there is no action-only control");
        }
        return Ok(None);
    };
    Ok(Some(action_features(&session.latents, &frames)))
}

/// A table of these features of the session's rows.
pub(super) fn table<'a>(session: &'a Session, (dims, values): &'a (usize, Vec<f32>)) -> anyhow::Result<Table<'a>> {
    let l = &session.latents;
    Ok(Table::new(*dims, values, &l.episode, &l.step)?.with_grid(&l.state, &l.distractor)?)
}

fn draw(session: &Session, numbers: &Numbers) -> Bars {
    let bar = |label: String, i: &Interval, chance: f64| Bar {
        label,
        value: i.estimate,
        interval: ends(i),
        chance: chance.is_finite().then_some(chance),
    };
    let shares = numbers.iter().filter_map(|n| Some((n.name.strip_suffix("_share")?, n)));
    let shares = shares.map(|(name, n)| bar(name.replace('_', " "), &n.value, n.chance)).collect();
    let whole = Some((0.0, 1.0));
    let mut groups = vec![BarGroup { axis: "share of the latents' variance".into(), range: whole, bars: shares }];
    for (measure, among) in [
        ("retrieval_same_step", "state found among all cells of the step"),
        ("retrieval_any_step", "state found under another distractor"),
    ] {
        let of = |n: &Number| {
            let k = n.name.strip_prefix(measure)?.strip_prefix('@')?;
            let latent = bar(format!("latent, {k} nearest"), &n.value, n.chance);
            let actions = n.past_actions.map(|i| bar(format!("actions only, {k} nearest"), &i, n.chance));
            Some(std::iter::once(latent).chain(actions))
        };
        let bars: Vec<Bar> = numbers.iter().filter_map(of).flatten().collect();
        if !bars.is_empty() {
            groups.push(BarGroup { axis: format!("{among} ({measure})"), range: whole, bars });
        }
    }
    Bars { heading: session.heading("Same state, other distractor: same latent?"), groups }
}
