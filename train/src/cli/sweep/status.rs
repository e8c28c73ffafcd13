//! How far every run of a sweep is, as a table or as JSON. In: the plan's runs. Out: lines on standard output.

use anyhow::Result;
use vibes_command::Ending;
use vibes_train::sweep::{self, Element, State, Status};

use crate::cli::Context;

pub(super) fn status(context: &Context, elements: &[Element]) -> Result<Ending> {
    let all: Vec<Status> = elements.iter().map(sweep::status).collect();
    if context.json {
        println!("{}", serde_json::to_string(&all)?);
        return Ok(Ending::Done);
    }
    let width = all.iter().map(|status| status.name.len()).max().unwrap_or(3).max(3);
    println!(
        "{:>5}  {:<width$}  state    stages  made of all                   objective  left    last change",
        "index", "run"
    );
    for status in &all {
        println!("{}", row(status, width));
    }
    let count = |state: State| all.iter().filter(|status| status.state == state).count();
    println!(
        "{} runs: {} done, {} running, {} saved, {} failed, {} waiting",
        all.len(),
        count(State::Done),
        count(State::Running),
        count(State::Saved),
        count(State::Failed),
        count(State::Waiting)
    );
    Ok(Ending::Done)
}

fn row(status: &Status, width: usize) -> String {
    let dash = || "–".to_owned();
    let number = |value: Option<u64>| value.map_or_else(dash, |value| value.to_string());
    let made = match status.control_steps_asked {
        Some(asked) => format!("{}/{asked} control steps", number(status.control_steps)),
        None => format!("{}/{} updates", number(status.update), number(status.updates)),
    };
    let objective = status.objective.map_or_else(dash, |value| format!("{value:.3}"));
    let time = |seconds: Option<f64>| seconds.map_or_else(dash, short_time);
    let state = format!("{:?}", status.state).to_lowercase();
    let left = if status.state == State::Running { time(status.seconds_left) } else { dash() };
    let note = status.note.as_ref().map_or_else(String::new, |note| format!("  {note}"));
    format!(
        "{:>5}  {:<width$}  {state:<7}  {}/{:<4}  {made:<28}  {objective:<9}  {left:<6}  {}{note}",
        status.index,
        status.name,
        status.stages.0,
        status.stages.1,
        time(status.seconds_since)
    )
}

fn short_time(seconds: f64) -> String {
    match seconds as u64 {
        seconds @ 0..60 => format!("{seconds} s"),
        seconds @ 60..3600 => format!("{} min", seconds / 60),
        seconds => format!("{:.1} h", seconds as f64 / 3600.0),
    }
}
