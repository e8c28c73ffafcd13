//! `clusters`: latents in groups, and what each group holds.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde_json::{Value, json};
use vibes_command::Given;
use vibes_data::{About, Latents, Readable};

use super::maps::{MadeMap, MapOptions, coloring, file_stem, thousands};
use super::session::{Input, Session};
use super::{Globals, Outcome, wrong};
use crate::figures::{Coloring, Figure, Map};
use crate::input::UserColumn;
use crate::output::{Column, write_csv};
use crate::picture::number::fixed;
use vibes_measure::clusters::{ClusterSummary, Method, Typical, cluster_table, clusters};
use vibes_measure::probes::{HoldOut, Quantity, Values};

/// Group the latents by k-means or DBSCAN, and say what each group holds.
///
/// The groups are drawn as colours on the map and written as a column (clusters.arrow: episode, step, cluster). A table (clusters.csv) says of each
/// group how many rows it has, from how many states and distractors they are, and how far its mean of each task quantity is from that of all rows.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    given: Given,
    #[command(flatten)]
    input: Input,
    /// How rows are grouped: k-means puts every row into one of --clusters groups, DBSCAN leaves out rows that lie alone.
    #[arg(long, value_enum, default_value_t = Way::Kmeans)]
    by: Way,
    /// k-means: how many groups.
    #[arg(long, default_value_t = CLUSTERS)]
    clusters: usize,
    /// DBSCAN: how many rows within reach of a row make it part of a group.
    #[arg(long, default_value_t = MIN_POINTS)]
    min_points: usize,
    /// DBSCAN: how far is within reach, in standard deviations of the latents.
    #[arg(long, default_value_t = REACH)]
    reach: f64,
    /// Columns to set beside the groups, of the latents' table or of one that is joined: each colours the same map once more and has a line in
    /// the table: numbers with their mean, texts with the most frequent one.
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    color: Vec<String>,
}

/// What the options are unless they are given.
const CLUSTERS: usize = 8;
const MIN_POINTS: usize = 10;
const REACH: f64 = 1.0;

