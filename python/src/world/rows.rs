//! Rows of all environments of a world, as they cross to Python.

/// A row of each environment, one after the other.
#[derive(Debug, Default)]
pub(super) struct Rows {
    /// `[environments, size, size, 3]`, empty where nothing was drawn.
    pub pixels: Vec<u8>,
    /// `[environments, observation]`.
    pub observations: Vec<f32>,
    /// `[environments]`, 0 where an episode began.
    pub rewards: Vec<f64>,
    /// `[environments]`, whether this row ends its episode.
    pub is_last: Vec<bool>,
}

impl Rows {
    pub(super) fn append(&mut self, mut more: Self) {
        if self.rewards.is_empty() {
            *self = more;
            return;
        }
        self.pixels.append(&mut more.pixels);
        self.observations.append(&mut more.observations);
        self.rewards.append(&mut more.rewards);
        self.is_last.append(&mut more.is_last);
    }
}
