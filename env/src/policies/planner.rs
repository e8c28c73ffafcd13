//! The planner: predictive sampling on the true simulator with the task's own reward, which needs no training and works on every task.
//!
//! At every agent step it takes the best plans of the last step, a step further on, and random variations of them and of nothing, rolls each
//! through the simulator from the present state, and executes the first action of the best (after Howell et al. 2022, "Predictive Sampling").
//! Variations are straight lines through a few random knots, so that they are smooth enough to move a body somewhere.
//!
//! Where this departs from the paper: a plan is its actions, not the spline's knots, so that a good plan stays what it is while time moves under
//! it; variations come in all sizes; and several plans are kept, since a sparse reward says little about which of them is on the way.

use rand::{Rng, RngCore};

use super::{Policy, Sight};
use crate::environment::Snapshot;
use crate::gaussian::standard_normal;
use crate::tasks::PlannerSettings;
use crate::{Environment, EnvironmentOptions, Result, Start};

/// The finest variation has this share of the widest's standard deviation: finding a way needs wide ones, keeping still in a goal fine ones.
const FINEST: f64 = 1.0 / 30.0;

/// Actions over the horizon `[horizon, action]`, in the action's bounds.
type Actions = Vec<Vec<f64>>;

/// A plan and the rewards it earns from the state it was made for.
#[derive(Clone, Debug)]
struct Plan {
    value: f64,
    actions: Actions,
}

/// A planner with its own simulation of the task.
#[derive(Debug)]
pub struct Planner {
    settings: PlannerSettings,
    noise: f64,
    simulation: Environment,
    now: Snapshot,
    /// The best plans of the last agent step, best first.
    plans: Vec<Plan>,
    /// The middle of the action's bounds and half their width.
    middle: Vec<f64>,
    half: Vec<f64>,
}

impl Planner {
    /// A planner for a task; `noise` is the standard deviation added to the executed action, as a share of half the action range.
    pub fn new(task: &str, options: EnvironmentOptions, noise: f64) -> Result<Self> {
        let simulation = Environment::new(task, options)?;
        let settings = simulation.planner_settings();
        Ok(Self::with_settings(simulation, settings, noise))
    }

    /// The same with other settings.
    pub fn with_settings(simulation: Environment, settings: PlannerSettings, noise: f64) -> Self {
        let bounds = simulation.action_spec();
        let pairs = || bounds.min.iter().zip(&bounds.max);
        Self {
            settings,
            noise,
            simulation,
            now: Snapshot::default(),
            plans: Vec::new(),
            middle: pairs().map(|(low, high)| f64::midpoint(*low, *high)).collect(),
            half: pairs().map(|(low, high)| (high - low) / 2.0).collect(),
        }
    }

    /// The best plan's first action, with the noise asked for.
    fn executed(&self, rng: &mut dyn RngCore) -> Vec<f64> {
        let mut action = self.plans[0].actions[0].clone();
        if self.noise > 0.0 {
            for (number, half) in action.iter_mut().zip(&self.half) {
                *number += self.noise * half * standard_normal(rng);
            }
            self.clip(&mut action);
        }
        action
    }

    /// The plan of doing nothing.
    fn rest(&self) -> Actions {
        vec![self.middle.clone(); self.settings.horizon]
    }

    /// Tries a plan in the simulator and keeps it if it is among the best; of equals the earlier stays in front.
    fn consider(&mut self, actions: Actions) {
        // Plans without any reward say nothing; going on with another one comes by new places.
        let is_lost = self.plans.first().is_some_and(|best| best.value <= 0.0);
        let is_full = self.plans.len() >= self.settings.kept;
        let to_beat = self.plans.last().filter(|_| is_full && !is_lost).map(|worst| worst.value);
        let Some(value) = self.value(&actions, to_beat) else { return };
        let rank = if is_lost { 0 } else { self.plans.partition_point(|plan| plan.value >= value) };
        self.plans.insert(rank, Plan { value, actions });
        self.plans.truncate(self.settings.kept);
    }

    /// The rewards a plan earns from the present state; nothing as soon as it is clear that they will not be more than `to_beat`, since no control
    /// step gives more than 1. A plan that breaks the simulation earns what it got until then.
    fn value(&mut self, actions: &Actions, to_beat: Option<f64>) -> Option<f64> {
        self.simulation.restore(&self.now);
        let mut value = 0.0;
        for (step, action) in actions.iter().enumerate() {
            let most = value + ((actions.len() - step) * self.simulation.action_repeat() as usize) as f64;
            if to_beat.is_some_and(|to_beat| most <= to_beat) {
                return None;
            }
            let Ok(reward) = self.simulation.step(action) else { break };
            value += reward;
        }
        Some(value)
    }

    /// Actions plus a smooth random change: normal numbers at the knots, straight lines between them.
    fn variation(&self, actions: &Actions, width: f64, rng: &mut dyn RngCore) -> Actions {
        let mut knot = |half: &f64| width * half * standard_normal(rng);
        let knots: Actions = (0..self.settings.knots).map(|_| self.half.iter().map(&mut knot).collect()).collect();
        let last = knots.len() - 1;
        let knots_per_step = last as f64 / (actions.len().max(2) - 1) as f64;
        let mut varied = actions.clone();
        for (step, action) in varied.iter_mut().enumerate() {
            let place = step as f64 * knots_per_step;
            let left = (place as usize).min(last);
            let (right, share) = ((left + 1).min(last), place - left as f64);
            for (axis, number) in action.iter_mut().enumerate() {
                *number += (1.0 - share) * knots[left][axis] + share * knots[right][axis];
            }
            self.clip(action);
        }
        varied
    }

    fn clip(&self, action: &mut [f64]) {
        for ((number, middle), half) in action.iter_mut().zip(&self.middle).zip(&self.half) {
            *number = number.clamp(middle - half, middle + half);
        }
    }
}

impl Policy for Planner {
    /// Forgets the last plans and takes over an episode's model.
    fn begin(&mut self, start: &Start) -> Result<()> {
        self.simulation.reset_to(start)?;
        self.plans = vec![Plan { value: 0.0, actions: self.rest() }];
        Ok(())
    }

    /// Plans from the simulator's present state and returns the action to execute.
    fn act(&mut self, sight: &Sight<'_>, rng: &mut dyn RngCore) -> Result<Vec<f64>> {
        sight.environment.save(&mut self.now);
        let last = std::mem::take(&mut self.plans);
        for plan in last {
            self.consider(shifted(plan.actions));
        }
        let fresh = (self.settings.fresh * self.settings.samples as f64) as usize;
        for sample in self.plans.len()..self.settings.samples {
            let actions = if sample <= fresh {
                self.variation(&self.rest(), self.settings.widest, rng)
            } else {
                // The best plan is varied most often.
                let rank = (self.plans.len() as f64 * rng.random::<f64>().powi(2)) as usize;
                let width = self.settings.widest * FINEST.powf(rng.random::<f64>());
                self.variation(&self.plans[rank].actions, width, rng)
            };
            self.consider(actions);
        }
        Ok(self.executed(rng))
    }
}

/// A plan's actions from the second on, held at their end.
fn shifted(mut actions: Actions) -> Actions {
    actions.rotate_left(1);
    if let [.., end, first] = actions.as_mut_slice() {
        first.clone_from(end);
    }
    actions
}
