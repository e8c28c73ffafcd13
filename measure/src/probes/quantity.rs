//! What is to be read: numbers or classes, one per row, as columns of targets.

use rand::Rng;
use rand::seq::SliceRandom;
use serde::Serialize;

use crate::{Error, Table};

/// What must be held out together when a probe is fitted on the table it is judged on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum HoldOut {
    /// State trajectories of rows on a grid (the cells of a row share their states), episodes of others.
    #[default]
    State,
    /// Episodes.
    Episode,
    /// Distractor trajectories: whether a distractor's parameters can be read from one never seen.
    Distractor,
    /// As [`HoldOut::State`], of a quantity of which nobody knows whether it is the state's or a distractor's, such as a column of a user's: what is shuffled goes
    /// from cell to cell, because every cell would keep its own distractor's value if it were given another state's.
    StateOfUnknown,
}

impl HoldOut {
    /// What a quantity of the distractors asks: numbers of one never seen, or, of a class such as the video shown, whether it is known under other states.
    #[must_use]
    pub fn of_distractor(is_class: bool, on_grid: bool) -> Self {
        match (is_class, on_grid) {
            (true, _) => Self::State,
            (false, true) => Self::Distractor,
            (false, false) => Self::Episode,
        }
    }
}

/// A named quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct Quantity {
    /// For tables and charts.
    pub name: String,
    /// What is held out together.
    pub hold_out: HoldOut,
    /// One value per row.
    pub values: Values,
}

/// Its values.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Numbers, `[rows]`: scored by R².
    Numbers(Vec<f64>),
    /// Class names, `[rows]`: scored by accuracy.
    Classes(Vec<u32>),
}

impl Values {
    /// Those of classes, whose numbers are whole, or of anything else, as they are read row by row.
    #[must_use]
    pub fn of(is_class: bool, values: Vec<f64>) -> Self {
        if is_class {
            Self::Classes(values.into_iter().map(|class| class as u32).collect())
        } else {
            Self::Numbers(values)
        }
    }

    /// Whether they differ by more than rounding: what never changes cannot be read.
    #[must_use]
    pub fn vary(&self) -> bool {
        /// A range below this share of the largest value is none.
        const FLAT: f64 = 1e-9;
        match self {
            Self::Classes(classes) => classes.iter().any(|class| *class != classes[0]),
            Self::Numbers(values) => {
                let (low, high) =
                    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)));
                high - low > FLAT * high.abs().max(low.abs()).max(1e-300)
            }
        }
    }
}

/// All quantities side by side: a column per number, and one per class of a class quantity.
#[derive(Debug, Clone)]
pub(super) struct Targets {
    pub columns: usize,
    /// `[rows, columns]`.
    pub values: Vec<f64>,
    /// The columns of each quantity.
    pub spans: Vec<Span>,
}

/// Where a quantity stands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Span {
    pub first: usize,
    pub columns: usize,
    pub classes: bool,
}

impl Targets {
    pub(super) fn new(table: &Table<'_>, quantities: &[Quantity]) -> Result<Self, Error> {
        let rows = table.rows();
        let mut columns: Vec<Vec<f64>> = Vec::new();
        let mut spans = Vec::new();
        for quantity in quantities {
            let own = match &quantity.values {
                Values::Numbers(values) => vec![numbers(values, &quantity.name, table)?],
                Values::Classes(classes) => indicators(classes, rows)?,
            };
            let classes = matches!(quantity.values, Values::Classes(_));
            spans.push(Span { first: columns.len(), columns: own.len(), classes });
            columns.extend(own);
        }
        let values = (0..rows).flat_map(|row| columns.iter().map(move |column| column[row])).collect();
        Ok(Self { columns: columns.len(), values, spans })
    }

    pub(super) fn row(&self, row: usize) -> &[f64] {
        &self.values[row * self.columns..(row + 1) * self.columns]
    }

