//! What actor and critic can be asked for, and the recipes, after two published families.

use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;
use serde::{Deserialize, Serialize};
use vibes_model::actions::ActionDistribution;
use vibes_model::config::{BehaviourConfig, ModelConfig};
use vibes_model::guard::Guard;
use vibes_model::values::ValueDistribution;

use crate::error::{Result, TrainError, refuse};

/// How the actor learns.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Gradient {
    /// By the gradient of the returns through the frozen dynamics and reward model.
    Dynamics,
    /// By the log-density of its actions times their advantage.
    Reinforce,
}

/// The resolved options of actor and critic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BehaviourOptions {
    /// The actor's distribution.
    pub actions: ActionDistribution,
    /// The critic's distribution.
    pub values: ValueDistribution,
    /// How the actor learns.
    pub gradient: Gradient,
    /// Imagined steps.
    pub horizon: usize,
    /// Discount of an agent step.
    pub discount: f64,
    /// Share of the longer return in a λ-return.
    pub lambda: f64,
    /// Weight of the actor's entropy.
    pub entropy: f64,
    /// Adam's step size for the actor.
    pub actor_lr: f64,
    /// Adam's step size for the critic.
    pub critic_lr: f64,
    /// Largest global norm of either's gradient.
    pub gradient_clip: f64,
    /// Whether returns are divided by their moving range before the actor sees them.
    pub normalize_returns: bool,
    /// Whether the slow copy's values end the returns, rather than the critic's own.
    pub slow_target: bool,
    /// Weight of the slow copy's values as a second target of the critic.
    pub slow_weight: f64,
    /// Share of the way that the slow copy goes at every update.
    pub slow_rate: f64,
    /// Weight of the critic's loss on recorded rewards.
    pub replay_value: f64,
    /// Whether later imagined rows count less, by the discount.
    pub discount_weights: bool,
    /// Width of the hidden layers of actor and critic.
    pub hidden: usize,
    /// Imagination starts from every so-manieth counted row.
    pub every_start: usize,
    /// Standard deviations over the guard's members that are taken from imagined rewards; 0 for no guard.
    #[serde(default, skip_serializing_if = "is_none")]
    pub guard: f64,
    /// Reward heads of the guard.
    #[serde(default = "five", skip_serializing_if = "is_five")]
    pub guard_members: usize,
}

/// Members of a guard that does not say how many.
const MEMBERS: usize = 5;

/// Members of a guard at most.
const MOST_MEMBERS: usize = 100;

/// Imagined steps at most: λ-returns weigh every step for every one before it.
const MOST_STEPS: usize = 1000;

