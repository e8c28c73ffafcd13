//! The numbers of an evaluation under the names that every program prints: one list, so that the same latents give the same numbers wherever they are
//! measured. README.md of this package says what each name means.
//!
//! In: a grid of latents and the same grid of the action-only control; scores of probes. Out: [`Numbers`].

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::ser::{Serialize, SerializeMap, Serializer};

use crate::Error;
use crate::intervals::Interval;
use crate::invariance::{Grid, RetrievalOptions, denoising_factor, retrieval_any_step, retrieval_same_step, variance};
use crate::probes::{Fitting, Probe, ProbeScore};
use crate::spectrum::effective_rank;

/// A number, what it is without any latent, and what past actions alone give.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Number {
    /// Its name, as in `retrieval_same_step@1`.
    #[serde(skip)]
    pub name: String,
    /// The number and its 95% interval over state and distractor trajectories.
    #[serde(flatten)]
    pub value: Interval,
    /// Its value for latents that say nothing; NaN if there is none.
    pub chance: f64,
    /// The same number of the action-only control, if the actions are at hand.
    pub past_actions: Option<Interval>,
}

/// Numbers in the order they are printed in. As JSON an object with one entry a name.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Numbers(Vec<Number>);

impl Numbers {
    /// The number of that name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Number> {
        self.0.iter().find(|number| number.name == name)
    }

    /// All numbers, in order.
    pub fn iter(&self) -> std::slice::Iter<'_, Number> {
        self.0.iter()
    }

    /// Adds more.
    pub fn extend(&mut self, more: Self) {
        self.0.extend(more.0);
    }
}

impl FromIterator<Number> for Numbers {
    fn from_iter<I: IntoIterator<Item = Number>>(numbers: I) -> Self {
        Self(numbers.into_iter().collect())
    }
}

impl<'a> IntoIterator for &'a Numbers {
    type Item = &'a Number;
    type IntoIter = std::slice::Iter<'a, Number>;

    fn into_iter(self) -> Self::IntoIter {
        self.iter()
    }
}

impl Serialize for Numbers {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for number in &self.0 {
            map.serialize_entry(&number.name, number)?;
        }
        map.end()
    }
}

/// How to take the numbers of a grid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GridOptions {
    /// Neighbours looked at by the retrievals, one number each.
    pub k: Vec<usize>,
    /// `retrieval_any_step`: how far the step of a neighbour may be from the query's.
    pub tolerance: u32,
    /// `retrieval_any_step`: most rows to ask for.
    pub queries: usize,
    /// Seed of the queries that are drawn where not all are asked. Intervals draw nothing: trajectories are left out in turn. Every number begins with the seed anew, so that
    /// none depends on the others asked for.
    pub seed: u64,
}

impl Default for GridOptions {
    fn default() -> Self {
        let RetrievalOptions { tolerance, queries, .. } = RetrievalOptions::default();
        Self { k: vec![1, 5], tolerance, queries, seed: 0 }
    }
}

/// The numbers of a grid: `retrieval_same_step@k`, `retrieval_any_step@k`, `state_share`, `distractor_share`, `interaction_share`,
/// `within_state_share`, `denoising_factor` and `effective_rank`, each beside that of the action-only control (the same grid of features of past actions).
///
/// # Errors
/// Latents that do not vary, or a `k` that the grid has too few cells for.
pub fn grid_numbers(
    latents: &Grid<'_>,
    past_actions: Option<&Grid<'_>>,
    options: &GridOptions,
) -> Result<Numbers, Error> {
    let mut numbers = of_grid(latents, options)?;
    let control = match past_actions.map(|grid| of_grid(grid, options)) {
        // Actions that do not vary, or that all cells share, are no control.
        None | Some(Err(Error::Constant { .. } | Error::AlikeAtEveryStep { .. })) => None,
        Some(control) => Some(control?),
    };
    if let Some(control) = control {
        numbers.iter_mut().zip(control).for_each(|(number, control)| number.past_actions = Some(control.value));
    }
    Ok(Numbers(numbers))
}

fn of_grid(grid: &Grid<'_>, options: &GridOptions) -> Result<Vec<Number>, Error> {
    let rng = || ChaCha8Rng::seed_from_u64(options.seed);
    let number = |name: String, value, chance| Number { name, value, chance, past_actions: None };
    let mut numbers = Vec::new();
    // A grid of few cells has fewer others than some k: there is nothing to ask.
    for &k in options.k.iter().filter(|&&k| k < grid.states().len() * grid.distractors().len()) {
        let found = retrieval_same_step(grid, k, &mut rng())?;
        numbers.push(number(format!("retrieval_same_step@{k}"), found.found, found.chance));
    }
    // Those under other distractors than the row's own.
    let others = grid.states().len() * (grid.distractors().len() - 1) * grid.steps().len();
    for &k in options.k.iter().filter(|&&k| k <= others) {
        let asked = RetrievalOptions { k, tolerance: options.tolerance, queries: options.queries };
        let found = retrieval_any_step(grid, asked, &mut rng())?;
        numbers.push(number(format!("retrieval_any_step@{k}"), found.found, found.chance));
    }
    let split = variance(grid)?;
    let noise = split.of_noise;
    numbers.push(number("state_share".to_owned(), split.state, noise.state));
    numbers.push(number("distractor_share".to_owned(), split.distractor, noise.distractor));
    numbers.push(number("interaction_share".to_owned(), split.interaction, noise.interaction));
    numbers.push(number("within_state_share".to_owned(), split.within_state, noise.within_state));
    numbers.push(number("denoising_factor".to_owned(), denoising_factor(grid)?, 0.0));
    numbers.push(number("effective_rank".to_owned(), effective_rank(grid)?, f64::NAN));
    Ok(numbers)
}

/// What the names of a probe's scores begin with, by how it was fitted, as in `probe/QUANTITY/s`.
#[must_use]
pub fn probe_family(probe: Probe, fitting: Fitting) -> &'static str {
    match (probe, fitting) {
        (Probe::Linear, Fitting::OtherRecordings) => "probe",
        (Probe::Linear, Fitting::CrossValidation) => "probe_cross_validated",
        (Probe::Knn, Fitting::OtherRecordings) => "probe_knn",
        (Probe::Knn, Fitting::CrossValidation) => "probe_knn_cross_validated",
    }
}

/// Scores of probes by name: `FAMILY/QUANTITY/FEATURES` (see [`probe_family`]). `features` is what was read: `s` the latent, `h` the recurrent state, `hs`
/// both. `past_actions` are scores of the same quantities.
#[must_use]
pub fn probe_numbers(features: &str, scores: &[ProbeScore], past_actions: Option<&[ProbeScore]>) -> Numbers {
    let of = |score: &ProbeScore| {
        let same = |other: &&ProbeScore| other.quantity == score.quantity && other.probe == score.probe;
        Number {
            name: format!("{}/{}/{features}", probe_family(score.probe, score.fitting), score.quantity),
            value: score.score,
            chance: score.chance,
            past_actions: past_actions.and_then(|scores| scores.iter().find(same)).map(|score| score.score),
        }
    };
    scores.iter().map(of).collect()
}
