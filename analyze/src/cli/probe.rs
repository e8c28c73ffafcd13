//! `probe`: what can be read from the latent?

use serde_json::json;
use vibes_data::Latents;

use super::invariance::ends;
use super::session::{Input, Session};
use super::{Globals, Outcome};
use crate::actions::action_features;
use crate::figures::{Figure, ProbeChart, ProbeMark, ProbeRow};
use crate::input::Frames;
use crate::output::Column;
use vibes_measure::Table;
use vibes_measure::intervals::Interval;
use vibes_measure::probes::{HoldOut, Probe, ProbeOptions, ProbeScore, Quantity, Values, probe};

/// Ridge and kNN probes on held-out trajectories: from the latent to each task quantity (high is good) and to each distractor parameter
/// (chance is good), with an action-only and a shuffled control.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    input: Input,
}

const TASK: &str = "task: high is good";
const DISTRACTORS: &str = "distractors: at chance is good";
/// A standard deviation below this share of the largest value is no variation.
const FLAT: f64 = 1e-9;

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    let mut session = Session::open(&options.input, globals, "probe", json!({}))?;
    let frames = session.needed_frames("probe")?;
    let (latents, outside) = usable(&session.latents);
    if outside > 0 {
        session.remark(format!("{outside} rows lie outside the grid that the others are on and were left out"));
    }
    let (kept, flat): (Vec<_>, Vec<_>) =
        quantities(&latents, &frames).into_iter().partition(|(_, q)| varies(&q.values));
    if !flat.is_empty() {
        let names: Vec<&str> = flat.iter().map(|(_, q)| q.name.as_str()).collect();
        session.remark(format!("{} do not vary in this recording and were left out", names.join(", ")));
    }
    if kept.is_empty() {
        anyhow::bail!(
            "there is nothing to read off these {} latents: nothing in their recording varies: {}",
            latents.len(),
            session.path.display()
        );
    }
    let (sections, quantities): (Vec<&str>, Vec<Quantity>) = kept.into_iter().unzip();
    let of_latent = scores(&session, &latents, latents.dims, &latents.latent, &sections, &quantities)?;
    let (dims, values) = action_features(&latents, &frames);
    let of_actions = scores(&session, &latents, dims, &values, &sections, &quantities)?;
    session.save(&Figure::ProbeChart(draw(&session, &sections, &quantities, &of_latent, &of_actions)), "probes")?;
    write(&mut session, &sections, &quantities, &of_latent, &of_actions)?;
    let mean = |section: &str| {
        let mean = mean_score(section, &sections, &quantities, &of_latent);
        mean.map_or_else(|| "nothing (none varies)".into(), |mean| format!("a mean of {mean:.3}"))
    };
    let line = format!(
        "probe: linear probes read of the task {}, of the distractors {} (R², accuracy over chance)",
        mean(TASK),
        mean(DISTRACTORS)
    );
    Ok(session.finish(line))
}

/// Task quantities are held out by state trajectory, since the cells of a row share their states; distractors by episode, since the cells of a
/// column share their distractors, and shuffling whole state trajectories would leave them where they are.
fn scores(
    session: &Session,
    l: &Latents,
    dims: usize,
    values: &[f32],
    sections: &[&str],
    quantities: &[Quantity],
) -> anyhow::Result<Vec<ProbeScore>> {
    let table = Table::new(dims, values, &l.episode, &l.step)?.with_grid(&l.state, &l.distractor)?;
    let mut rng = session.rng();
    let mut all = Vec::new();
    for (section, hold_out) in [(TASK, HoldOut::State), (DISTRACTORS, HoldOut::Episode)] {
        let own: Vec<Quantity> =
            sections.iter().zip(quantities).filter(|(s, _)| **s == section).map(|(_, q)| q.clone()).collect();
        if !own.is_empty() {
            all.extend(probe(&table, &own, ProbeOptions { hold_out, ..ProbeOptions::default() }, &mut rng)?);
        }
    }
    Ok(all)
}

