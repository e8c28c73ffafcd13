//! What a run is trained with, whatever its objective: rates, weights, sizes, how long, and what changes with the updates. In: values. Out: what holds at an
//! update. Objectives and terms read these; [`options`](crate::options) lays presets, files and flags over one another and knows the objectives.

use serde::{Deserialize, Serialize};

pub mod own;

use own::Own;

/// What the model looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Observations {
    /// Pixels where the recording has them, otherwise vectors.
    Auto,
    /// Pictures.
    Pixels,
    /// The task's vector observation.
    Vectors,
}

/// The settings of a run, whatever its objective. The paper leaves all of these open but `latent_std`; every choice is explained at its field.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// What the model looks at.
    pub observations: Observations,
    /// Seed of the first weights, the windows and the noise.
    pub seed: u64,
    /// Windows a batch.
    pub batch: usize,
    /// Rows a window. Short windows got further per hour than long ones.
    pub length: usize,
    /// First rows of a window that begins in mid-episode which only warm up the hidden states: they start from zeros with the true previous action, see
    /// all observations, and carry no term of the objective. Windows that begin with their episode count whole.
    pub burn_in: usize,
    /// Adam's step size for the world model (`η_θ = η_φ`).
    pub lr: f64,
    /// Updates over which the world model's step size rises from zero to `lr`. Adam's first steps are as large as any, in whatever direction the first few
    /// gradients have in common; at full size a handful of them undo the calibration.
    pub lr_warmup: u64,
    /// Updates after which both step sizes fall as one over the square root of the updates; 0 for never. What is found early at full size is later drowned by
    /// the noise of small batches. Falling so depends on no end, so a run can go on for longer than was meant.
    #[serde(default)]
    pub lr_decay: u64,
    /// Adam's step size for the adversary (`η_ψ`, above `η_φ`).
    pub adversary_lr: f64,
    /// Adam's ε, above 0: a weight whose gradient is 0 would otherwise move by 0/0.
    pub adam_epsilon: f64,
    /// Largest global norm of the world model's, and of the adversary's, gradient.
    pub gradient_clip: f64,
    /// Share of the dynamics term's gradient that reaches the encoder; the dynamics model itself always learns from all of it. At 1 from the start, as the
    /// objective is written, the latent soon ignores the picture and stays so.
    pub dynamics_weight: f64,
    /// Updates before which nothing of it does, for an objective that waits ([`Definition::gate`](crate::learners::objective::Definition::gate)): the encoder
    /// learns from the reward alone.
    pub dynamics_start: u64,
    /// How many nats better than past actions alone predict the rewards the reward model must be before anything does (see [`gate`](crate::gate)); 0 for no
    /// such condition.
    pub dynamics_after: f64,
    /// Updates after that over which the weight rises from zero to its value.
    pub dynamics_warmup: u64,
    /// Weight of the reward term.
    pub reward_weight: f64,
    /// Whether the first scale of features and latents is set by the data (see `Model::calibrated`), so that training begins with latents that differ. With
    /// ordinary first weights all latents begin within the noise of one another, where the reward model learns nothing and ignoring the picture is an
    /// optimum.
    pub calibrate: bool,
    /// Channels after the first convolution.
    pub depth: usize,
    /// Width of features and hidden states.
    pub hidden: usize,
    /// Width of the heads' hidden layers.
    pub head: usize,
    /// Dimensions of the latent.
    pub latent: usize,
    /// Standard deviation of the encoder; the paper's 0.1.
    pub latent_std: f64,
    /// Least standard deviation of a prediction of a latent. A latent carries noise of `latent_std`, so nothing can be surer than that.
    pub prediction_floor: f64,
    /// Least standard deviation of the predicted reward, in units of [`reward_scale`](Self::reward_scale). One miss costs up to half its square over this: a
    /// floor far below what the rewards vary by lets a few rows outweigh all others.
    pub reward_floor: f64,
    /// One unit of the reward model, in units of reward; 0 for the standard deviation of the recordings' rewards. Rewards are summed over the
    /// action repeat, so their size differs between tasks. The paper lacks it: 1.
    #[serde(default = "one")]
    pub reward_scale: f64,
    /// Added to the first bias of the recurrent networks' update gates; above 0 they begin with a longer memory. The paper lacks it: 0.
    #[serde(default)]
    pub gru_update_bias: f64,
    /// Updates to make in all.
    pub updates: u64,
    /// Minutes to train in all, over every time the run was continued; 0 for no limit.
    pub minutes: f64,
    /// Updates between checkpoints.
    pub checkpoint_every: u64,
    /// Updates a line of metrics covers.
    pub log_every: u64,
    /// Checkpoints to keep.
    pub keep: usize,
    /// What objectives and auxiliary terms declare for themselves, by name.
    #[serde(flatten)]
    pub own: Own,
}

fn one() -> f64 {
    1.0
}

/// The options that change with the updates, at one of them. The paper gives the terms no weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Schedule {
    /// Share of the dynamics term's gradient that [reaches](crate::learners::scene::gated) the encoder.
    pub dynamics_weight: f32,
    /// How far that share has risen, from 0 to 1; terms that look ahead [wait](crate::learners::auxiliary::Auxiliary::waits) with it.
    pub risen: f32,
    /// Weight of the reward's log-likelihood.
    pub reward_weight: f32,
    /// Adam's step size for the world model.
    pub lr: f64,
    /// Adam's step size for the adversary.
    pub adversary_lr: f64,
}

impl Settings {
    /// What holds at one update, if the [gate](crate::gate) opened at update `opened`.
    pub fn schedule(&self, update: u64, opened: Option<u64>) -> Schedule {
        self.schedule_after(update, update, opened)
    }

    /// The same where Adam has made fewer steps than the schedules: where its moments are new, the step size rises anew, however far the others have come.
    pub fn schedule_after(&self, steps: u64, update: u64, opened: Option<u64>) -> Schedule {
        let risen = match opened.and_then(|since| update.checked_sub(since)) {
            None => 0.0,
            Some(since) if since >= self.dynamics_warmup => 1.0,
            Some(since) => since as f64 / self.dynamics_warmup as f64,
        };
        let warmed = (steps.min(update).saturating_add(1) as f64 / self.lr_warmup.max(1) as f64).min(1.0);
        let fallen = match self.lr_decay {
            0 => 1.0,
            after => (after as f64 / update.saturating_add(1) as f64).sqrt().min(1.0),
        };
        Schedule {
            dynamics_weight: (self.dynamics_weight * risen) as f32,
            risen: risen as f32,
            reward_weight: self.reward_weight as f32,
            lr: self.lr * warmed * fallen,
            adversary_lr: self.adversary_lr * fallen,
        }
    }
}
