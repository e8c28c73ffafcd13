//! A line of an online run's `metrics.jsonl`. In: what the updates of a round measured, the episode that was lived through meanwhile, and the counters.
//! Out: their means as one line; and the lines that a run which was stopped goes on after.

use std::path::Path;

use serde::Serialize;

use super::actor::Lived;
use super::checkpoint::OnlineState;
use super::options::OnlineOptions;
use super::protocol::Protocol;
use crate::error::Result;
use crate::json::keep_lines;
use crate::learners::behaviour::BehaviourMeasures;
use crate::learners::behaviour::foresight::Foresight;
use crate::metrics::Row;

/// A line of `metrics.jsonl`: an episode, the updates that were made meanwhile, or both.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Line {
    /// The protocol whose settings the run has, if it follows one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub protocol: Option<Protocol>,
    /// Control steps lived through, action repeats counted.
    pub control_steps: u64,
    /// Agent steps lived through.
    pub agent_steps: u64,
    /// Episodes admitted.
    pub episodes: u32,
    /// Return of the episode admitted at the end of the round, exploration included; none for the updates before the first episode.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub training_return: Option<f64>,
    /// Updates made, where none was made in this round; otherwise their number stands in what was learned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub update: Option<u64>,
    /// What was learned; none for random episodes and for rounds that no whole update was paid for.
    #[serde(flatten)]
    pub learned: Option<Learned>,
    /// How fast it went; none for random episodes and for the updates before the first episode.
    #[serde(flatten)]
    pub pace: Option<Pace>,
}

/// What the updates of a round measured: the world model's numbers, and those of actor and critic.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Learned {
    /// The world model.
    #[serde(flatten)]
    pub world: Row,
    /// Mean λ-return that was imagined.
    pub imagined_return: f64,
    /// Mean value of where imagination started.
    pub value: f64,
    /// That value over what rewards of 1 a control step for ever are worth: above 1 something is wrong.
    pub value_over_bound: f64,
    /// What returns are divided by.
    pub return_scale: f64,
    /// Entropy of the actor, nats.
    pub entropy: f64,
    /// Mean disagreement of the guard's members over imagined rows, in units of reward.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub disagreement: Option<f64>,
    /// The same over recorded rows, of which half the members have seen each.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recorded_disagreement: Option<f64>,
    /// Loss of the critic.
    pub critic_loss: f64,
    /// Norm of the actor's gradient.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub actor_gradient_norm: Option<f64>,
    /// Norm of the critic's gradient.
    pub critic_gradient_norm: f64,
    /// Imagined reward of a step along recorded actions.
    pub foreseen_reward: f64,
    /// Recorded reward of the same steps.
    pub recorded_reward: f64,
    /// Correlation of the two over windows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub foresight: Option<f64>,
}

/// How fast a round went.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pace {
    /// Control steps a second, end to end.
    pub control_steps_per_second: f64,
    /// Share of the round that the learner waited for the actor's thread.
    pub waiting_for_actor_share: f64,
    /// Share of the round that the actor's thread was at work.
    pub acting_share: f64,
}

impl Pace {
    /// Of a round that took `seconds`, of which the learner `waited` for the episode that was lived through.
    pub(super) fn of(lived: Lived, action_repeat: u32, seconds: f64, waited: f64) -> Self {
        Self {
            control_steps_per_second: f64::from(lived.steps) * f64::from(action_repeat) / seconds,
            waiting_for_actor_share: waited / seconds,
            acting_share: lived.seconds / seconds,
        }
    }
}

/// Sums over the updates of a round.
#[derive(Default)]
pub(super) struct Round {
    pub(super) measures: Vec<BehaviourMeasures>,
    pub(super) foresight: Option<Foresight>,
}

impl Line {
    /// The counters as they stand, the episode that was admitted last, and what else there is.
    pub(super) fn new(
        (state, options): (&OnlineState, &OnlineOptions),
        training_return: Option<f64>,
        update: u64,
        learned: Option<Learned>,
        pace: Option<Pace>,
    ) -> Self {
        Self {
            protocol: options.protocol,
            control_steps: state.control_steps,
            agent_steps: state.agent_steps,
            episodes: state.episodes,
            training_return,
            update: learned.is_none().then_some(update),
            learned,
            pace,
        }
    }
}

impl Round {
    /// What it measured, beside the world model's numbers.
    pub(super) fn learned(&self, world: Row, options: &OnlineOptions) -> Learned {
        let count = self.measures.len() as f64;
        let mean = |of: &dyn Fn(&BehaviourMeasures) -> f32| {
            self.measures.iter().map(|measures| f64::from(of(measures))).sum::<f64>() / count
        };
        let disagreement = |place: usize| {
            let mut of = self.measures.iter().map(|measures| measures.disagreement);
            of.try_fold(0.0, |sum, apart| apart.map(|apart| sum + f64::from(apart[place]) / count))
        };
        let norms: Vec<f32> = self.measures.iter().filter_map(|measures| measures.actor_gradient_norm).collect();
        let bound = f64::from(options.world.action_repeat) / (1.0 - options.behaviour.discount).max(1e-6);
        let value = mean(&|measures| measures.value);
        let foresight = self.foresight;
        Learned {
            world,
            imagined_return: mean(&|measures| measures.imagined_return),
            value,
            value_over_bound: value / bound,
            return_scale: mean(&|measures| measures.return_scale),
            entropy: mean(&|measures| measures.entropy),
            disagreement: disagreement(0),
            recorded_disagreement: disagreement(1),
            critic_loss: mean(&|measures| measures.critic_loss),
            actor_gradient_norm: (!norms.is_empty())
                .then(|| norms.iter().map(|&norm| f64::from(norm)).sum::<f64>() / norms.len() as f64),
            critic_gradient_norm: mean(&|measures| measures.critic_gradient_norm),
            foreseen_reward: foresight.map_or(0.0, |foresight| foresight.imagined),
            recorded_reward: foresight.map_or(0.0, |foresight| foresight.recorded),
            foresight: foresight.and_then(|foresight| foresight.correlation),
        }
    }
}

/// Drops lines of episodes that a stopped run lived through after its last checkpoint, at `control_steps`. Their updates do not tell: a round may have none.
///
/// # Errors
/// The file cannot be read or written.
pub(super) fn drop_lived_beyond(path: &Path, control_steps: u64) -> Result<()> {
    keep_lines(path, |line| line["control_steps"].as_u64().is_some_and(|steps| steps <= control_steps))
}
