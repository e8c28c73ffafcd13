//! What a model-free agent can be asked for, and the systems of the paper's table by name. In: a system's name, a size. Out: options.
//!
//! Facts of each system are from its own repository: `MishaLaskin/rad` and curl, denisyarats/drq, tensorflow/agents (QT-Opt), `facebookresearch/deep_bisim4control`,
//! google-research's `MICo`, bit1029public/SimSR, DMU-XMU/SAR.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use vibes_model::cross_entropy::CrossEntropy;
use vibes_model::sac::SacConfig;
use vibes_model::sac::config::LOG_STD_MIN;

use super::augment::Augment;
use crate::error::{Result, TrainError};

/// What stands beside the critics' loss.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Auxiliary {
    /// Nothing.
    None,
    /// Two views of the same stack must be recognised among the views of other stacks.
    Curl,
    /// Next features and reward are predicted.
    #[serde(rename = "deepmdp")]
    DeepMdp,
    /// Features differ as much as rewards and predicted next features do.
    Dbc,
    /// The `MICo` distance.
    #[serde(rename = "mico")]
    Mico,
    /// The cosine distance, with sampled next features.
    #[serde(rename = "simsr")]
    SimSr,
    /// The characteristic function of the policy's next actions is expected from the actor's features and the next rewards.
    #[serde(rename = "sar")]
    Sar,
}

/// Steps whose actions and rewards SAR looks at (DMU-XMU/SAR: config/auxiliary.yaml).
const SEQUENCE: usize = 5;
/// Frequencies that SAR draws for every update, as published; the code's other setting is 128.
pub const FREQUENCIES: usize = 256;
/// Lower bound of the logarithm of the actor's standard deviation, SAR's.
const LOG_STD_MIN_SAR: f32 = -5.0;

impl Auxiliary {
    /// Every one.
    pub const ALL: [Self; 7] = [Self::None, Self::Curl, Self::DeepMdp, Self::Dbc, Self::Mico, Self::SimSr, Self::Sar];

    /// Its name on the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Curl => "curl",
            Self::DeepMdp => "deepmdp",
            Self::Dbc => "dbc",
            Self::Mico => "mico",
            Self::SimSr => "simsr",
            Self::Sar => "sar",
        }
    }

    /// Steps from a transition on that it looks at; 0 where the transition is enough.
    pub fn sequence(self) -> usize {
        if self == Self::Sar { SEQUENCE } else { 0 }
    }

    /// Its weight beside the critics' loss, as published.
    pub fn weight(self) -> f64 {
        if self == Self::Mico { 1e-5 } else { 1.0 }
    }

    /// Frequencies that it draws for every update at a size, where it draws any.
    pub fn frequencies(self, size: Size) -> Option<usize> {
        (self == Self::Sar).then_some(match size {
            Size::Paper => FREQUENCIES,
            Size::Small => SMALL_FREQUENCIES,
        })
    }

    /// Whether it needs a model of the next features and the reward.
    pub fn has_transition(self) -> bool {
        matches!(self, Self::DeepMdp | Self::Dbc | Self::SimSr)
    }
}

impl fmt::Display for Auxiliary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Auxiliary {
    type Err = TrainError;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|auxiliary| auxiliary.name() == text).ok_or_else(|| {
            let names = Self::ALL.map(Self::name).join(", ");
            TrainError::Options(format!("no auxiliary loss `{text}`; there are {names}"))
        })
    }
}

/// The resolved options of a model-free agent.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SacOptions {
    /// Whether there is an actor (SAC); without one the best action is searched for (QT-Opt).
    pub actor: bool,
    /// How stacks are varied.
    pub augment: Augment,
    /// Views of the next stack that targets are averaged over (K).
    pub next_views: usize,
    /// Views of the stack that the critics' loss is added up over (M).
    pub views: usize,
    /// What stands beside the critics' loss.
    pub auxiliary: Auxiliary,
    /// Its weight.
    pub auxiliary_weight: f64,
    /// Transitions a batch.
    pub batch: usize,
    /// Pictures in a stack.
    pub stack: usize,
    /// Width of the perceptrons.
    pub hidden: usize,
    /// Width of the features.
    pub feature: usize,
    /// Whether tanh follows the features' layer norm.
    pub squash: bool,
    /// Adam's step size for critics, actor and what stands beside them.
    pub lr: f64,
    /// Adam's step size for the temperature.
    pub temperature_lr: f64,
    /// Discount of an agent step.
    pub discount: f64,
    /// Share of the way that the slow critics go.
    pub critic_rate: f64,
    /// The same for their convolutions and trunk.
    pub encoder_rate: f64,
    /// Updates from one step of the actor, the temperature and the slow copy to the next.
    pub actor_every: u64,
    /// Actions drawn in every iteration of the search, where there is no actor.
    pub samples: usize,
    /// Best of them that the next iteration is drawn around.
    pub elites: usize,
    /// Iterations of the search.
    pub iterations: usize,
    /// Share of random actions while collecting, where there is no actor.
    pub random_share: f64,
    /// Frequencies that are drawn for every update, where a characteristic function is expected (SAR); 256 where nothing is said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequencies: Option<usize>,
}

/// How large a machine a system is meant for; results are labelled by it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Size {
    /// As published, but for the batches of `SimSR`, which were 128: 84 pixels, batches of 512, perceptrons of 1024, all views.
    Paper,
    /// For a few cores: 64 pixels, batches of 128, perceptrons of 256, one view.
    Small,
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Paper => "paper",
            Self::Small => "small",
        })
    }
}

/// Frequencies of SAR at the size for a few cores.
const SMALL_FREQUENCIES: usize = 32;

