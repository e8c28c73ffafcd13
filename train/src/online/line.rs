//! A line of an online run's `metrics.jsonl`. In: what the updates of a round measured, the episode that was lived through meanwhile, and the counters.
//! Out: their means as one line.

use serde::Serialize;

use super::actor::Lived;
use super::checkpoint::OnlineState;
use super::options::OnlineOptions;
use super::protocol::Protocol;
use crate::learners::behaviour::BehaviourMeasures;
use crate::learners::behaviour::foresight::Foresight;
use crate::metrics::Row;

/// A line of `metrics.jsonl`: the world model's numbers, and those of a round.
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
    /// Control steps a second, end to end; this and what follows are none for the updates before the first episode.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub control_steps_per_second: Option<f64>,
    /// Share of the round that the learner waited for the actor's thread.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub waiting_for_actor_share: Option<f64>,
    /// Share of the round that the actor's thread was at work.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acting_share: Option<f64>,
}

/// Sums over the updates of a round.
#[derive(Default)]
pub(super) struct Round {
    pub(super) measures: Vec<BehaviourMeasures>,
    pub(super) foresight: Option<Foresight>,
}

/// How long a round took, and the episode that was lived through in it.
pub(super) struct Time {
    /// None for the updates before the first episode.
    pub(super) lived: Option<Lived>,
    /// Seconds of the whole round.
    pub(super) seconds: f64,
    /// Seconds that the learner waited for the actor's thread.
    pub(super) waited: f64,
}

impl Time {
    /// Of updates without an episode.
    pub(super) const NONE: Self = Self { lived: None, seconds: 1.0, waited: 0.0 };
}

impl Round {
    /// The numbers of this round.
    pub(super) fn line(&self, world: Row, state: &OnlineState, options: &OnlineOptions, time: Time) -> Line {
        let Time { lived, seconds, waited } = time;
        let count = self.measures.len() as f64;
        let mean = |of: &dyn Fn(&BehaviourMeasures) -> f32| {
            self.measures.iter().map(|measures| f64::from(of(measures))).sum::<f64>() / count
        };
        let disagreement = |place: usize| {
            let mut of = self.measures.iter().map(|measures| measures.disagreement);
            of.try_fold(0.0, |sum, apart| apart.map(|apart| sum + f64::from(apart[place]) / count))
        };
        let norms: Vec<f32> = self.measures.iter().filter_map(|measures| measures.actor_gradient_norm).collect();
        let repeat = f64::from(options.world.action_repeat);
        let bound = repeat / (1.0 - options.behaviour.discount).max(1e-6);
        let value = mean(&|measures| measures.value);
        let foresight = self.foresight;
        Line {
            protocol: options.protocol,
            control_steps: state.control_steps,
            agent_steps: state.agent_steps,
            episodes: state.episodes,
            training_return: lived.map(|lived| lived.episode_return),
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
            control_steps_per_second: lived.map(|lived| f64::from(lived.steps) * repeat / seconds),
            waiting_for_actor_share: lived.map(|_| waited / seconds),
            acting_share: lived.map(|lived| lived.seconds / seconds),
        }
    }
}
