//! The measures of `vibes-measure` on arrays: one definition of every number, whoever asks.
//!
//! In: latents `[rows, dims]` with the key of every row. Out: dictionaries of numbers with their intervals, under the names that the programs print.

use std::collections::HashSet;

use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use vibes_measure::intervals::Interval;
use vibes_measure::invariance::{
    Grid, RetrievalOptions, denoising_factor, retrieval_any_step, retrieval_same_step, variance,
};
use vibes_measure::neighbours::{Exclude, Metric, Space, nearest};
use vibes_measure::numbers::{GridOptions, Number, Numbers, grid_numbers};
use vibes_measure::past_actions::{past_action_dims, past_action_features};
use vibes_measure::probes::{Fit, HoldOut, ProbeOptions, Quantity, Sample, Values, probe};
use vibes_measure::quality::{QualityOptions, quality};
use vibes_measure::spectrum::spectrum;
use vibes_measure::symmetry::{ReacherState, SymmetryOptions, matches, rotated_pairs, symmetry};
use vibes_measure::umap::{UmapOptions, umap};

use crate::arrays::{owned, shaped};
use crate::error::{affordable, refused, unlocked, unlocked_here};

/// Latents with the key of every row, owned: whatever Python does to its arrays meanwhile changes nothing.
#[pyclass(frozen, module = "vibes._vibes")]
#[derive(Debug)]
pub(crate) struct Table {
    dims: usize,
    values: Vec<f32>,
    episode: Vec<u32>,
    step: Vec<u32>,
    grid: Option<Cells>,
}

/// The state and the distractor trajectory of every row, none where it lies on no grid.
type Cells = [Vec<Option<u32>>; 2];

/// The same as they come from Python: -1 where a row has none.
type GivenCells<'py> = (PyReadonlyArray1<'py, i64>, PyReadonlyArray1<'py, i64>);

impl Table {
    fn table(&self) -> Result<vibes_measure::Table<'_>, vibes_measure::Error> {
        self.table_on(None)
    }

    /// The table with these cells in place of its own, where some are given.
    fn table_on<'a>(&'a self, cells: Option<&'a Cells>) -> Result<vibes_measure::Table<'a>, vibes_measure::Error> {
        let table = vibes_measure::Table::new(self.dims, &self.values, &self.episode, &self.step)?;
        match cells.or(self.grid.as_ref()) {
            None => Ok(table),
            Some([state, distractor]) => table.with_grid(state, distractor),
        }
    }

    /// That every row's key is another: two recordings poured into one table would otherwise give a wrong number silently. As `vibes-analyze` has it.
    fn check_keys(&self) -> Result<(), String> {
        let mut seen = HashSet::with_capacity(self.episode.len());
        match self.episode.iter().zip(&self.step).find(|&key| !seen.insert(key)) {
            None => Ok(()),
            Some((episode, step)) => Err(format!(
                "episode {episode}, step {step} occurs twice; right is one row for each (number the episodes of mixed recordings anew)"
            )),
        }
    }

    fn grid(&self) -> Result<Grid<'_>, vibes_measure::Error> {
        Grid::of_complete_part(self.table()?)
    }

    /// The state trajectory of every row.
    fn states(&self) -> PyResult<Vec<u32>> {
        let states = self.grid.as_ref().and_then(|[state, _]| state.iter().copied().collect());
        let right = "give state and distractor, or exclude trajectory or row";
        states.ok_or_else(|| refused(format!("exclude state of rows that lie on no grid; {right}")))
    }
}

type Done<T> = Result<T, vibes_measure::Error>;

/// A result as plain dictionaries, lists and numbers.
fn plain<'py>(py: Python<'py>, result: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    Ok(pythonize::pythonize(py, result)?)
}

/// A number as the programs print it: name, estimate, interval, and what latents that say nothing would give.
fn number(name: impl Into<String>, value: Interval, chance: f64) -> Number {
    Number { name: name.into(), value, chance, past_actions: None }
}

