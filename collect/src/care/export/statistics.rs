//! The statistics that LeRobot keeps of every feature, an episode at a time and over all: lowest, highest, mean, standard deviation, count and five
//! quantiles (lerobot `compute_stats.py`). Over all episodes, as there, quantiles are the mean of the episodes' weighted by their rows.

use serde_json::{Value, json};

/// The quantiles, and the names they are stored under.
pub(super) const QUANTILES: [(&str, f64); 5] = [("q01", 0.01), ("q10", 0.1), ("q50", 0.5), ("q90", 0.9), ("q99", 0.99)];

/// The statistics of a feature of some dimensions.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Statistics {
    pub(super) min: Vec<f64>,
    pub(super) max: Vec<f64>,
    pub(super) mean: Vec<f64>,
    pub(super) std: Vec<f64>,
    pub(super) quantiles: [Vec<f64>; 5],
    pub(super) count: u64,
}

impl Statistics {
    /// Of a table `[rows, dims]` with at least one row.
    pub(super) fn of(values: &[f64], dims: usize) -> Self {
        let mut found = Self { count: (values.len() / dims.max(1)) as u64, ..Self::default() };
        for dim in 0..dims {
            let mut column: Vec<f64> = values.iter().skip(dim).step_by(dims).copied().collect();
            column.sort_by(f64::total_cmp);
            found.push(&column);
        }
        found
    }

    /// Appends a dimension, its values sorted.
    fn push(&mut self, sorted: &[f64]) {
        let count = sorted.len().max(1) as f64;
        let mean = sorted.iter().sum::<f64>() / count;
        self.min.push(sorted.first().copied().unwrap_or(0.0));
        self.max.push(sorted.last().copied().unwrap_or(0.0));
        self.mean.push(mean);
        self.std.push((sorted.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt());
        for (place, (_, share)) in QUANTILES.iter().enumerate() {
            self.quantiles[place].push(quantile(sorted, *share));
        }
    }

    /// Of the channels of RGB pictures one after another, in `0..=1`; the count is of pictures.
    pub(super) fn of_pictures(pixels: &[u8], bytes_a_picture: usize) -> Self {
        let mut found = Self { count: (pixels.len() / bytes_a_picture.max(1)) as u64, ..Self::default() };
        for channel in 0..3 {
            let mut counts = [0_u64; 256];
            for &byte in pixels.iter().skip(channel).step_by(3) {
                counts[usize::from(byte)] += 1;
            }
            found.push_counts(&counts);
        }
        found
    }

    fn push_counts(&mut self, counts: &[u64; 256]) {
        let total = counts.iter().sum::<u64>().max(1);
        let values = || counts.iter().enumerate().map(|(value, &count)| (value as f64 / 255.0, count as f64));
        let seen = |count: &&u64| **count > 0;
        let place = |place: Option<usize>| place.unwrap_or(0) as f64 / 255.0;
        let mean = values().map(|(value, count)| value * count).sum::<f64>() / total as f64;
        self.min.push(place(counts.iter().position(|count| seen(&count))));
        self.max.push(place(counts.iter().rposition(|count| seen(&count))));
        self.mean.push(mean);
        let squares = values().map(|(value, count)| (value - mean).powi(2) * count).sum::<f64>();
        self.std.push((squares / total as f64).sqrt());
        for (number, (_, share)) in QUANTILES.iter().enumerate() {
            let wanted = (share * (total - 1) as f64).round() as u64;
            let mut below = 0;
            let found = counts.iter().position(|count| {
                below += count;
                below > wanted
            });
            self.quantiles[number].push(place(found));
        }
    }

    /// Of all rows of both.
    pub(super) fn and(&self, other: &Self) -> Self {
        if self.count == 0 {
            return other.clone();
        }
        let count = self.count + other.count;
        let share = other.count as f64 / count as f64;
        let each = |a: &[f64], b: &[f64], join: &dyn Fn(f64, f64) -> f64| -> Vec<f64> {
            a.iter().zip(b).map(|(&a, &b)| join(a, b)).collect()
        };
        let weighted = |a: f64, b: f64| a + share * (b - a);
        let mean = each(&self.mean, &other.mean, &weighted);
        let spread = (0..mean.len()).map(|i| {
            let part = |of: &Self| of.std[i].powi(2) + (of.mean[i] - mean[i]).powi(2);
            weighted(part(self), part(other)).sqrt()
        });
        Self {
            min: each(&self.min, &other.min, &f64::min),
            max: each(&self.max, &other.max, &f64::max),
            std: spread.collect(),
            quantiles: std::array::from_fn(|i| each(&self.quantiles[i], &other.quantiles[i], &weighted)),
            mean,
            count,
        }
    }

    /// Every statistic with its name, but the count.
    pub(super) fn named(&self) -> impl Iterator<Item = (&'static str, &[f64])> {
        let plain = [("min", &self.min), ("max", &self.max), ("mean", &self.mean), ("std", &self.std)];
        let quantiles = QUANTILES.iter().map(|(name, _)| *name).zip(&self.quantiles);
        plain.into_iter().chain(quantiles).map(|(name, values)| (name, values.as_slice()))
    }

    /// As `stats.json` has it; a picture's channels are `[3, 1, 1]`.
    pub(super) fn json(&self, of_pictures: bool) -> Value {
        let shape = |values: &[f64]| -> Value {
            if of_pictures { values.iter().map(|value| json!([[value]])).collect() } else { json!(values) }
        };
        let mut map: serde_json::Map<String, Value> =
            self.named().map(|(name, values)| (name.to_owned(), shape(values))).collect();
        map.insert("count".into(), json!([self.count]));
        Value::Object(map)
    }
}

/// Linear between the two nearest values, as NumPy's.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * sorted.len().saturating_sub(1) as f64;
    let (below, above) = (place.floor() as usize, place.ceil() as usize);
    match (sorted.get(below), sorted.get(above)) {
        (Some(a), Some(b)) => a + (b - a) * (place - place.floor()),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_halves_together_have_the_statistics_of_the_whole() {
        let values: Vec<f64> = (0..40).map(|i| f64::from(i * i % 17) - 3.0).collect();
        let whole = Statistics::of(&values, 2);
        let joined = Statistics::of(&values[..12], 2).and(&Statistics::of(&values[12..], 2));
        assert_eq!((&joined.min, &joined.max, joined.count), (&whole.min, &whole.max, whole.count));
        for (a, b) in joined.mean.iter().chain(&joined.std).zip(whole.mean.iter().chain(&whole.std)) {
            assert!((a - b).abs() < 1e-12);
        }
        assert_eq!(quantile(&[0.0, 1.0, 2.0, 3.0], 0.5), 1.5);
    }

    #[test]
    fn pictures_are_counted_by_channel() {
        let found = Statistics::of_pictures(&[0, 51, 255, 255, 51, 255], 3);
        assert_eq!(found.count, 2);
        assert_eq!(found.mean, [0.5, 0.2, 1.0]);
        assert_eq!((found.min[0], found.max[0], found.std[1]), (0.0, 1.0, 0.0));
    }
}