fn five() -> usize {
    MEMBERS
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_five(members: &usize) -> bool {
    *members == MEMBERS
}

/// Options of runs without a guard are written as they were before there was one.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
fn is_none(weight: &f64) -> bool {
    *weight == 0.0
}

/// A name and the options it stands for.
pub type Recipe = (&'static str, fn() -> BehaviourOptions);

/// The recipes by name.
pub const RECIPES: [Recipe; 3] = [("mixed", mixed), ("gaussian", gaussian), ("dreamer-v3", dreamer_v3)];

/// The bounded normal of `DreamerV3`, whose entropy is exact and which cannot saturate, with the squared error and the discount of the Gaussian family.
pub fn mixed() -> BehaviourOptions {
    BehaviourOptions { actions: ActionDistribution::BoundedNormal, ..gaussian() }
}

/// The family of Dreamer and RePo: tanh-normal actor, squared error, discount 0.99, backpropagation through the dynamics. Unlike there, returns are divided by their range, a slow copy
/// of the critic ends them, and the step sizes are this toolkit's.
pub fn gaussian() -> BehaviourOptions {
    BehaviourOptions {
        actions: ActionDistribution::TanhNormal,
        values: ValueDistribution::Gaussian,
        gradient: Gradient::Dynamics,
        horizon: 15,
        discount: 0.99,
        lambda: 0.95,
        entropy: 3e-4,
        actor_lr: 3e-4,
        critic_lr: 3e-4,
        gradient_clip: 100.0,
        normalize_returns: true,
        slow_target: true,
        slow_weight: 0.0,
        slow_rate: 0.02,
        replay_value: 0.0,
        discount_weights: true,
        hidden: 256,
        every_start: 1,
        guard: 0.0,
        guard_members: MEMBERS,
    }
}

/// The family of `DreamerV3`: bounded normal, two-hot critic that a slow copy holds back and recorded rewards teach too, discount 1 − 1/333. Unlike there, the actor learns through the dynamics
/// unless `--gradient reinforce` says otherwise, and the step sizes are this toolkit's.
pub fn dreamer_v3() -> BehaviourOptions {
    BehaviourOptions {
        actions: ActionDistribution::BoundedNormal,
        values: ValueDistribution::TwoHot,
        discount: 1.0 - 1.0 / 333.0,
        slow_target: false,
        slow_weight: 1.0,
        replay_value: 0.3,
        ..gaussian()
    }
}

impl Default for BehaviourOptions {
    fn default() -> Self {
        mixed()
    }
}

impl BehaviourOptions {
    /// The recipe `name`.
    ///
    /// # Errors
    /// There is none of this name; the message lists those there are.
    pub fn recipe(name: &str) -> Result<Self> {
        let found = RECIPES.iter().find(|(recipe, _)| *recipe == name).map(|(_, recipe)| recipe());
        found.ok_or_else(|| {
            let names = RECIPES.map(|(name, _)| name).join(", ");
            TrainError::Options(format!("no recipe `{name}`; there are {names}"))
        })
    }

    /// The networks these options ask for.
    pub fn config(&self) -> BehaviourConfig {
        BehaviourConfig { actions: self.actions, values: self.values, hidden: self.hidden }
    }

    /// The guard these options ask for, its first weights and shares drawn from `rng`; nothing is drawn without one.
    pub fn guard(&self, model: &ModelConfig, rng: &mut impl Rng, device: &Device) -> Option<Guard> {
        (self.guard > 0.0).then(|| Guard::init(model, self.guard_members, rng, device))
    }

    /// The weight of every imagined row: `[horizon, rows]`.
    pub(super) fn weights(&self, horizon: usize, rows: usize, device: &Device) -> Tensor<2> {
        let discount = if self.discount_weights { self.discount } else { 1.0 };
        let weights: Vec<f32> = (0..horizon).map(|k| discount.powi(k as i32) as f32).collect();
        Tensor::<2>::from_data(TensorData::new(weights, [horizon, 1]), device).expand([horizon, rows])
    }

    /// That the values make sense.
    ///
    /// # Errors
    /// One does not; the message names it.
    pub fn check(&self) -> Result<()> {
        self.check_finite()?;
        let shares = [("discount", self.discount), ("lambda", self.lambda), ("slow-rate", self.slow_rate)];
        refuse(&shares, |value| !(0.0..=1.0).contains(&value), "lie between 0 and 1")?;
        if self.replay_value > 0.0 && self.every_start > 1 {
            let text =
                "--every-start above 1 leaves the critic without targets on recorded rewards, which this recipe wants";
            return Err(TrainError::Options(text.to_owned()));
        }
        let least = [("guard", self.guard), ("entropy", self.entropy)];
        refuse(&least, |value| value < 0.0, "be 0 or more")?;
        if !(2..=MOST_MEMBERS).contains(&self.guard_members) {
            let text = format!(
                "--guard-members is {}; it takes two to disagree, and {MOST_MEMBERS} are the most",
                self.guard_members
            );
            return Err(TrainError::Options(text));
        }
        refuse(&[("horizon", self.horizon)], |steps| steps > MOST_STEPS, format_args!("be at most {MOST_STEPS}"))?;
        let positive = [
            ("horizon", self.horizon as f64),
            ("every-start", self.every_start as f64),
            ("actor-lr", self.actor_lr),
            ("critic-lr", self.critic_lr),
            ("behaviour-hidden", self.hidden as f64),
        ];
        refuse(&positive, |value| value <= 0.0, "be above 0")
    }

    /// That every number is one that a run's files can hold.
    fn check_finite(&self) -> Result<()> {
        let numbers = [
            ("discount", self.discount),
            ("lambda", self.lambda),
            ("entropy", self.entropy),
            ("actor-lr", self.actor_lr),
            ("critic-lr", self.critic_lr),
            ("gradient-clip", self.gradient_clip),
            ("slow-weight", self.slow_weight),
            ("slow-rate", self.slow_rate),
            ("replay-value", self.replay_value),
            ("guard", self.guard),
        ];
        refuse(&numbers, |value| !value.is_finite(), "be a finite number")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every number of a recipe, by its field: the law holds for those that are added.
    #[test]
    fn no_number_may_be_anything_but_finite() {
        let whole = serde_json::to_value(BehaviourOptions { guard: 1.0, ..mixed() }).unwrap();
        let numbers = whole.as_object().unwrap().iter().filter(|(_, value)| value.is_f64());
        let mut checked = 0;
        for (key, _) in numbers {
            let mut options = mixed();
            *number(&mut options, key) = f64::INFINITY;
            let error = options.check().unwrap_err().to_string();
            assert!(error.contains(&key.replace('_', "-")) && error.contains("finite"), "{key}: {error}");
            checked += 1;
        }
        assert_eq!(checked, 10);
    }

    fn number<'a>(options: &'a mut BehaviourOptions, key: &str) -> &'a mut f64 {
        match key {
            "discount" => &mut options.discount,
            "lambda" => &mut options.lambda,
            "entropy" => &mut options.entropy,
            "actor_lr" => &mut options.actor_lr,
            "critic_lr" => &mut options.critic_lr,
            "gradient_clip" => &mut options.gradient_clip,
            "slow_weight" => &mut options.slow_weight,
            "slow_rate" => &mut options.slow_rate,
            "replay_value" => &mut options.replay_value,
            "guard" => &mut options.guard,
            other => panic!("{other} is not checked"),
        }
    }

    #[test]
    fn what_would_take_all_memory_is_refused() {
        for options in [
            BehaviourOptions { horizon: MOST_STEPS + 1, ..mixed() },
            BehaviourOptions { guard_members: MOST_MEMBERS + 1, ..mixed() },
            BehaviourOptions { guard_members: 1, ..mixed() },
        ] {
            let error = options.check().unwrap_err().to_string();
            assert!(error.contains("most"), "{error}");
        }
    }
}
