//! A map as the verbs draw it: places, quality, and what is said of how it was made.

use serde_json::Value;

use super::Method;

/// A map with its quality.
#[derive(Debug)]
pub(in super::super) struct MadeMap {
    pub(in super::super) positions: Vec<[f32; 2]>,
    /// The points of the old map that these were placed on; empty for a new map.
    pub(in super::super) backdrop: Vec<[f32; 2]>,
    /// `trustworthiness`, `kept` and over how many neighbours and rows; null for fewer rows than it takes.
    pub(in super::super) quality: Value,
    /// The way that it was made.
    pub(in super::super) method: Method,
    /// What the line of result says of how it was made: "", or ", neighbour graph used again".
    pub(in super::super) how: String,
}

impl MadeMap {
    /// The positions in double precision, for figures.
    pub(in super::super) fn points(&self) -> Vec<[f64; 2]> {
        doubled(&self.positions)
    }

    /// The old map's points in double precision, for figures.
    pub(in super::super) fn backdrop(&self) -> Vec<[f64; 2]> {
        doubled(&self.backdrop)
    }

    /// `trustworthiness 0.980, neighbours kept 0.610`, over how many rows where not over all, or that there are too few.
    pub(in super::super) fn quality_text(&self) -> String {
        let number = |name: &str| self.quality[name].as_f64();
        let over = match self.quality["rows"].as_u64() {
            Some(rows) if (rows as usize) < self.positions.len() => format!(" (over {rows} rows drawn)"),
            _ => String::new(),
        };
        match (number("trustworthiness"), number("kept")) {
            (Some(t), Some(kept)) => format!("trustworthiness {t:.3}, neighbours kept {kept:.3}{over}"),
            _ => "too few rows for a quality".into(),
        }
    }
}

fn doubled(positions: &[[f32; 2]]) -> Vec<[f64; 2]> {
    positions.iter().map(|p| [f64::from(p[0]), f64::from(p[1])]).collect()
}