    /// The mean of every column of numbers, and 0 of those of classes.
    pub(super) fn means(&self) -> Vec<f64> {
        let mut means = vec![0.0; self.columns];
        let rows = (self.values.len() / self.columns.max(1)).max(1) as f64;
        for span in self.spans.iter().filter(|span| !span.classes) {
            let column = self.values.iter().skip(span.first).step_by(self.columns);
            means[span.first] = column.sum::<f64>() / rows;
        }
        means
    }

    /// The same less these means, so that sums of squares keep their digits however far from 0 a quantity lies.
    pub(super) fn less(mut self, means: &[f64]) -> Self {
        for row in self.values.chunks_exact_mut(self.columns.max(1)) {
            row.iter_mut().zip(means).for_each(|(value, mean)| *value -= mean);
        }
        self
    }

    /// The same with some quantities taken from other targets of the same shape.
    pub(super) fn with_from(mut self, other: &Self, is_taken: impl Fn(usize) -> bool) -> Self {
        for (_, span) in self.spans.iter().enumerate().filter(|(at, _)| is_taken(*at)) {
            for (row, theirs) in
                self.values.chunks_exact_mut(self.columns).zip(other.values.chunks_exact(other.columns))
            {
                row[span.first..span.first + span.columns]
                    .copy_from_slice(&theirs[span.first..span.first + span.columns]);
            }
        }
        self
    }

    /// Every group of rows given another's targets, in order: the quantities stay as smooth in time as they were.
    pub(super) fn shuffled(&self, groups: &[u32], count: usize, rng: &mut impl Rng) -> Self {
        let mut members = vec![Vec::new(); count];
        groups.iter().enumerate().for_each(|(row, &group)| members[group as usize].push(row));
        // A cycle, so that no group keeps its own.
        let mut order: Vec<usize> = (0..count).collect();
        order.shuffle(rng);
        let mut values = vec![0.0; self.values.len()];
        for (at, &group) in order.iter().enumerate() {
            let donor = &members[order[(at + 1) % count]];
            for (position, &row) in members[group].iter().enumerate() {
                let from = donor[position % donor.len()];
                values[row * self.columns..(row + 1) * self.columns].copy_from_slice(self.row(from));
            }
        }
        Self { columns: self.columns, values, spans: self.spans.clone() }
    }

    /// What the score of a quantity is called, and its value without any latent.
    pub(super) fn measure(&self, quantity: usize) -> (&'static str, f64) {
        let span = self.spans[quantity];
        if !span.classes {
            return ("R²", 0.0);
        }
        let rows = self.values.len() / self.columns;
        let share = |column: usize| (0..rows).map(|row| self.row(row)[span.first + column]).sum::<f64>() / rows as f64;
        ("accuracy", (0..span.columns).map(share).fold(0.0, f64::max))
    }
}

fn numbers(values: &[f64], name: &str, table: &Table<'_>) -> Result<Vec<f64>, Error> {
    if values.len() != table.rows() {
        return Err(Error::Length { what: "quantity", expected: table.rows(), found: values.len() });
    }
    match values.iter().position(|value| !value.is_finite()) {
        None => Ok(values.to_vec()),
        Some(row) => Err(Error::QuantityNotFinite {
            name: name.to_owned(),
            episode: table.episode()[row],
            step: table.step()[row],
            value: values[row],
        }),
    }
}

/// One column per class that occurs, in rising order.
fn indicators(classes: &[u32], rows: usize) -> Result<Vec<Vec<f64>>, Error> {
    if classes.len() != rows {
        return Err(Error::Length { what: "quantity", expected: rows, found: classes.len() });
    }
    let mut names = classes.to_vec();
    names.sort_unstable();
    names.dedup();
    Ok(names.iter().map(|name| classes.iter().map(|class| f64::from(u8::from(class == name))).collect()).collect())
}

/// Predictions of some rows, `[rows, columns]`.
pub(super) struct Predictions {
    pub rows: Vec<usize>,
    pub values: Vec<f64>,
}
