//! A table seen through a metric: the scale of each dimension, and single-precision points ready for matrix products.

use std::str::FromStr;

use rayon::prelude::*;

use crate::{Error, Table};

/// How far apart two latents are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Metric {
    /// Euclidean distance after each dimension is divided by its standard deviation over the table (population, no
    /// degrees of freedom taken off): the paper's measure for Figures 4b and 5. Constant dimensions tell rows apart
    /// by nothing and are left out.
    #[default]
    Standardized,
    /// Euclidean distance.
    Euclidean,
    /// One minus the cosine of the angle between two latents; a latent of length zero is at distance 1 from all.
    Cosine,
}

impl Metric {
    const NAMES: [(&'static str, Self); 3] =
        [("standardized", Self::Standardized), ("euclidean", Self::Euclidean), ("cosine", Self::Cosine)];

    /// The name used in options and outputs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Standardized => "standardized",
            Self::Euclidean => "euclidean",
            Self::Cosine => "cosine",
        }
    }
}

impl FromStr for Metric {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        Self::NAMES.iter().find(|(known, _)| *known == name).map(|&(_, metric)| metric).ok_or_else(|| {
            let choices = Self::NAMES.map(|(known, _)| known).join(", ");
            Error::UnknownName { what: "metric", name: name.to_owned(), choices }
        })
    }
}

/// A table and a metric. Squared Euclidean distance between its prepared points orders rows as the metric does, up to
/// the rounding of single precision.
#[derive(Debug)]
pub struct Space<'a> {
    table: Table<'a>,
    metric: Metric,
    /// Subtracted from each dimension before rounding to single precision, so that a far-off mean costs no digits.
    centre: Vec<f64>,
    /// What each dimension is multiplied by; 0 for a dimension left out.
    scale: Vec<f64>,
    /// What the points are multiplied by as well, so that their squares stay within single precision.
    unit: f64,
    constant: Vec<usize>,
    /// `[rows, dims]`.
    points: Vec<f32>,
}

impl<'a> Space<'a> {
    /// Measure the table's dimensions and prepare its points.
    ///
    /// # Errors
    /// Every dimension is constant.
    pub fn new(table: Table<'a>, metric: Metric) -> Result<Self, Error> {
        let (mean, deviation) = moments(&table);
        let constant: Vec<usize> = (0..table.dims()).filter(|&dim| deviation[dim] == 0.0).collect();
        if constant.len() == table.dims() && table.rows() > 1 {
            return Err(Error::Constant { what: "a neighbour search", rows: table.rows() });
        }
        let inverse = |&sd: &f64| if sd == 0.0 { 0.0 } else { 1.0 / sd };
        let (centre, scale) = match metric {
            Metric::Standardized => (mean, deviation.iter().map(inverse).collect()),
            Metric::Euclidean => (mean, vec![1.0; table.dims()]),
            Metric::Cosine => (vec![0.0; table.dims()], vec![1.0; table.dims()]),
        };
        let widest = deviation.iter().fold(0.0_f64, |widest, &sd| widest.max(sd));
        let unit = if metric == Metric::Euclidean { inverse(&widest) } else { 1.0 };
        let mut space = Self { table, metric, centre, scale, unit, constant, points: Vec::new() };
        let mut points = vec![0.0; table.values().len()];
        points.par_chunks_mut(table.dims()).enumerate().for_each(|(row, point)| space.fill(table.row(row), point));
        space.points = points;
        Ok(space)
    }