/// A system's name and its options.
pub type System = (&'static str, fn() -> SacOptions);

/// A system's options by its name.
pub const SYSTEMS: [System; 10] = [
    ("sac-rad", sac_rad),
    ("sac-drq", sac_drq),
    ("qt-opt-rad", qt_opt_rad),
    ("qt-opt-drq", qt_opt_drq),
    ("curl", curl),
    ("deepmdp", deepmdp),
    ("dbc", dbc),
    ("mico", mico),
    ("simsr", simsr),
    ("sar", sar),
];

impl SacOptions {
    /// The options of a system at a size.
    ///
    /// # Errors
    /// An unknown name; the message lists what there is.
    pub fn system(name: &str, size: Size) -> Result<Self> {
        let made = SYSTEMS.iter().find(|(system, _)| *system == name).ok_or_else(|| {
            let names = SYSTEMS.map(|(name, _)| name).join(", ");
            TrainError::Options(format!("no system `{name}`; there are {names}"))
        })?;
        let options = (made.1)();
        Ok(match size {
            Size::Paper => options,
            Size::Small => {
                let frequencies = options.auxiliary.frequencies(size);
                Self { batch: 128, hidden: 256, views: 1, next_views: 1, frequencies, ..options }
            }
        })
    }
}

impl SacOptions {
    /// With another auxiliary loss beside the critics', at the weight it was published with.
    #[must_use]
    pub fn with(self, auxiliary: Auxiliary, size: Size) -> Self {
        let (auxiliary_weight, frequencies) = (auxiliary.weight(), auxiliary.frequencies(size));
        Self { auxiliary, auxiliary_weight, frequencies, ..self }
    }

    /// These for a run that was begun with `found`: what no option of the command line says is as it was then, also where the system has another number since.
    #[must_use]
    pub fn going_on(self, found: &Self) -> Self {
        let Self { augment, next_views, views, auxiliary, auxiliary_weight, batch, frequencies, .. } = self;
        Self { augment, next_views, views, auxiliary, auxiliary_weight, batch, frequencies, ..found.clone() }
    }

    /// The networks these options ask for, for pictures and actions of a task.
    pub fn networks(&self, task: &str, picture: [usize; 2], (min, max): (Vec<f32>, Vec<f32>)) -> SacConfig {
        let search = CrossEntropy { samples: self.samples, elites: self.elites, iterations: self.iterations };
        SacConfig {
            task: task.to_owned(),
            picture,
            view: self.augment.size(picture),
            stack: self.stack,
            action_min: min,
            action_max: max,
            feature: self.feature,
            hidden: self.hidden,
            squash: self.squash,
            search: (!self.actor).then_some(search),
            random_share: self.random_share as f32,
            bilinear: self.auxiliary == Auxiliary::Curl,
            transition: self.auxiliary.has_transition(),
            sequence: self.auxiliary.sequence(),
            log_std_min: if self.auxiliary == Auxiliary::Sar { LOG_STD_MIN_SAR } else { LOG_STD_MIN },
        }
    }
}

/// What all systems share, with one random crop.
fn sac_rad() -> SacOptions {
    SacOptions {
        actor: true,
        augment: Augment::Crop,
        next_views: 1,
        views: 1,
        auxiliary: Auxiliary::None,
        auxiliary_weight: Auxiliary::None.weight(),
        batch: 512,
        stack: 3,
        hidden: 1024,
        feature: 50,
        squash: true,
        lr: 1e-3,
        temperature_lr: 1e-4,
        discount: 0.99,
        critic_rate: 0.01,
        encoder_rate: 0.05,
        actor_every: 2,
        samples: 32,
        elites: 4,
        iterations: 3,
        random_share: 0.1,
        frequencies: None,
    }
}

/// One rate moves all of the slow critics, their encoder too (denisyarats/drq: `critic_tau` in config.yaml).
fn sac_drq() -> SacOptions {
    SacOptions {
        augment: Augment::Shift,
        next_views: 2,
        views: 2,
        temperature_lr: 1e-3,
        encoder_rate: 0.01,
        ..sac_rad()
    }
}

fn qt_opt_rad() -> SacOptions {
    SacOptions { actor: false, ..sac_rad() }
}

fn qt_opt_drq() -> SacOptions {
    SacOptions { actor: false, ..sac_drq() }
}

fn curl() -> SacOptions {
    SacOptions { auxiliary: Auxiliary::Curl, squash: false, ..sac_rad() }
}

fn deepmdp() -> SacOptions {
    SacOptions { augment: Augment::None, auxiliary: Auxiliary::DeepMdp, squash: false, ..sac_rad() }
}

fn dbc() -> SacOptions {
    SacOptions { auxiliary: Auxiliary::Dbc, ..deepmdp() }
}

fn simsr() -> SacOptions {
    SacOptions { auxiliary: Auxiliary::SimSr, ..deepmdp() }
}

/// DrQ's views, but the slow encoder has a rate of its own again (DMU-XMU/SAR: `extr_tau` in config/common.yaml).
fn sar() -> SacOptions {
    SacOptions {
        auxiliary: Auxiliary::Sar,
        batch: 256,
        lr: 5e-4,
        temperature_lr: 5e-4,
        encoder_rate: 0.05,
        frequencies: Some(FREQUENCIES),
        ..sac_drq()
    }
}

/// Everything makes a step in every update, at one step size (google-research's `mico/dm_control`, on dopamine's `sac_agent.py`).
fn mico() -> SacOptions {
    SacOptions {
        auxiliary: Auxiliary::Mico,
        auxiliary_weight: Auxiliary::Mico.weight(),
        batch: 256,
        temperature_lr: 1e-3,
        critic_rate: 0.005,
        encoder_rate: 0.005,
        actor_every: 1,
        ..deepmdp()
    }
}
