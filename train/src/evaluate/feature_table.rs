//! A table that is read: numbers of every row, under a name.

/// One table of features, `[rows, dims]`, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Features {
    /// `s` for the latents, `h` for the recurrent state before the row's action, `hs` for both.
    pub name: &'static str,
    /// Numbers a row.
    pub dims: usize,
    /// The values.
    pub values: Vec<f32>,
}