    /// The table.
    #[must_use]
    pub fn table(&self) -> &Table<'a> {
        &self.table
    }

    /// The metric.
    #[must_use]
    pub fn metric(&self) -> Metric {
        self.metric
    }

    /// Dimensions that hold one value over the whole table; the standardized metric leaves them out.
    #[must_use]
    pub fn constant_dims(&self) -> &[usize] {
        &self.constant
    }

    /// The distance between two rows, in double precision.
    #[must_use]
    pub fn distance(&self, a: usize, b: usize) -> f64 {
        self.distance_between(self.table.row(a), self.table.row(b))
    }

    /// The distance between any two latents `[dims]`, in double precision, with this table's scale.
    #[must_use]
    pub fn distance_between(&self, a: &[f32], b: &[f32]) -> f64 {
        let pairs = a.iter().zip(b).map(|(&a, &b)| (f64::from(a), f64::from(b)));
        if self.metric == Metric::Cosine {
            let (dot, aa, bb) =
                pairs.fold((0.0, 0.0, 0.0), |(dot, aa, bb), (a, b)| (dot + a * b, aa + a * a, bb + b * b));
            let norms = f64::sqrt(aa) * f64::sqrt(bb);
            return if norms > 0.0 { (1.0 - dot / norms).max(0.0) } else { 1.0 };
        }
        pairs.zip(&self.scale).map(|((a, b), scale)| ((a - b) * scale).powi(2)).sum::<f64>().sqrt()
    }

    /// A squared distance between two prepared rows, in single precision and without cancellation: for ranks.
    pub fn squared_prepared(&self, a: usize, b: usize) -> f32 {
        const LANES: usize = 8;
        let (first, second) = (a, b);
        let (a, b) = (self.prepared(a), self.prepared(b));
        if self.metric == Metric::Cosine && (is_zero(a) || is_zero(b)) {
            return if first == second { 0.0 } else { 2.0 };
        }
        let mut lanes = [0.0_f32; LANES];
        let (runs_a, runs_b) = (a.chunks_exact(LANES), b.chunks_exact(LANES));
        let rest = runs_a.remainder().iter().zip(runs_b.remainder()).map(|(a, b)| (a - b) * (a - b)).sum::<f32>();
        for (a, b) in runs_a.zip(runs_b) {
            for lane in 0..LANES {
                lanes[lane] += (a[lane] - b[lane]) * (a[lane] - b[lane]);
            }
        }
        lanes.iter().sum::<f32>() + rest
    }

    /// All prepared points, `[rows, dims]`.
    pub(super) fn points(&self) -> &[f32] {
        &self.points
    }

    /// The squared length of every prepared point, `[rows]`. Under cosine a latent of length zero counts as one of length 1: it is at distance 1 from every other latent, as those
    /// at right angles are.
    pub(super) fn squared_lengths(&self) -> Vec<f32> {
        let squared = |point: &[f32]| match point.iter().map(|x| x * x).sum::<f32>() {
            0.0 if self.metric == Metric::Cosine => 1.0,
            squared => squared,
        };
        self.points.par_chunks(self.table.dims()).map(squared).collect()
    }

    /// One row's prepared point.
    pub(crate) fn prepared(&self, row: usize) -> &[f32] {
        let dims = self.table.dims();
        &self.points[row * dims..(row + 1) * dims]
    }

    /// The prepared point of any latent.
    pub(super) fn prepare(&self, latent: &[f32]) -> Vec<f32> {
        let mut point = vec![0.0; latent.len()];
        self.fill(latent, &mut point);
        point
    }

    fn fill(&self, latent: &[f32], point: &mut [f32]) {
        let length = match self.metric {
            Metric::Cosine => latent.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt(),
            _ => 1.0,
        };
        let shrink = if length > 0.0 { self.unit / length } else { 0.0 };
        let dims = self.centre.iter().zip(&self.scale);
        for ((point, &x), (centre, scale)) in point.iter_mut().zip(latent).zip(dims) {
            *point = ((f64::from(x) - centre) * scale * shrink) as f32;
        }
    }
}

fn is_zero(point: &[f32]) -> bool {
    point.iter().all(|&x| x == 0.0)
}

/// Mean and population standard deviation of each dimension, `[dims]` each; exactly 0 where every row is equal.
///
/// Sums over blocks of fixed size, added in order: the same whatever the number of threads.
fn moments(table: &Table<'_>) -> (Vec<f64>, Vec<f64>) {
    const BLOCK: usize = 4096;
    let (dims, rows) = (table.dims(), table.rows() as f64);
    let blocks = |term: &(dyn Fn(usize, f32) -> f64 + Sync)| {
        let partial: Vec<Vec<f64>> = table
            .values()
            .par_chunks(BLOCK * dims)
            .map(|block| {
                let mut sums = vec![0.0; dims];
                for latent in block.chunks_exact(dims) {
                    for (dim, (sum, &x)) in sums.iter_mut().zip(latent).enumerate() {
                        *sum += term(dim, x);
                    }
                }
                sums
            })
            .collect();
        let add = |mut total: Vec<f64>, block: &Vec<f64>| {
            total.iter_mut().zip(block).for_each(|(total, sum)| *total += sum);
            total
        };
        partial.iter().fold(vec![0.0; dims], add)
    };
    let mean: Vec<f64> = blocks(&|_, x| f64::from(x)).iter().map(|sum| sum / rows).collect();
    let first = table.row(0);
    let varies = blocks(&|dim, x| f64::from(u8::from(x != first[dim])));
    let squares = blocks(&|dim, x| (f64::from(x) - mean[dim]).powi(2));
    // Rounding of the mean would leave a constant dimension a deviation just above zero, and then blow it up.
    let deviation =
        squares.iter().zip(varies).map(|(sum, varies)| if varies > 0.0 { (sum / rows).sqrt() } else { 0.0 }).collect();
    (mean, deviation)
}
