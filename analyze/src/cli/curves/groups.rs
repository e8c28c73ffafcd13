//! Which runs are averaged: groups of one objective or single runs, task by task.

use std::collections::BTreeSet;

use super::By;
use crate::curves::{CurvePoint, mean_curve};
use crate::input::{Run, Series};
use crate::metrics::{Metric, Over};

/// Most places along a mean curve.
const PLACES: usize = 200;

/// What the task of a run is called that names none.
const NO_TASK: &str = "no task named";

/// The groups that runs belong to.
pub(super) struct Groups {
    /// The group of each run.
    pub(super) of_runs: Vec<String>,
    /// Every group, in the order of its first run.
    pub(super) names: Vec<String>,
}

impl Groups {
    /// Runs of one objective, or each run alone.
    pub(super) fn of(by: By, runs: &[Run]) -> Self {
        let of_runs = of_runs(by, runs);
        let mut names: Vec<String> = Vec::new();
        for group in &of_runs {
            if !names.contains(group) {
                names.push(group.clone());
            }
        }
        Self { of_runs, names }
    }

    /// The runs of a group that are of a task, where there are several.
    fn members<'r>(&self, runs: &'r [Run], group: &str, task: Option<&str>) -> Vec<&'r Run> {
        let members = runs.iter().zip(&self.of_runs).filter(|(run, of)| *of == group && is_of(run, task));
        members.map(|(run, _)| run).collect()
    }
}

fn of_runs(by: By, runs: &[Run]) -> Vec<String> {
    let objective = |r: &Run| r.objective().map_or_else(|| r.name.clone(), String::from);
    let distinct: BTreeSet<String> = runs.iter().map(objective).collect();
    if by == By::Objective
        || (by == By::Auto && distinct.len() < runs.len() && runs.iter().all(|r| r.objective().is_some()))
    {
        return runs.iter().map(objective).collect();
    }
    let same_name = |r: &Run| runs.iter().filter(|o| o.name == r.name).count() > 1;
    runs.iter().map(|r| if same_name(r) { r.path.display().to_string() } else { r.name.clone() }).collect()
}

/// What one facet shows: a metric, of one task if the runs are of several.
pub(super) struct Shown<'m> {
    pub(super) metric: &'m Metric,
    pub(super) task: Option<String>,
    pub(super) curves: Vec<GroupCurve>,
}

impl Shown<'_> {
    pub(super) fn title(&self) -> String {
        title(self.metric, self.task.as_deref())
    }
}

/// Which groups' curves of a metric are of fewer runs than the group has, or of none, task by task: those that lack the metric are left out.
pub(super) fn lacking(runs: &[Run], groups: &Groups, metric: &Metric) -> Vec<String> {
    let mut facts = Vec::new();
    for task in tasks(runs) {
        for group in &groups.names {
            let members = groups.members(runs, group, task.as_deref());
            let (all, lack) = (members.len(), members.iter().filter(|run| !has_curve(run, &metric.name)).count());
            if lack > 0 {
                let title = title(metric, task.as_deref());
                facts.push(format!("{title}: {lack} of {all} runs of {group} have no such curve and are left out"));
            }
        }
    }
    facts
}

/// Whether a run has a number of a metric somewhere.
fn has_curve(run: &Run, metric: &str) -> bool {
    run.series.get(metric).is_some_and(|series| series.iter().any(|point| point.1.is_finite()))
}

/// What a metric is called, of one task if there are several.
pub(super) fn title(metric: &Metric, task: Option<&str>) -> String {
    task.map_or_else(|| metric.title.clone(), |task| format!("{task}: {}", metric.title))
}

/// The runs' tasks, whose numbers are not averaged; none to tell apart if they are all of one.
pub(super) fn tasks(runs: &[Run]) -> Vec<Option<String>> {
    let tasks: BTreeSet<&str> = runs.iter().map(|r| r.task().unwrap_or(NO_TASK)).collect();
    if tasks.len() < 2 { vec![None] } else { tasks.into_iter().map(|task| Some(task.to_string())).collect() }
}

/// Whether a run is of a task, where there are several.
pub(super) fn is_of(run: &Run, task: Option<&str>) -> bool {
    task.is_none_or(|task| run.task().unwrap_or(NO_TASK) == task)
}

/// How many facets stand side by side so that each column is a task, if a page has room for all tasks.
pub(super) fn columns(runs: &[Run]) -> Option<usize> {
    Some(tasks(runs).len()).filter(|tasks| (2..=3).contains(tasks))
}

/// A metric of a group over training.
pub(super) struct GroupCurve {
    pub(super) group: String,
    pub(super) points: Vec<CurvePoint>,
    pub(super) runs: usize,
    /// What its intervals are over, if it has any.
    pub(super) over: Option<Over>,
}

/// The curves of every metric, task by task. What has none is left out, but where a column is a task, in which it keeps its place.
pub(super) fn shown<'m>(runs: &[Run], groups: &Groups, metrics: &'m [Metric]) -> anyhow::Result<Vec<Shown<'m>>> {
    let (tasks, keeps_places) = (tasks(runs), columns(runs).is_some());
    let mut all = Vec::new();
    for metric in metrics {
        let mut of_tasks = Vec::new();
        for task in &tasks {
            let curves = group_curves(runs, groups, &metric.name, task.as_deref())?;
            of_tasks.push(Shown { metric, task: task.clone(), curves });
        }
        let has_curves = of_tasks.iter().any(|shown| !shown.curves.is_empty());
        of_tasks.retain(|shown| !shown.curves.is_empty() || (keeps_places && has_curves));
        all.append(&mut of_tasks);
    }
    Ok(all)
}

/// The curves of one metric, group by group; groups that lack it are left out.
fn group_curves(runs: &[Run], groups: &Groups, metric: &str, task: Option<&str>) -> anyhow::Result<Vec<GroupCurve>> {
    let mut curves = Vec::new();
    for group in &groups.names {
        let mut members = groups.members(runs, group, task);
        members.retain(|run| has_curve(run, metric));
        if !members.is_empty() {
            curves.push(group_curve(group, &members, metric)?);
        }
    }
    Ok(curves)
}

/// The curve of some runs. A run alone keeps its own points, and the intervals of its evaluations.
fn group_curve(group: &str, members: &[&Run], metric: &str) -> anyhow::Result<GroupCurve> {
    let series: Vec<Series> = members.iter().filter_map(|run| run.series.get(metric)).cloned().collect();
    let all: usize = series.iter().map(Vec::len).sum();
    let longest = series.iter().map(Vec::len).max().unwrap_or(2).clamp(2, PLACES);
    let mut points = mean_curve(&series, if all <= PLACES { PLACES } else { longest })?;
    let over = match members {
        [only] => own_intervals(only, metric, &mut points),
        _ => points.iter().any(|point| point.y.low.is_finite()).then_some(Over::Runs),
    };
    Ok(GroupCurve { group: group.to_owned(), points, runs: members.len(), over })
}

/// Gives the points of a single run the intervals that its evaluations hold, and says what these are over.
fn own_intervals(run: &Run, metric: &str, points: &mut [CurvePoint]) -> Option<Over> {
    let mut over = None;
    for point in points {
        if let Some((ends, of)) = run.own_interval(metric, (point.x, point.y.estimate)) {
            (point.y.low, point.y.high) = ends;
            over = Some(of);
        }
    }
    over
}
