//! What was read, as a chart, as tables, and in a line. In: the scores of the latents and of past actions. Out: the chart and the files.

use serde_json::{Value, json};
use vibes_data::About;
use vibes_measure::intervals::Interval;
use vibes_measure::numbers::probe_numbers;
use vibes_measure::probes::{Fitting, Probe, ProbeScore, Quantity, over_chance};

use super::super::invariance::ends;
use super::super::session::Session;
use crate::figures::{Heading, ProbeChart, ProbeMark, ProbeRow};
use crate::output::Column;

pub(super) const TASK: &str = "task: high is good";
const SYMMETRY: &str = "superfluous by symmetry";
pub(super) const DISTRACTORS: &str = "distractors: at chance is good";
pub(super) const TARGETS: &str = "columns of your own";

/// The section of what a recording says of itself.
pub(super) fn section(about: About) -> &'static str {
    match about {
        About::Task => TASK,
        About::Symmetry => SYMMETRY,
        About::Distractor => DISTRACTORS,
    }
}

/// A section's name in tables.
fn short(section: &str) -> &'static str {
    [About::Task, About::Symmetry, About::Distractor]
        .into_iter()
        .find(|about| self::section(*about) == section)
        .map_or("target", About::name)
}

/// The quantities with their sections, and how well each is read.
pub(super) struct Shown<'a> {
    pub(super) sections: &'a [&'static str],
    pub(super) quantities: &'a [Quantity],
    /// Of the latents.
    pub(super) latent: Vec<ProbeScore>,
    /// Of past actions alone.
    pub(super) actions: Vec<ProbeScore>,
}

impl Shown<'_> {
    /// The chart, a line a quantity.
    pub(super) fn chart(&self, heading: Heading) -> ProbeChart {
        let named = self.sections.iter().zip(self.quantities);
        let (colors, single): (Vec<_>, Vec<_>) = named.partition(|(_, q)| is_color(&q.name));
        let row = |(section, quantity): (&&'static str, &Quantity)| self.row(section, &quantity.name);
        let mut rows: Vec<ProbeRow> = single.into_iter().map(row).collect();
        // A task has up to a dozen materials of three channels: one line for all of them, each by itself in the table.
        rows.extend(mean_row(&colors.into_iter().map(row).collect::<Vec<_>>()));
        ProbeChart {
            heading,
            axis: axis(&self.latent).into(),
            sources: ["latent, linear", "latent, kNN", "past actions, linear", "shuffled, linear"]
                .map(String::from)
                .to_vec(),
            rows,
        }
    }

    fn row(&self, section: &str, name: &str) -> ProbeRow {
        let (linear, knn) = (find(&self.latent, name, Probe::Linear), find(&self.latent, name, Probe::Knn));
        let scores = [
            (0, linear.map(|s| (s, &s.score))),
            (1, knn.map(|s| (s, &s.score))),
            (2, find(&self.actions, name, Probe::Linear).map(|s| (s, &s.score))),
            (3, linear.map(|s| (s, &s.shuffled))),
        ];
        let mark = |(source, score): (usize, Option<(&ProbeScore, &Interval)>)| {
            let (of, interval) = score?;
            let shown = scaled(interval, of.chance);
            Some(ProbeMark { source, score: shown.estimate, interval: ends(&shown) })
        };
        let is_class = linear.is_some_and(|score| score.measure == "accuracy");
        let quantity = if is_class { format!("{name} (accuracy over chance)") } else { name.to_owned() };
        ProbeRow { section: section.into(), quantity, marks: scores.into_iter().filter_map(mark).collect() }
    }

    /// The linear probes of a section by quantity, the worst first: R², accuracy over chance.
    pub(super) fn linear(&self, section: &str) -> Vec<(&str, f64)> {
        let own = self.sections.iter().zip(self.quantities).filter(|(other, _)| **other == section);
        let of = |(_, q): (&&str, &Quantity)| {
            let score = find(&self.latent, &q.name, Probe::Linear)?;
            Some((score.quantity.as_str(), over_chance(score.score.estimate, score.chance)))
        };
        let mut scores: Vec<(&str, f64)> = own.filter_map(of).filter(|score| score.1.is_finite()).collect();
        scores.sort_by(|a, b| a.1.total_cmp(&b.1));
        scores
    }

    /// Writes `probes.arrow` and `probes.json`; `fitted_on` says what probes of numbers were fitted on.
    pub(super) fn write(&self, session: &mut Session, fitted_on: &Value) -> anyhow::Result<()> {
        session.write_arrow("probes", &self.table())?;
        let named = self.sections.iter().zip(self.quantities);
        let sections: Vec<Value> = named.map(|(s, q)| json!({ "quantity": q.name, "section": short(s) })).collect();
        let numbers = probe_numbers("s", &self.latent, Some(&self.actions));
        let all = json!({
            "fitted_on": fitted_on, "numbers": numbers, "quantities": sections, "latent": self.latent, "past_actions": self.actions,
        });
        session.write_json("probes", &all)
    }

    fn table(&self) -> [(&'static str, Column); 11] {
        let of = |source: &'static str| move |score| (source, score);
        let all: Vec<(&str, &ProbeScore)> =
            self.latent.iter().map(of("latent")).chain(self.actions.iter().map(of("past_actions"))).collect();
        let texts = |of: &dyn Fn(&str, &ProbeScore) -> String| {
            Column::Text(all.iter().map(|(source, score)| of(source, score)).collect())
        };
        let numbers = |of: &dyn Fn(&ProbeScore) -> f64| Column::Float64(all.iter().map(|(_, s)| of(s)).collect());
        let section =
            |name: &str| self.quantities.iter().position(|q| q.name == name).map_or("", |at| short(self.sections[at]));
        [
            ("source", texts(&|source, _| source.into())),
            ("section", texts(&|_, s| section(&s.quantity).into())),
            ("quantity", texts(&|_, s| s.quantity.clone())),
            ("probe", texts(&|_, s| format!("{:?}", s.probe).to_lowercase())),
            ("fitting", texts(&|_, s| fitting(s.fitting).into())),
            ("measure", texts(&|_, s| s.measure.into())),
            ("score", numbers(&|s| s.score.estimate)),
            ("low", numbers(&|s| s.score.low)),
            ("high", numbers(&|s| s.score.high)),
            ("shuffled", numbers(&|s| s.shuffled.estimate)),
            ("chance", numbers(&|s| s.chance)),
        ]
    }
}

/// As in the JSON.
fn fitting(of: Fitting) -> &'static str {
    match of {
        Fitting::OtherRecordings => "other_recordings",
        Fitting::CrossValidation => "cross_validation",
    }
}

/// What the chart's axis shows.
fn axis(scores: &[ProbeScore]) -> &'static str {
    let has = |fitting: Fitting| scores.iter().any(|score| score.fitting == fitting);
    match (has(Fitting::OtherRecordings), has(Fitting::CrossValidation)) {
        (true, true) => "R², fitted on other recordings (classes cross-validated)",
        (true, false) => "R², fitted on other recordings",
        (false, _) => "R², cross-validated over the table's own trajectories",
    }
}

/// A score on the chart's scale.
fn scaled(i: &Interval, chance: f64) -> Interval {
    let over = |score: f64| over_chance(score, chance);
    Interval { estimate: over(i.estimate), low: over(i.low), high: over(i.high) }
}

fn find<'s>(scores: &'s [ProbeScore], name: &str, which: Probe) -> Option<&'s ProbeScore> {
    scores.iter().find(|s| s.quantity == name && s.probe == which)
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
