//! The shapes of actions and observations, until `vibes-data` has them.

/// The task's own action bounds, one number per dimension.
#[derive(Clone, Debug, PartialEq)]
pub struct ActionSpec {
    /// Lower bounds `[action]`.
    pub min: Vec<f64>,
    /// Upper bounds `[action]`.
    pub max: Vec<f64>,
}

/// One named part of the vector observation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ObservationPart {
    /// The name in `dm_control`, as in `position`.
    pub name: String,
    /// How many numbers it has.
    pub len: usize,
}
