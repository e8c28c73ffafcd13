//! How an evaluation is printed: numbers of the grid, a table of what probes read, the gaps, and what has to be known of them. In: a report and gaps. Out: lines.

use vibes_measure::intervals::Interval;
use vibes_measure::numbers::{Number, Numbers, probe_family};
use vibes_measure::probes::{Fitting, Probe};
use vibes_train::evaluate::{Gaps, GridSize, Likelihoods, Report};

/// Tables of features in the order of their columns.
const TABLES: [&str; 3] = ["s", "h", "hs"];
/// An R² below this is no prediction that went wrong, but errors in units of next to nothing.
const HARDLY: f64 = -10.0;

pub(super) fn print_report(report: &Report) {
    let GridSize { states, distractors, steps, dropped } = &report.grid;
    let remarks = dropped.remarks();
    if !remarks.is_empty() {
        remarks.iter().for_each(|remark| println!("{remark}"));
        println!("shares and retrieval are of {states} × {distractors} trajectories of {steps} steps");
    }
    println!("{:<52} {:>24} {:>13} {:>7}", "number", "latents [95% interval]", "past actions", "chance");
    let is_probe = |number: &&Number| number.name.starts_with("probe");
    report.numbers.iter().filter(|number| !is_probe(number)).for_each(print_number);
    if let Some(note) = reward_note(&report.numbers) {
        println!("{note}");
    }
    for fitting in [Fitting::OtherRecordings, Fitting::CrossValidation] {
        probe_lines(report, fitting).iter().for_each(|line| println!("{line}"));
    }
    if !report.left_out.is_empty() {
        let names = report.left_out.join(", ");
        println!(
            "not read, since the recordings to fit on do not name them (--probe-episodes 0 fits on the grid itself): {names}"
        );
    }
}

fn print_number(number: &Number) {
    let actions = number.past_actions.map_or_else(String::new, |actions| plain(actions.estimate));
    let (name, text, chance) = (&number.name, bounded(number.value), chance(number.chance));
    println!("{name:<52} {text:>24} {actions:>13} {chance:>7}");
}

/// What is to be known where rewards vary too little to be predicted, which numbers that are none, or far below 0, do not say by themselves.
fn reward_note(numbers: &Numbers) -> Option<String> {
    let of_rewards = numbers.iter().filter(|number| number.name.starts_with("open_loop_reward_r2"));
    let found: Vec<f64> = of_rewards.map(|number| number.value.estimate).collect();
    let how = if found.iter().any(|estimate| !estimate.is_finite()) {
        "do not vary at some of these steps (–)"
    } else if found.iter().any(|estimate| *estimate < HARDLY) {
        "hardly vary at some of these steps"
    } else {
        return None;
    };
    Some(format!(
        "note: the grid's recorded rewards {how}: how well they are predicted says nothing of the model there"
    ))
}

/// What one quantity is read as, by table of features.
type Cells<'a> = [Option<&'a Number>; TABLES.len()];

/// What linear probes that were fitted in one way read, a line a quantity; nothing if none was.
fn probe_lines(report: &Report, fitting: Fitting) -> Vec<String> {
    let family = probe_family(Probe::Linear, fitting);
    let rows = by_quantity(report, family);
    if rows.is_empty() {
        return Vec::new();
    }
    let on = match (fitting, report.fitted_on) {
        (Fitting::OtherRecordings, Some(episodes)) => format!("fitted on {episodes} episodes"),
        _ => "cross-validated over the grid's own trajectories".to_owned(),
    };
    let columns: Vec<usize> =
        (0..TABLES.len()).filter(|&column| rows.iter().any(|(_, cells)| cells[column].is_some())).collect();
    let heads = columns.iter().map(|&column| format!("{} [95% interval]", TABLES[column])).collect();
    let mut lines = vec![
        format!("{family}/…: read by linear probes {on} (R²; of classes such as the video accuracy):"),
        line("quantity", heads, ["past actions".to_owned(), "chance".to_owned()]),
    ];
    let (colors, single): (Vec<_>, Vec<_>) = rows.into_iter().partition(|(quantity, _)| is_color(quantity));
    lines.extend(single.iter().map(|(quantity, cells)| {
        let about = report.quantities.get(*quantity).unwrap_or(&"");
        let texts = columns.iter().map(|&column| cells[column].map_or_else(String::new, |n| bounded(n.value)));
        line(&format!("{about}: {quantity}"), texts.collect(), beside(cells))
    }));
    if !colors.is_empty() {
        lines.push(color_line(&colors, &columns));
    }
    lines
}