impl Options {
    /// The options of a verb that is run by another: what is not named has its default.
    pub(super) fn of(input: Input) -> Self {
        Self {
            given: Given::default(),
            input,
            by: Way::Kmeans,
            clusters: CLUSTERS,
            min_points: MIN_POINTS,
            reach: REACH,
            color: Vec::new(),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Way {
    Kmeans,
    Dbscan,
}

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    let method = match options.by {
        Way::Kmeans => Method::KMeans { k: options.clusters },
        Way::Dbscan => Method::Dbscan { min_points: options.min_points, reach: options.reach },
    };
    let others: &[&str] = match options.by {
        Way::Kmeans => &["min_points", "reach"],
        Way::Dbscan => &["clusters"],
    };
    if let Some(option) = options.given.first_of(others.iter().copied()) {
        let way = format!("{:?}", options.by).to_lowercase();
        return Err(wrong(format!("{option} has no effect with --by {way}; leave it out")));
    }
    let about = about(method, &options.color);
    let mut session = Session::open_with(&options.input, globals, "clusters", about, &options.color)?;
    let labels = clusters(&session.table()?, method, &mut session.rng())?;
    let mut quantities = quantities(&session)?;
    let kinds = add_columns(&mut session, &mut quantities)?;
    let summaries = cluster_table(&session.table()?, &labels, &quantities)?;
    let made = MapOptions::usual(&options.given).map_or_other(&mut session, globals)?;
    let map = Map {
        heading: session.heading(format!("Groups of {} latents", thousands(session.latents.len()))),
        axes: made.method.name().into(),
        points: made.points(),
        backdrop: Vec::new(),
        coloring: Coloring::Kind { name: "cluster".into(), kinds: labels.clone(), names: Vec::new() },
    };
    session.save(&Figure::Map(map), "map-by-cluster")?;
    draw_columns(&mut session, &made)?;
    let l = &session.latents;
    // Arrow's unsigned numbers have no "none": rows of no group carry the largest number.
    let column = labels.iter().map(|label| label.unwrap_or(u32::MAX)).collect();
    let columns = [
        ("episode", Column::UInt32(l.episode.clone())),
        ("step", Column::UInt32(l.step.clone())),
        ("cluster", Column::UInt32(column)),
    ];
    session.write_arrow("clusters", &columns)?;
    write_summaries(&mut session, &summaries, &kinds)?;
    session.write_json("clusters", &json!({ "clusters": listed(&summaries, &kinds)? }))?;
    let alone = labels.iter().filter(|label| label.is_none()).count();
    let count = summaries.iter().filter(|summary| summary.cluster.is_some()).count();
    if options.by == Way::Kmeans {
        fewer(count, options.clusters).into_iter().for_each(|remark| session.remark(remark));
    }
    let mut line = format!("clusters: {count} groups of {} latents", labels.len());
    if alone > 0 {
        let _ = write!(line, ", {alone} rows in none");
    }
    let has_cells = has_cells(&session.latents);
    for summary in &summaries {
        let _ = write!(line, "\n  {}", sentence(summary, has_cells, &kinds));
    }
    Ok(session.finish(line))
}

/// What is to be said where k-means found fewer groups than it was asked for.
fn fewer(found: usize, asked: usize) -> Option<String> {
    (found < asked).then(|| format!("only {found} groups could be told apart, {asked} were asked for"))
}

/// Whether some row is of a grid, so that it has a state and a distractor.
fn has_cells(l: &Latents) -> bool {
    l.state.iter().zip(&l.distractor).any(|cell| cell.0.is_some() && cell.1.is_some())
}

/// The options as they go into outputs.
fn about(method: Method, color: &[String]) -> Value {
    match method {
        Method::KMeans { k } => json!({ "by": "kmeans", "clusters": k, "color": color }),
        Method::Dbscan { min_points, reach } => {
            json!({ "by": "dbscan", "min_points": min_points, "reach": reach, "color": color })
        }
    }
}

/// The task quantities of every row, if the recording is at hand.
fn quantities(session: &Session) -> anyhow::Result<Vec<Quantity>> {
    let Some(frames) = session.frames()? else { return Ok(Vec::new()) };
    let l = &session.latents;
    let readable = frames.recording().manifest().spec.readable();
    let quantity = |readable: &Readable| {
        let of = |row: usize| readable.value(frames.view(l.episode[row])?, l.step[row] as usize);
        // An episode's last row has no reward.
        let values: Vec<f64> = (0..l.len()).map(of).collect::<Option<_>>()?;
        Some(Quantity { name: readable.name.clone(), hold_out: HoldOut::State, values: Values::Numbers(values) })
    };
    let of_task = readable.iter().filter(|readable| readable.about == About::Task && !readable.is_class());
    Ok(of_task.filter_map(quantity).filter(|quantity| quantity.values.vary()).collect())
}

/// What the kinds of the user's own columns are called, by column.
#[derive(Debug, Default)]
struct Kinds(BTreeMap<String, Vec<String>>);

impl Kinds {
    /// What the most frequent kind in a group is called; none of a number.
    fn name(&self, typical: &Typical) -> Option<&str> {
        Some(self.0.get(&typical.quantity)?.get(typical.value as usize)?.as_str())
    }
}

/// The user's own columns among the quantities, with the names of their kinds; one that has no value in some row is left out.
fn add_columns(session: &mut Session, quantities: &mut Vec<Quantity>) -> anyhow::Result<Kinds> {
    let (rows, mut kinds) = (session.latents.len(), Kinds::default());
    for (name, column) in session.columns.clone() {
        if quantities.iter().any(|quantity| quantity.name == name) {
            return Err(wrong(format!("--color {name}: a quantity of the recording has this name; rename the column")));
        }
        let without = (0..rows).filter(|&row| !column.has(row)).count();
        if without > 0 {
            session.remark(format!("{without} rows have no value of {name}, which is left out of the table"));
            continue;
        }
        let values = match column {
            UserColumn::Numbers(values) => Values::Numbers(values),
            UserColumn::Kinds { of_row, names } => {
                kinds.0.insert(name.clone(), names);
                Values::Classes(of_row.into_iter().flatten().collect())
            }
        };
        quantities.push(Quantity { name, hold_out: HoldOut::State, values });
    }
    Ok(kinds)
}

/// The map once more for each of the user's own columns.
fn draw_columns(session: &mut Session, made: &MadeMap) -> anyhow::Result<()> {
    for column in session.columns.clone() {
        let map = Map {
            heading: session.heading(format!("The same map, coloured by {}", column.0)),
            axes: made.method.name().into(),
            points: made.points(),
            backdrop: Vec::new(),
            coloring: coloring(&column, session.latents.len())?,
        };
        session.save(&Figure::Map(map), &format!("map-by-{}", file_stem(&column.0)))?;
    }
    Ok(())
}

/// A group in words: how many rows, from how many states (or episodes, where there is no grid), what sets it apart most, and which kinds it holds.
fn sentence(summary: &ClusterSummary, has_cells: bool, kinds: &Kinds) -> String {
    let name = summary.cluster.map_or_else(|| "in none".to_string(), |cluster| format!("cluster {cluster}"));
    let of = if has_cells {
        format!("{} states and {} distractors", summary.states, summary.distractors)
    } else {
        format!("{} episodes", summary.states)
    };
    let is_number = |typical: &&Typical| kinds.name(typical).is_none() && typical.apart.is_finite();
    let mut apart: Vec<&Typical> = summary.quantities.iter().filter(is_number).collect();
    apart.sort_by(|a, b| b.apart.abs().total_cmp(&a.apart.abs()));
    let typical = apart.iter().take(2).map(|t| format!("; {} {} ± {:.2}", t.quantity, fixed(t.value, 2), t.spread));
    let of_kinds = summary.quantities.iter().filter_map(|t| Some((t, kinds.name(t)?)));
    let of_kinds = of_kinds
        .map(|(t, kind)| format!("; {} {kind} in {:.2} of its rows ({:.2} of all)", t.quantity, t.spread, t.apart));
    format!("{name}: {} rows of {of}{}", summary.rows, typical.chain(of_kinds).collect::<String>())
}

/// The groups as they go into JSON, kinds with their names.
fn listed(summaries: &[ClusterSummary], kinds: &Kinds) -> anyhow::Result<Value> {
    let mut all = serde_json::to_value(summaries)?;
    for (group, summary) in summaries.iter().enumerate() {
        for (at, typical) in summary.quantities.iter().enumerate() {
            if let Some(kind) = kinds.name(typical) {
                all[group]["quantities"][at]["kind"] = json!(kind);
            }
        }
    }
    Ok(all)
}

/// What the table of groups says in one row: a group, and one of its quantities if it has some.
type SummaryRow<'s> = (&'s ClusterSummary, Option<&'s Typical>);

/// A row for each quantity of a group; a group of which none is known has one row as well, which says how large it is.
fn rows_of(summary: &ClusterSummary) -> Vec<SummaryRow<'_>> {
    if summary.quantities.is_empty() {
        return vec![(summary, None)];
    }
    summary.quantities.iter().map(|typical| (summary, Some(typical))).collect()
}

/// The table of groups as CSV, a row a group and quantity.
fn write_summaries(session: &mut Session, summaries: &[ClusterSummary], kinds: &Kinds) -> anyhow::Result<()> {
    let rows: Vec<SummaryRow<'_>> = summaries.iter().flat_map(rows_of).collect();
    let name = |s: &ClusterSummary| s.cluster.map_or_else(|| "none".to_string(), |cluster| cluster.to_string());
    let quantity = |typical: Option<&Typical>| typical.map_or_else(String::new, |typical| typical.quantity.clone());
    let kind =
        |typical: Option<&Typical>| typical.and_then(|typical| kinds.name(typical)).unwrap_or_default().to_owned();
    let numbers = |of: fn(&Typical) -> f64| Column::Float64(rows.iter().map(|r| r.1.map_or(f64::NAN, of)).collect());
    let columns = [
        ("cluster", Column::Text(rows.iter().map(|r| name(r.0)).collect())),
        ("rows", Column::UInt32(rows.iter().map(|r| r.0.rows as u32).collect())),
        ("states", Column::UInt32(rows.iter().map(|r| r.0.states as u32).collect())),
        ("distractors", Column::UInt32(rows.iter().map(|r| r.0.distractors as u32).collect())),
        ("quantity", Column::Text(rows.iter().map(|r| quantity(r.1)).collect())),
        ("kind", Column::Text(rows.iter().map(|r| kind(r.1)).collect())),
        ("value", numbers(|typical| typical.value)),
        ("spread", numbers(|typical| typical.spread)),
        ("apart", numbers(|typical| typical.apart)),
    ];
    let path = session.out.join("clusters.csv");
    write_csv(&path, &columns)?;
    session.outcome.files.push(path);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_says_what_it_holds() {
        let typical =
            |quantity: &str, value: f64| Typical { quantity: quantity.into(), value, spread: 0.75, apart: 0.5 };
        let quantities = vec![typical("height", 1.5), typical("weather", 1.0)];
        let summary = ClusterSummary { cluster: Some(2), rows: 40, states: 10, distractors: 0, quantities };
        let kinds = Kinds(BTreeMap::from([("weather".to_owned(), vec!["fog".to_owned(), "rain".to_owned()])]));
        let said = sentence(&summary, false, &kinds);
        assert_eq!(
            said,
            "cluster 2: 40 rows of 10 episodes; height 1.50 ± 0.75; weather rain in 0.75 of its rows (0.50 of all)"
        );
        assert!(sentence(&summary, true, &kinds).contains("of 10 states and 0 distractors;"));
        let all = listed(&[summary], &kinds).expect("JSON");
        assert_eq!(all[0]["quantities"][1]["kind"], "rain");
        assert!(all[0]["quantities"][0].get("kind").is_none());
    }

    #[test]
    fn fewer_groups_than_asked_for_are_said() {
        assert_eq!(fewer(8, 8), None);
        assert!(fewer(12, 30).is_some_and(|said| said.contains("only 12") && said.contains("30 were asked for")));
    }

    #[test]
    fn a_grid_has_cells() {
        let of = |state, distractor| has_cells(&Latents { state, distractor, ..Latents::default() });
        assert!(of(vec![None, Some(1)], vec![None, Some(0)]));
        assert!(!of(vec![None, None], vec![None, None]) && !of(vec![], vec![]));
    }
}
