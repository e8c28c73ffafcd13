//! The numbers of a training run over time: averages over some updates, one JSON object a line in `metrics.jsonl`. In: the measures of every update. Out: a
//! row, and the file it is appended to.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use vibes_data::Metrics;

use crate::error::{Result, malformed};
use crate::learners::world::Measures;
use vibes_measure::spectrum::spectrum;

/// One line of `metrics.jsonl`: averages over the updates since the line before. Log-likelihoods are nats a row.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default = "Row::unknown")]
pub struct Row {
    /// Updates made when the line was written.
    pub update: u64,
    /// The objective.
    pub objective: f64,
    /// Latents under the dynamics.
    pub dynamics_log_likelihood: f64,
    /// Rewards.
    pub reward_log_likelihood: f64,
    /// Share of the dynamics term's gradient that reached the encoder; 0 for objectives that do not weigh their dynamics.
    pub dynamics_weight: f64,
    /// Norm of the world model's gradient before it was limited.
    pub gradient_norm: f64,
    /// The encoder's part of it.
    pub encoder_gradient_norm: f64,
    /// Effective rank of the latents' means in the last of these updates: exp of the entropy of their covariance's eigenvalues, 1 when they vary along
    /// one line only.
    pub batch_effective_rank: f64,
    /// Variance of the latents' means in that update, summed over dimensions; at most 1 where they have unit norm.
    pub latent_variance: f64,
    /// Updates of the world model a second; online, actor and critic learn beside them.
    pub updates_per_second: f64,
    /// Rows that went through the networks a second.
    pub frames_per_second: f64,
    /// Share of the time spent waiting for windows.
    pub waiting_share: f64,
    /// What the objective and the auxiliary terms state, by name: `adversary_log_likelihood` after the adversary's step and
    /// `adversary_log_likelihood_before` it, `adversary_minus_dynamics`, `clipped_share`, `reconstruction_log_likelihood`, `inverse_log_likelihood`, …
    #[serde(flatten)]
    pub stated: BTreeMap<String, f64>,
}

impl Row {
    /// What a line does not say.
    fn unknown() -> Self {
        let nan = f64::NAN;
        Self {
            update: 0,
            objective: nan,
            dynamics_log_likelihood: nan,
            reward_log_likelihood: nan,
            dynamics_weight: 0.0,
            gradient_norm: nan,
            encoder_gradient_norm: nan,
            batch_effective_rank: nan,
            latent_variance: nan,
            updates_per_second: nan,
            frames_per_second: nan,
            waiting_share: nan,
            stated: BTreeMap::new(),
        }
    }

    /// What the objective or an auxiliary term stated, if it did.
    pub fn stated(&self, name: &str) -> Option<f64> {
        self.stated.get(name).copied()
    }
}

/// Gathers the measures of some updates.
#[derive(Debug, Default)]
pub struct Averages {
    measures: Vec<Measures>,
    frames: u64,
    elapsed: Duration,
    waited: Duration,
}

impl Averages {
    /// Adds one update, the rows it saw, how long it took in all, and how long of this it waited for its windows.
    pub fn add(&mut self, measures: Measures, frames: u64, elapsed: Duration, waited: Duration) {
        self.measures.push(measures);
        self.frames += frames;
        self.elapsed += elapsed;
        self.waited += waited;
    }

    /// Whether nothing was added since the last row.
    pub fn is_empty(&self) -> bool {
        self.measures.is_empty()
    }

    /// The row, and a fresh start; `latent` is the latents' dimensions.
    pub fn take_row(&mut self, update: u64, latent: usize) -> Row {
        let Self { measures, frames, elapsed, waited } = std::mem::take(self);
        let count = measures.len().max(1) as f64;
        let mean =
            |of: &dyn Fn(&Measures) -> f32| measures.iter().map(|measure| f64::from(of(measure))).sum::<f64>() / count;
        let names = measures.first().map(|first| first.stated.keys().copied()).into_iter().flatten();
        let stated = |name: &'static str| (name.to_owned(), mean(&|m| m.stated.get(name).copied().unwrap_or(f32::NAN)));
        let means = measures.last().map_or(&[][..], |last| &last.latent_means);
        let (batch_effective_rank, latent_variance) =
            spectrum(means, latent).map_or((f64::NAN, f64::NAN), |found| (found.effective_rank, found.variance));
        let seconds = elapsed.as_secs_f64().max(1e-9);
        Row {
            update,
            objective: mean(&|m| m.objective),
            dynamics_log_likelihood: mean(&|m| m.dynamics),
            reward_log_likelihood: mean(&|m| m.reward),
            dynamics_weight: mean(&|m| m.dynamics_weight),
            gradient_norm: mean(&|m| m.gradient_norm),
            encoder_gradient_norm: mean(&|m| m.encoder_gradient_norm),
            batch_effective_rank,
            latent_variance,
            updates_per_second: count / seconds,
            frames_per_second: frames as f64 / seconds,
            waiting_share: waited.as_secs_f64() / seconds,
            stated: names.map(stated).collect(),
        }
    }
}

/// Reads every whole row of a `metrics.jsonl`, those of older runs under today's names; a missing file holds none, a run that was killed leaves a
/// line that is none, and an episode without updates has one that is none.
///
/// # Errors
/// The file cannot be read, or a line is not a row.
pub fn read_rows(path: &Path) -> Result<Vec<Row>> {
    rows_of(Metrics::read(path)?, path)
}

/// The rows among lines that were read from `path`, as [`read_rows`] has them.
///
/// # Errors
/// A line is not a row.
pub fn rows_of(metrics: Metrics, path: &Path) -> Result<Vec<Row>> {
    let row = |mut line: Map<String, Value>| {
        // What was no number was written as null, and an online run's lines name its protocol.
        line.retain(|_, value| value.is_number());
        serde_json::from_value(Value::Object(line))
            .map_err(|error| malformed(path, error, "one JSON object of metrics a line"))
    };
    metrics.lines.into_iter().filter(|line| line.contains_key("objective")).map(row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_older_and_of_killed_runs_are_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("metrics.jsonl");
        assert_eq!(read_rows(&path).unwrap(), []);
        let row =
            Row { update: 20, batch_effective_rank: 3.5, stated: [(NAME.to_owned(), 0.25)].into(), ..Row::default() };
        let text = serde_json::to_string(&row).unwrap();
        let older = text.replace("batch_effective_rank", "effective_rank").replace(NAME, "gap");
        std::fs::write(&path, format!("{older}\n{text}\n{}", &text[..40])).unwrap();
        assert_eq!(read_rows(&path).unwrap(), [row.clone(), row]);
        std::fs::write(&path, text.replace("0.25", "null").replace("3.5", "null") + "\n").unwrap();
        let rows = read_rows(&path).unwrap();
        assert!(rows[0].batch_effective_rank.is_nan() && rows[0].stated(NAME).is_none() && rows[0].update == 20);
    }

    const NAME: &str = "adversary_minus_dynamics";
}
