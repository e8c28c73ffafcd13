//! Everything that can go wrong below the command line, one variant per fact.

/// Why an analysis could not be made. Messages give the fact, then what would be right.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Two columns of one table disagree about the number of rows, or a row about the number of dimensions.
    #[error("{what}: {found} values, expected {expected}")]
    Length {
        /// Which column.
        what: &'static str,
        /// What the rest of the table has.
        expected: usize,
        /// What was given.
        found: usize,
    },
    /// A latent holds NaN or infinity.
    #[error("episode {episode}, step {step}: dimension {dim} of the latent is {value}, every value must be finite")]
    NotFinite {
        /// Row key.
        episode: u32,
        /// Row key.
        step: u32,
        /// Which dimension.
        dim: usize,
        /// The value found.
        value: f32,
    },
    /// A quantity to probe for holds NaN or infinity.
    #[error("{name} of episode {episode}, step {step} is {value}, every value must be finite")]
    QuantityNotFinite {
        /// Name of the quantity.
        name: String,
        /// Row key.
        episode: u32,
        /// Row key.
        step: u32,
        /// The value found.
        value: f64,
    },
    /// A return holds NaN or infinity.
    #[error("the return of episode {episode} is {value}, every return must be finite")]
    ReturnNotFinite {
        /// Which of the returns.
        episode: usize,
        /// The value found.
        value: f64,
    },
    /// No rows, or fewer than the computation needs.
    #[error("{what}: found {found}, at least {needed} needed")]
    TooFewRows {
        /// Which computation.
        what: &'static str,
        /// How many it needs.
        needed: usize,
        /// How many there are.
        found: usize,
    },
    /// A query has fewer admissible candidates than the neighbours asked for.
    #[error(
        "episode {episode}, step {step}: only {found} rows may be its neighbours ({excluded}), {needed} were asked for; \
         ask for fewer, or take more rows"
    )]
    TooFewNeighbours {
        /// The query's key.
        episode: u32,
        /// The query's key.
        step: u32,
        /// `k`.
        needed: usize,
        /// Rows left after the exclusion.
        found: usize,
        /// What was excluded, as in "the row itself does not count".
        excluded: &'static str,
    },
    /// Nothing that a state or a distractor could have brought.
    #[error(
        "all {cells} cells of the grid have the same latent at every step; the invariance split needs latents that differ between cells"
    )]
    AlikeAtEveryStep {
        /// Cells of the grid.
        cells: usize,
    },
    /// Every dimension holds one value: no distance can tell rows apart.
    #[error("all {rows} latents are the same point; {what} needs latents that vary")]
    Constant {
        /// Which computation.
        what: &'static str,
        /// Rows in the table.
        rows: usize,
    },
    /// The table says nothing about states and distractors.
    #[error("no row has a state and a distractor: this needs latents of a recording made with --grid")]
    NoGrid,
    /// No two rows show one state turned about the origin.
    #[error(
        "no two rows of other trajectories are rotations of each other within {tolerance} m; widen --tolerance, or re-render a rotation of the \
         recording with `vibes-collect render` and encode both"
    )]
    NoRotations {
        /// Most they may differ, metres.
        tolerance: f64,
    },
    /// A cell of the grid has no rows.
    #[error(
        "{missing} of {cells} cells of the grid have no rows, the first is state {state} under distractor {distractor}"
    )]
    GridHoles {
        /// The first missing cell.
        state: u32,
        /// The first missing cell.
        distractor: u32,
        /// How many are missing.
        missing: usize,
        /// How many there should be.
        cells: usize,
    },
    /// Two rows claim the same cell and step.
    #[error("state {state} under distractor {distractor} has step {step} twice: are these latents of two recordings?")]
    RepeatedStep {
        /// The cell.
        state: u32,
        /// The cell.
        distractor: u32,
        /// The step.
        step: u32,
    },
    /// A matrix decomposition did not succeed.
    #[error("{what}: {reason}")]
    Linear {
        /// Which computation.
        what: &'static str,
        /// What the solver said.
        reason: String,
    },
    /// A row index past the end of the table.
    #[error("row {row} does not exist, the table has {rows} rows")]
    NoSuchRow {
        /// The row asked for.
        row: usize,
        /// Rows in the table.
        rows: usize,
    },
    /// A name that is not on the list.
    #[error("unknown {what} {name:?}, choose one of: {choices}")]
    UnknownName {
        /// What kind of name.
        what: &'static str,
        /// The name given.
        name: String,
        /// The names there are.
        choices: String,
    },
    /// An option outside its range.
    #[error("{option} is {value}, it must be {must}")]
    Option {
        /// Name of the option.
        option: &'static str,
        /// The value given.
        value: String,
        /// The rule.
        must: &'static str,
    },
}