/// Numbers under their names, and one thing more that belongs to them.
fn beside<'py>(
    py: Python<'py>,
    numbers: impl IntoIterator<Item = Number>,
    (name, more): (&str, &impl Serialize),
) -> PyResult<Bound<'py, PyAny>> {
    let out = plain(py, &numbers.into_iter().collect::<Numbers>())?;
    out.set_item(name, plain(py, more)?)?;
    Ok(out)
}

fn metric(name: &str) -> PyResult<Metric> {
    name.parse().map_err(refused)
}

fn cells((state, distractor): &GivenCells<'_>) -> Cells {
    [state, distractor].map(|column| owned(column).iter().map(|&number| u32::try_from(number).ok()).collect())
}

#[pymethods]
impl Table {
    #[new]
    fn new(
        py: Python<'_>,
        latents: PyReadonlyArray2<'_, f32>,
        episode: PyReadonlyArray1<'_, u32>,
        step: PyReadonlyArray1<'_, u32>,
        grid: Option<GivenCells<'_>>,
    ) -> PyResult<Self> {
        let table = Self {
            dims: latents.shape()[1],
            values: owned(&latents),
            episode: owned(&episode),
            step: owned(&step),
            grid: grid.as_ref().map(cells),
        };
        if u32::try_from(table.values.len() / table.dims.max(1)).is_err() {
            return Err(refused("a table of more than 2**32 rows"));
        }
        unlocked_here(py, || table.table().map(drop))?;
        unlocked_here(py, || table.check_keys())?;
        Ok(table)
    }