/// The numbers of one family, a row a quantity, in their order.
fn by_quantity<'a>(report: &'a Report, family: &str) -> Vec<(&'a str, Cells<'a>)> {
    let mut rows: Vec<(&str, Cells<'_>)> = Vec::new();
    for number in report.numbers.iter() {
        let own = number.name.strip_prefix(family).and_then(|rest| rest.strip_prefix('/'));
        let Some((quantity, table)) = own.and_then(|own| own.rsplit_once('/')) else { continue };
        let Some(column) = TABLES.iter().position(|name| *name == table) else { continue };
        match rows.iter_mut().find(|(name, _)| *name == quantity) {
            Some((_, cells)) => cells[column] = Some(number),
            None => {
                let mut cells: Cells<'_> = [None; TABLES.len()];
                cells[column] = Some(number);
                rows.push((quantity, cells));
            }
        }
    }
    rows
}

/// The many channels of the materials' colours as one line, of their means.
fn color_line(colors: &[(&str, Cells<'_>)], columns: &[usize]) -> String {
    let mean = |values: Vec<f64>| plain(values.iter().sum::<f64>() / values.len() as f64);
    let of = |column: usize| colors.iter().filter_map(move |(_, cells)| cells[column]);
    let texts = columns.iter().map(|&column| mean(of(column).map(|number| number.value.estimate).collect()));
    let any = || colors.iter().filter_map(|(_, cells)| cells.iter().flatten().next());
    let actions = any().filter_map(|number| Some(number.past_actions?.estimate)).collect();
    let beside = [mean(actions), mean(any().map(|number| number.chance).collect())];
    line(&format!("distractor: colours, mean of {}", colors.len()), texts.collect(), beside)
}

/// What past actions and chance give, which is the same beside every table of features.
fn beside(cells: &Cells<'_>) -> [String; 2] {
    let Some(number) = cells.iter().flatten().next() else { return Default::default() };
    let actions = number.past_actions.map_or_else(String::new, |actions| plain(actions.estimate));
    [actions, chance(number.chance)]
}

fn line(name: &str, cells: Vec<String>, [actions, chance]: [String; 2]) -> String {
    let cells: String = cells.iter().map(|cell| format!(" {cell:>23}")).collect();
    format!("{name:<44}{cells} {actions:>13} {chance:>7}")
}

/// Whether a quantity is one of the many channels of the materials' colours.
fn is_color(quantity: &str) -> bool {
    [" red", " green", " blue"].iter().any(|channel| quantity.ends_with(channel))
}

pub(super) fn print_gaps(gaps: &Gaps) {
    println!(
        "gaps to a bisimulation, nats a row [95% interval]: a fresh critic that sees everything, minus heads refitted on (h, s, a)"
    );
    println!("{:<10} {:>24} {:>24} {:>10} {:>10} {:>10}", "", "held out", "training", "critic", "refitted", "model");
    let line = |name: &str, held_out: &Likelihoods, training: &Likelihoods| {
        let Likelihoods { model, refitted, critic, .. } = held_out;
        println!(
            "{name:<10} {:>24} {:>24} {critic:>10.3} {refitted:>10.3} {model:>10.3}",
            bounded(held_out.gap),
            bounded(training.gap)
        );
    };
    line("dynamics", &gaps.held_out.dynamics, &gaps.training.dynamics);
    line("reward", &gaps.held_out.reward, &gaps.training.reward);
    println!(
        "after half of the critic's updates, held out: dynamics {:+.3}, reward {:+.3}",
        gaps.half_way.dynamics.gap.estimate, gaps.half_way.reward.gap.estimate
    );
    if let Some(note) = gap_note([gaps.dynamics_gap, gaps.reward_gap]) {
        println!("{note}");
    }
}

/// What is to be known where a held-out gap, of the dynamics or the reward, is below the 0 of a bisimulation.
pub(in crate::cli) fn gap_note(held_out: [f64; 2]) -> Option<&'static str> {
    held_out.iter().any(|gap| *gap < 0.0).then_some(
        "note: a held-out gap is below 0: the critic overfits these episodes, and the number says nothing of the latents; more episodes, or fewer --gap-updates",
    )
}

/// A number with its interval, if it has one.
fn bounded(value: Interval) -> String {
    if value.low.is_finite() {
        format!("{:.3} [{:.3}, {:.3}]", value.estimate, value.low, value.high)
    } else {
        plain(value.estimate)
    }
}

fn plain(value: f64) -> String {
    if value.is_finite() { format!("{value:.3}") } else { "–".to_owned() }
}

fn chance(value: f64) -> String {
    if value.is_finite() { plain(value) } else { String::new() }
}

#[cfg(test)]
mod tests;
