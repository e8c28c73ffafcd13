//! What a task says to the planner: how far and how hard to look ahead.

/// How far and how hard the planner looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannerSettings {
    /// Agent steps a plan covers.
    pub horizon: usize,
    /// Knots of a variation, evenly spaced over the horizon; at least 2.
    pub knots: usize,
    /// Plans tried at every agent step, the kept ones among them.
    pub samples: usize,
    /// Plans kept for the next agent step.
    pub kept: usize,
    /// Share of the samples that vary no plan but the middle of the action bounds, so that no habit lasts for ever.
    pub fresh: f64,
    /// Standard deviation of the widest variation, as a share of half the action range; well above 1, most actions are at a bound.
    pub widest: f64,
}

impl PlannerSettings {
    /// Settings that were found to work for `walker-walk`, and that a task takes as long as nothing better is known for it.
    pub const DEFAULT: Self = Self { horizon: 16, knots: 5, samples: 24, kept: 1, fresh: 0.1, widest: 1.0 };
}