/// The rows that have a reward, so that every quantity has a value in every row (all rows if none has), and a cell if any has one, so that no
/// cell of a held-out state is left among the others. Also returns how many rows that have none are left out.
fn usable(l: &Latents) -> (Latents, usize) {
    let rewarded = |row: &usize| l.reward[*row].is_some_and(f32::is_finite);
    let on_grid = |row: &usize| l.state[*row].is_some() && l.distractor[*row].is_some();
    let mut keep: Vec<usize> = (0..l.len()).filter(rewarded).collect();
    if keep.is_empty() {
        keep = (0..l.len()).collect();
    }
    let all = keep.len();
    if keep.iter().any(on_grid) {
        keep.retain(on_grid);
    }
    let outside = all - keep.len();
    let kept = Latents {
        episode: keep.iter().map(|&r| l.episode[r]).collect(),
        step: keep.iter().map(|&r| l.step[r]).collect(),
        state: keep.iter().map(|&r| l.state[r]).collect(),
        distractor: keep.iter().map(|&r| l.distractor[r]).collect(),
        reward: keep.iter().map(|&r| l.reward[r]).collect(),
        dims: l.dims,
        latent: keep.iter().flat_map(|&r| l.row(r).iter().copied()).collect(),
        source: l.source.clone(),
    };
    (kept, outside)
}

/// All quantities with their sections: the task's observation and reward, then camera, background and colours.
fn quantities(l: &Latents, frames: &Frames) -> Vec<(&'static str, Quantity)> {
    let spec = &frames.recording().manifest().spec;
    let number = |section, name: String, values| (section, Quantity { name, values: Values::Numbers(values) });
    let columns = |section, names: &[String], values: &[f64]| -> Vec<(&'static str, Quantity)> {
        let column = |i: usize| values.iter().skip(i).step_by(names.len()).copied().collect();
        names.iter().enumerate().map(|(i, name)| number(section, name.clone(), column(i))).collect()
    };
    let mut all = columns(TASK, &spec.observation_names(), &frames.observations(l));
    if let Some(rewards) = l.reward.iter().map(|r| r.map(f64::from)).collect::<Option<Vec<f64>>>() {
        all.push(number(TASK, "reward".into(), rewards));
    }
    let camera = ["distance", "azimuth", "inclination", "roll"].map(|n| format!("camera {n}"));
    all.extend(columns(DISTRACTORS, &camera, &frames.cameras(l)));
    if let Some(shown) = frames.backgrounds(l).into_iter().collect::<Option<Vec<(u32, u32)>>>() {
        let videos = Values::Classes(shown.iter().map(|b| b.0).collect());
        all.push((DISTRACTORS, Quantity { name: "video".into(), values: videos }));
        all.push(number(DISTRACTORS, "video frame".into(), shown.iter().map(|b| f64::from(b.1)).collect()));
    }
    let names: Vec<String> =
        spec.materials.iter().flat_map(|m| ["red", "green", "blue"].map(|c| format!("{m} {c}"))).collect();
    all.extend(columns(DISTRACTORS, &names, &frames.colors(l)));
    all
}

fn varies(values: &Values) -> bool {
    match values {
        Values::Classes(classes) => classes.iter().any(|c| *c != classes[0]),
        Values::Numbers(v) => {
            let (lo, hi) = v.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), &x| (lo.min(x), hi.max(x)));
            hi - lo > FLAT * hi.abs().max(lo.abs()).max(1e-300)
        }
    }
}

/// A score on the chart's scale: R² as it is; an accuracy as its share of the way from chance to 1.
fn scaled(i: &Interval, score: &ProbeScore) -> Interval {
    if score.measure != "accuracy" {
        return *i;
    }
    let over = |v: f64| (v - score.chance) / (1.0 - score.chance).max(1e-12);
    Interval { estimate: over(i.estimate), low: over(i.low), high: over(i.high) }
}

fn find<'s>(scores: &'s [ProbeScore], name: &str, which: Probe) -> Option<&'s ProbeScore> {
    scores.iter().find(|s| s.quantity == name && s.probe == which)
}