    /// All numbers of a grid under their names.
    fn grid_numbers<'py>(
        &self,
        py: Python<'py>,
        past_actions: Option<&Self>,
        k: Vec<usize>,
        tolerance: u32,
        queries: usize,
        seed: u64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let options = GridOptions { k, tolerance, queries, seed };
        let numbers = unlocked(py, || -> Done<_> {
            let control = past_actions.map(Self::grid).transpose()?;
            grid_numbers(&self.grid()?, control.as_ref(), &options)
        })?;
        plain(py, &numbers)
    }

    fn variance_shares<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let split = unlocked(py, || variance(&self.grid()?))?;
        let noise = split.of_noise;
        let shares = [
            number("state_share", split.state, noise.state),
            number("distractor_share", split.distractor, noise.distractor),
            number("interaction_share", split.interaction, noise.interaction),
            number("within_state_share", split.within_state, noise.within_state),
        ];
        beside(py, shares, ("by_step", &split.by_step))
    }

    fn denoising_factor<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        plain(py, &unlocked(py, || denoising_factor(&self.grid()?))?)
    }

    fn retrieval<'py>(
        &self,
        py: Python<'py>,
        same_step: bool,
        k: usize,
        tolerance: u32,
        queries: usize,
        seed: u64,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.can_have(k)?;
        let found = unlocked(py, || -> Done<_> {
            let (grid, mut rng) = (self.grid()?, ChaCha8Rng::seed_from_u64(seed));
            if same_step {
                retrieval_same_step(&grid, k, &mut rng)
            } else {
                retrieval_any_step(&grid, RetrievalOptions { k, tolerance, queries }, &mut rng)
            }
        })?;
        let name = if same_step { "retrieval_same_step" } else { "retrieval_any_step" };
        beside(py, [number(format!("{name}@{k}"), found.found, found.chance)], ("queries", &found.queries))
    }

    /// Rows and distances of the nearest, `[queries, k]` each.
    fn neighbours<'py>(
        &self,
        py: Python<'py>,
        queries: PyReadonlyArray1<'py, i64>,
        k: usize,
        exclude: &str,
        metric_name: &str,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        self.can_have(k)?;
        let metric = metric(metric_name)?;
        let states = if exclude == "state" { self.states()? } else { Vec::new() };
        let exclude = match exclude {
            "trajectory" => Exclude::Trajectory,
            "state" => Exclude::Group(&states),
            "row" => Exclude::Itself,
            other => {
                return Err(refused(format!("unknown exclusion {other:?}, choose one of: trajectory, state, row")));
            }
        };
        let rows = self.episode.len();
        let asked: Option<Vec<usize>> =
            owned(&queries).iter().map(|&row| usize::try_from(row).ok().filter(|&row| row < rows)).collect();
        let asked = asked.ok_or_else(|| refused(format!("a query past the table; it has {rows} rows")))?;
        affordable("neighbours [queries, k, bytes]", &[asked.len().max(1), k, 16])?;
        let found = unlocked(py, || nearest(&Space::new(self.table()?, metric)?, &asked, k, exclude))?;
        let shape = [asked.len(), k];
        let near: Vec<i64> = found.all_rows().iter().map(|&row| i64::from(row)).collect();
        Ok((shaped(py, near, &shape)?.into_any(), shaped(py, found.all_distances().to_vec(), &shape)?.into_any()))
    }

    /// Scores of each quantity by both probes. `views` are cells in place of the table's own, for rows of which some are views of one state trajectory.
    #[pyo3(signature = (quantities, views, fit, folds, neighbours, seed))]
    fn probes<'py>(
        &self,
        py: Python<'py>,
        quantities: &Bound<'py, PyDict>,
        views: Option<GivenCells<'py>>,
        fit: Option<(Py<Self>, Bound<'py, PyDict>, Option<GivenCells<'py>>)>,
        folds: usize,
        neighbours: usize,
        seed: u64,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.can_have(neighbours)?;
        let (judged, views) = (quantities_of(quantities)?, views.as_ref().map(cells));
        let fitted = match &fit {
            None => None,
            Some((table, quantities, views)) => {
                Some((table.get(), quantities_of(quantities)?, views.as_ref().map(cells)))
            }
        };
        let options = ProbeOptions { folds, neighbours, ..ProbeOptions::default() };
        let scores = unlocked(py, || -> Done<_> {
            let sample = Sample { table: self.table_on(views.as_ref())?, quantities: &judged };
            let fit = match &fitted {
                None => Fit::HeldOut,
                Some((table, quantities, views)) => {
                    Fit::On(Sample { table: table.table_on(views.as_ref())?, quantities })
                }
            };
            probe(sample, fit, options, &mut ChaCha8Rng::seed_from_u64(seed))
        })?;
        plain(py, &scores)
    }

    /// A map, `[rows, 2]`, and its quality.
    fn umap<'py>(
        &self,
        py: Python<'py>,
        neighbours: Option<usize>,
        min_dist: f64,
        spread: f64,
        epochs: Option<usize>,
        metric_name: &str,
        seed: u64,
    ) -> PyResult<Bound<'py, PyDict>> {
        neighbours.map_or(Ok(()), |neighbours| self.can_have(neighbours))?;
        let metric = metric(metric_name)?;
        let options = UmapOptions { neighbours, min_dist, spread, epochs, ..UmapOptions::default() };
        let (positions, quality) = unlocked(py, || -> Done<_> {
            let space = Space::new(self.table()?, metric)?;
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let positions = umap(&space, options, &mut rng)?;
            // Trustworthiness asks for more than 2 k rows.
            let k = QualityOptions::default().k.min((self.episode.len().saturating_sub(1)) / 2);
            let quality = if k == 0 {
                None
            } else {
                Some(quality(&space, &positions, QualityOptions { k, ..QualityOptions::default() }, &mut rng)?)
            };
            Ok((positions, quality))
        })?;
        let out = PyDict::new(py);
        let flat: Vec<f32> = positions.iter().flatten().copied().collect();
        out.set_item("positions", shaped(py, flat, &[positions.len(), 2])?)?;
        out.set_item("trustworthiness", quality.map(|quality| quality.trustworthiness))?;
        out.set_item("kept", quality.map(|quality| quality.kept))?;
        Ok(out)
    }

    /// Reacher's rotations; `joints` and `targets` `[rows, 2]`, `images` `[rows, numbers]`.
    fn symmetry<'py>(
        &self,
        py: Python<'py>,
        joints: PyReadonlyArray2<'py, f64>,
        targets: PyReadonlyArray2<'py, f64>,
        images: PyReadonlyArray2<'py, f32>,
        tolerance: f64,
        pairs: usize,
        seed: u64,
    ) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.episode.len();
        if joints.shape() != [rows, 2] || targets.shape() != [rows, 2] || images.shape()[0] != rows {
            return Err(refused(format!(
                "joints and targets are [{rows}, 2] and images [{rows}, numbers] for this table"
            )));
        }
        let pair = |array: &PyReadonlyArray2<'_, f64>, row: usize| {
            let array = array.as_array();
            [array[[row, 0]], array[[row, 1]]]
        };
        let state = |row| ReacherState { joints: pair(&joints, row), target: pair(&targets, row) };
        let states: Vec<ReacherState> = (0..rows).map(state).collect();
        let width = images.shape()[1];
        let pictures = owned(&images);
        let options = SymmetryOptions { tolerance, pairs, ..SymmetryOptions::default() };
        let found = unlocked(py, || -> Done<_> {
            let (table, mut rng) = (self.table()?, ChaCha8Rng::seed_from_u64(seed));
            let picture = |row: usize| &pictures[row * width..(row + 1) * width];
            let apart = |a: usize, b: usize| {
                let squares = picture(a).iter().zip(picture(b)).map(|(a, b)| f64::from(a - b).powi(2));
                squares.sum::<f64>().sqrt()
            };
            let pairs = rotated_pairs(&table, &states, options, &mut rng)?;
            let matches = matches(&table, &states, &pairs, apart, options, &mut rng)?;
            symmetry(&table, &matches, options)
        })?;
        let numbers = [
            number("symmetry_ratio", found.ratio, 1.0),
            number("symmetry_percentile", found.percentile, 0.5),
            number("symmetry_percentile_equal_distance", found.percentile_equal_distance, 0.5),
        ];
        beside(py, numbers, ("pairs", &found.pairs))
    }

    /// How many dimensions the cloud of all rows fills; that of `grid_numbers` is of the grid's complete part, and has an interval.
    fn effective_rank<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let found = unlocked(py, || spectrum(&self.values, self.dims))?;
        let out = PyDict::new(py);
        out.set_item("effective_rank", found.effective_rank)?;
        out.set_item("variance", found.variance)?;
        Ok(out)
    }
}

