//! Groups of latents, and what each holds: k-means and DBSCAN (linfa-clustering), on standardized latents.
//!
//! In: a [`Table`], a method, a random generator; then quantities of the same rows. Out: a label a row, numbered by size (0 is the largest), and for every cluster how
//! many rows it has and what is typical of it.

use linfa::DatasetBase;
use linfa::traits::{Fit, Predict, Transformer};
use linfa_clustering::{Dbscan, KMeans, KMeansInit};
use ndarray::{Array2, Axis};
use rand::Rng;
use rand::seq::index;
use serde::Serialize;

use crate::neighbours::{Metric, Space, nearest_to};
use crate::probes::{Quantity, Values};
use crate::{Error, Table};

/// How rows are grouped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// `k` clusters of rows around their means, the best of five starts (k-means++): every row belongs to one.
    KMeans {
        /// How many clusters.
        k: usize,
    },
    /// Rows that lie densely together; rows in thin places belong to none.
    Dbscan {
        /// Rows within reach that make a place dense.
        min_points: usize,
        /// How far is within reach, in standard deviations of the latents (standardized L2).
        reach: f64,
    },
}

/// Rows that clusters are found on at most; of a larger table this many are drawn, and the others belong where their nearest drawn row does, or with DBSCAN to none
/// where that one is out of reach.
const FITTED: usize = 10_000;

/// The cluster of every row, `[rows]`, the largest numbered 0; none for rows that belong to none. The same seed gives the same clusters.
///
/// # Errors
/// Options out of range, fewer rows than clusters, or latents that do not vary.
pub fn clusters(table: &Table<'_>, method: Method, rng: &mut impl Rng) -> Result<Vec<Option<u32>>, Error> {
    check(method, table.rows())?;
    let space = Space::new(*table, Metric::Standardized)?;
    let rows = table.rows();
    let mut drawn = if rows > FITTED { index::sample(rng, rows, FITTED).into_vec() } else { (0..rows).collect() };
    drawn.sort_unstable();
    let dims = table.dims();
    let points = Array2::from_shape_fn((drawn.len(), dims), |(at, dim)| f64::from(space.prepared(drawn[at])[dim]));
    let (labels, reach) = match method {
        Method::KMeans { k } => (k_means(points, k, rng)?, f64::INFINITY),
        Method::Dbscan { min_points, reach } => {
            // Of the rows that make a place dense, as many in proportion were drawn.
            let dense = (min_points as f64 * drawn.len() as f64 / rows as f64).round().max(2.0);
            // No place is denser than all that were drawn, and room is made for so many at once.
            (dbscan(&points, (dense as usize).min(drawn.len() + 1), reach)?, reach)
        }
    };
    let labels = if drawn.len() == rows { labels } else { spread(table, &drawn, &labels, reach)? };
    Ok(by_size(&labels))
}

fn check(method: Method, rows: usize) -> Result<(), Error> {
    let refuse = |option, value: String, must| Err(Error::Option { option, value, must });
    match method {
        Method::KMeans { k: 0 } => refuse("clusters", "0".to_owned(), "at least 1"),
        Method::KMeans { k } if k > rows => Err(Error::TooFewRows { what: "k-means", needed: k, found: rows }),
        Method::Dbscan { min_points, .. } if min_points < 2 => {
            refuse("min-points", min_points.to_string(), "at least 2")
        }
        Method::Dbscan { reach, .. } if !(reach > 0.0 && reach.is_finite()) => {
            refuse("reach", reach.to_string(), "above 0")
        }
        _ => Ok(()),
    }
}