fn mean_score(section: &str, sections: &[&str], quantities: &[Quantity], scores: &[ProbeScore]) -> Option<f64> {
    let of = |q: &Quantity| find(scores, &q.name, Probe::Ridge).map(|s| scaled(&s.score, s).estimate);
    let values: Vec<f64> = sections
        .iter()
        .zip(quantities)
        .filter(|(s, _)| **s == section)
        .filter_map(|(_, q)| of(q))
        .filter(|v| v.is_finite())
        .collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn draw(
    session: &Session,
    sections: &[&str],
    quantities: &[Quantity],
    scores: &[ProbeScore],
    control: &[ProbeScore],
) -> ProbeChart {
    let row = |(section, q): (&&str, &Quantity)| {
        let mut marks = Vec::new();
        let mut mark = |source: usize, score: Option<&ProbeScore>, shuffled: bool| {
            if let Some(s) = score {
                let i = scaled(if shuffled { &s.shuffled } else { &s.score }, s);
                marks.push(ProbeMark { source, score: i.estimate, interval: ends(&i) });
            }
        };
        mark(0, find(scores, &q.name, Probe::Ridge), false);
        mark(1, find(scores, &q.name, Probe::Knn), false);
        mark(2, find(control, &q.name, Probe::Ridge), false);
        mark(3, find(scores, &q.name, Probe::Ridge), true);
        ProbeRow { section: (*section).into(), quantity: q.name.clone(), marks }
    };
    let (colors, single): (Vec<_>, Vec<_>) = sections.iter().zip(quantities).partition(|(_, q)| is_color(&q.name));
    let mut rows: Vec<ProbeRow> = single.into_iter().map(row).collect();
    // A task has up to a dozen materials of three channels: one line for all of them, each by itself in the table.
    let all: Vec<ProbeRow> = colors.into_iter().map(row).collect();
    rows.extend(mean_row(&all));
    ProbeChart {
        heading: session.heading("What can be read from the latent"),
        axis: "R², held-out trajectories (video: accuracy, 0 = chance)".into(),
        sources: ["latent, linear", "latent, kNN", "past actions, linear", "shuffled, linear"]
            .map(String::from)
            .to_vec(),
        rows,
    }
}

/// Whether a quantity is a channel of a material's colour.
fn is_color(name: &str) -> bool {
    [" red", " green", " blue"].iter().any(|channel| name.ends_with(channel))
}

/// The mean of several rows, source by source, without an interval.
fn mean_row(rows: &[ProbeRow]) -> Option<ProbeRow> {
    let first = rows.first()?;
    let mean = |source: usize| {
        let scores: Vec<f64> = rows
            .iter()
            .flat_map(|r| &r.marks)
            .filter(|m| m.source == source && m.score.is_finite())
            .map(|m| m.score)
            .collect();
        (!scores.is_empty()).then(|| ProbeMark {
            source,
            score: scores.iter().sum::<f64>() / scores.len() as f64,
            interval: None,
        })
    };
    let marks = (0..4).filter_map(mean).collect();
    Some(ProbeRow { section: first.section.clone(), quantity: format!("colours, mean of {}", rows.len()), marks })
}

fn write(
    session: &mut Session,
    sections: &[&str],
    quantities: &[Quantity],
    scores: &[ProbeScore],
    control: &[ProbeScore],
) -> anyhow::Result<()> {
    let section = |name: &str| {
        quantities
            .iter()
            .position(|q| q.name == name)
            .map_or("", |i| if sections[i] == TASK { "task" } else { "distractor" })
    };
    let all: Vec<(&str, &ProbeScore)> =
        scores.iter().map(|s| ("latent", s)).chain(control.iter().map(|s| ("past_actions", s))).collect();
    let texts =
        |of: &dyn Fn(&str, &ProbeScore) -> String| Column::Text(all.iter().map(|(source, s)| of(source, s)).collect());
    let numbers = |of: &dyn Fn(&ProbeScore) -> f64| Column::Float64(all.iter().map(|(_, s)| of(s)).collect());
    let table = [
        ("source", texts(&|source, _| source.into())),
        ("section", texts(&|_, s| section(&s.quantity).into())),
        ("quantity", texts(&|_, s| s.quantity.clone())),
        ("probe", texts(&|_, s| format!("{:?}", s.probe).to_lowercase())),
        ("measure", texts(&|_, s| s.measure.into())),
        ("score", numbers(&|s| s.score.estimate)),
        ("low", numbers(&|s| s.score.low)),
        ("high", numbers(&|s| s.score.high)),
        ("shuffled", numbers(&|s| s.shuffled.estimate)),
        ("chance", numbers(&|s| s.chance)),
    ];
    session.write_arrow("probes", &table)?;
    let sections: Vec<_> = sections
        .iter()
        .zip(quantities)
        .map(|(s, q)| json!({ "quantity": q.name, "section": if *s == TASK { "task" } else { "distractor" } }))
        .collect();
    session.write_json("probes", &json!({ "quantities": sections, "latent": scores, "past_actions": control }))
}