impl Table {
    /// More neighbours than rows are an error of every measure, but some would first make room for them.
    fn can_have(&self, k: usize) -> PyResult<()> {
        let rows = self.episode.len();
        if k == 0 || k > rows {
            return Err(refused(format!(
                "{k} neighbours in a table of {rows} rows; at least 1, and no more than the rows"
            )));
        }
        Ok(())
    }
}

/// Quantities by name: (values `[rows]`, whether they are classes, what is held out together).
fn quantities_of(quantities: &Bound<'_, PyDict>) -> PyResult<Vec<Quantity>> {
    let read = |(name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| -> PyResult<Quantity> {
        let (values, is_class, hold_out): (PyReadonlyArray1<'_, f64>, bool, String) = value.extract()?;
        let numbers = owned(&values);
        let hold_out = match hold_out.as_str() {
            // As `vibes-analyze probe --target` has a column of a user's, which may be the state's or a distractor's.
            "state" => HoldOut::StateOfUnknown,
            "episode" => HoldOut::Episode,
            "distractor" => HoldOut::Distractor,
            other => {
                return Err(refused(format!("unknown hold-out {other:?}, choose one of: state, episode, distractor")));
            }
        };
        Ok(Quantity { name: name.extract()?, values: Values::of(is_class, numbers), hold_out })
    };
    quantities.iter().map(read).collect()
}

/// Features of the actions before each row of an episode, `[T + 1, features]`, from its actions `[T, action]`.
#[pyfunction]
pub(crate) fn past_actions<'py>(py: Python<'py>, actions: PyReadonlyArray2<'py, f32>) -> PyResult<Bound<'py, PyAny>> {
    let (steps, axes) = (actions.shape()[0], actions.shape()[1]);
    if axes == 0 {
        return Err(refused("actions of no numbers; an action has at least one"));
    }
    let values = owned(&actions);
    let features = unlocked_here(py, || Done::Ok(past_action_features(&values, axes)))?;
    Ok(shaped(py, features, &[steps + 1, past_action_dims(axes)])?.into_any())
}