fn k_means(points: Array2<f64>, k: usize, rng: &mut impl Rng) -> Result<Vec<Option<usize>>, Error> {
    const STARTS: usize = 5;
    let failed = |source: linfa_clustering::KMeansError| Error::Linear { what: "k-means", reason: source.to_string() };
    // linfa draws from a generator of its own; the starts are drawn here, so that the seed is ours.
    let starts: Vec<Array2<f64>> = (0..STARTS).map(|_| start(&points, k, rng)).collect();
    let data = DatasetBase::from(points);
    let (mut least, mut labels) = (f64::INFINITY, Vec::new());
    for start in starts {
        let params = KMeans::params(k).init_method(KMeansInit::Precomputed(start)).n_runs(1);
        let model = params.max_n_iterations(200).tolerance(1e-4).fit(&data).map_err(failed)?;
        if labels.is_empty() || model.inertia() < least {
            least = model.inertia();
            labels = model.predict(&data).iter().map(|&label| Some(label)).collect();
        }
    }
    Ok(labels)
}

/// First means by k-means++ (Arthur and Vassilvitskii, 2007): rows drawn one by one, in proportion to the squared distance from those drawn before.
fn start(points: &Array2<f64>, k: usize, rng: &mut impl Rng) -> Array2<f64> {
    let rows = points.nrows();
    let mut chosen = vec![rng.random_range(0..rows)];
    let mut squared = vec![f64::INFINITY; rows];
    while chosen.len() < k {
        let last = points.row(chosen[chosen.len() - 1]);
        for (squared, point) in squared.iter_mut().zip(points.outer_iter()) {
            *squared = squared.min((&point - &last).mapv(|x| x * x).sum());
        }
        let mut left = rng.random_range(0.0..1.0) * squared.iter().sum::<f64>();
        let passes = |&x: &f64| {
            left -= x;
            left < 0.0
        };
        chosen.push(squared.iter().position(passes).unwrap_or(rows - 1));
    }
    points.select(Axis(0), &chosen)
}

fn dbscan(points: &Array2<f64>, min_points: usize, reach: f64) -> Result<Vec<Option<usize>>, Error> {
    let found = Dbscan::params(min_points).tolerance(reach).transform(points);
    let failed =
        |source: linfa_clustering::DbscanParamsError| Error::Linear { what: "DBSCAN", reason: source.to_string() };
    Ok(found.map_err(failed)?.iter().copied().collect())
}

/// Every row's label from the nearest drawn one within reach.
fn spread(
    table: &Table<'_>,
    drawn: &[usize],
    labels: &[Option<usize>],
    reach: f64,
) -> Result<Vec<Option<usize>>, Error> {
    let values: Vec<f32> = drawn.iter().flat_map(|&row| table.row(row)).copied().collect();
    let keys: Vec<u32> = (0..drawn.len() as u32).collect();
    let some = Table::new(table.dims(), &values, &keys, &keys)?;
    let near = nearest_to(&Space::new(some, Metric::Standardized)?, table, 1)?;
    let is_near = |row: &usize| near.all_distances()[*row] <= reach;
    Ok((0..table.rows())
        .map(|row| Some(row).filter(is_near).and_then(|row| labels[near.rows(row)[0] as usize]))
        .collect())
}

/// Labels numbered by falling size, equals by their first row.
fn by_size(labels: &[Option<usize>]) -> Vec<Option<u32>> {
    let count = labels.iter().flatten().max().map_or(0, |&last| last + 1);
    let (mut sizes, mut first) = (vec![0_usize; count], vec![usize::MAX; count]);
    for (row, &label) in labels.iter().enumerate().filter_map(|(row, label)| Some((row, label.as_ref()?))) {
        sizes[label] += 1;
        first[label] = first[label].min(row);
    }
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| sizes[b].cmp(&sizes[a]).then(first[a].cmp(&first[b])));
    let mut place = vec![0; count];
    order.iter().enumerate().for_each(|(at, &label)| place[label] = at as u32);
    labels.iter().map(|label| label.map(|label| place[label])).collect()
}

/// What one cluster holds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClusterSummary {
    /// The cluster; none for the rows that belong to none.
    pub cluster: Option<u32>,
    /// Its rows.
    pub rows: usize,
    /// State trajectories that some row of it is from (episodes where there is no grid).
    pub states: usize,
    /// Distractor trajectories that some row of it is from.
    pub distractors: usize,
    /// What is typical of each quantity, in the quantities' order.
    pub quantities: Vec<Typical>,
}

/// What a quantity is like in a cluster.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Typical {
    /// Name of the quantity.
    pub quantity: String,
    /// Mean over the cluster's rows; of classes, the most frequent one.
    pub value: f64,
    /// Standard deviation over the cluster's rows; of classes, the share of the most frequent one.
    pub spread: f64,
    /// How far the cluster's mean is from that of all rows, in standard deviations over all rows; of classes, the share of the most frequent one in all rows.
    pub apart: f64,
}

/// A line for every cluster, in order, and one for the rows of none, if there are any.
///
/// # Errors
/// Labels or quantities of another length than the table.
pub fn cluster_table(
    table: &Table<'_>,
    labels: &[Option<u32>],
    quantities: &[Quantity],
) -> Result<Vec<ClusterSummary>, Error> {
    let rows = table.rows();
    let lengths = quantities.iter().map(|quantity| match &quantity.values {
        Values::Numbers(values) => values.len(),
        Values::Classes(classes) => classes.len(),
    });
    for found in lengths.chain([labels.len()]) {
        if found != rows {
            return Err(Error::Length { what: "cluster labels or quantities", expected: rows, found });
        }
    }
    let count = labels.iter().flatten().max().map_or(0, |&last| last + 1);
    let states = table.state_trajectories();
    let line = |cluster: Option<u32>| {
        let members: Vec<usize> = (0..rows).filter(|&row| labels[row] == cluster).collect();
        let distinct = |of: &dyn Fn(usize) -> Option<u32>| {
            let mut seen: Vec<u32> = members.iter().filter_map(|&row| of(row)).collect();
            seen.sort_unstable();
            seen.dedup();
            seen.len()
        };
        ClusterSummary {
            cluster,
            rows: members.len(),
            states: distinct(&|row| Some(states[row])),
            distractors: distinct(&|row| table.cell(row).map(|cell| cell.1)),
            quantities: quantities.iter().map(|quantity| typical(quantity, &members)).collect(),
        }
    };
    let clusters = (0..count).map(Some).chain([None]).map(line);
    Ok(clusters.filter(|summary| summary.rows > 0).collect())
}

fn typical(quantity: &Quantity, members: &[usize]) -> Typical {
    let (value, spread, apart) = match &quantity.values {
        Values::Numbers(values) => {
            let (mean, spread) = moments(members.iter().map(|&row| values[row]));
            let (whole, deviation) = moments(values.iter().copied());
            (mean, spread, if deviation > 0.0 { (mean - whole) / deviation } else { 0.0 })
        }
        Values::Classes(classes) => {
            let share = |class: u32, of: &mut dyn Iterator<Item = u32>| {
                let (hits, all) =
                    of.fold((0.0, 0.0), |(hits, all), x| (hits + f64::from(u8::from(x == class)), all + 1.0));
                if all > 0.0 { hits / all } else { 0.0 }
            };
            let mut names = classes.clone();
            names.sort_unstable();
            names.dedup();
            let in_cluster = |class: u32| share(class, &mut members.iter().map(|&row| classes[row]));
            let best = names.iter().fold((0, 0.0), |best, &class| {
                let found = in_cluster(class);
                if found > best.1 { (class, found) } else { best }
            });
            (f64::from(best.0), best.1, share(best.0, &mut classes.iter().copied()))
        }
    };
    Typical { quantity: quantity.name.clone(), value, spread, apart }
}

/// Mean and population standard deviation.
fn moments(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    (mean, (values.map(|x| (x - mean).powi(2)).sum::<f64>() / count).sqrt())
}

#[cfg(test)]
mod tests;
