//! The planner: predictive sampling on the true simulator with the task's own reward, which needs no training and works on every task.
//!
//! At every agent step it takes the last plan, shifted by a step, and random variations of it, rolls each through the simulator from the present
//! state, and executes the first action of the best (Howell et al. 2022, "Predictive Sampling"). A plan is a spline through a few knots, so
//! that samples are smooth enough to move a body somewhere.

use rand::{Rng, RngCore};

use crate::gaussian::standard_normal;
use crate::physics::Snapshot;
use crate::{Environment, EnvironmentOptions, Result, Start};

/// How far and how hard the planner looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannerSettings {
    /// Agent steps a plan covers.
    pub horizon: usize,
    /// Knots of a plan's spline, evenly spaced over the horizon.
    pub knots: usize,
    /// Plans tried at every agent step, the last step's among them.
    pub samples: usize,
    /// Standard deviation of a variation's knots, as a share of half the action range.
    pub spread: f64,
    /// Share of the samples that are drawn anew around zero instead of around the last plan, so that no habit lasts for ever.
    pub fresh: f64,
}

impl PlannerSettings {
    /// Settings that were found to work for a task; others get those of `walker-walk`.
    pub fn for_task(task: &str) -> Self {
        let settings = |horizon, knots, samples, spread, fresh| Self { horizon, knots, samples, spread, fresh };
        match task {
            "ball_in_cup-catch" => settings(12, 5, 24, 0.5, 0.25),
            "cartpole-swingup" => settings(20, 6, 32, 0.5, 0.25),
            "cheetah-run" => settings(15, 5, 40, 0.4, 0.1),
            "finger-spin" => settings(16, 6, 24, 0.5, 0.2),
            "reacher-easy" => settings(15, 5, 32, 0.4, 0.25),
            _ => settings(16, 5, 24, 0.4, 0.1),
        }
    }
}

/// The finest variations are this share of the coarsest; finding a way needs coarse ones, keeping still in a goal fine ones.
const FINEST: f64 = 1.0 / 30.0;

/// A planner with its own simulation of the task.
#[derive(Debug)]
pub struct Planner {
    settings: PlannerSettings,
    noise: f64,
    simulation: Environment,
    now: Snapshot,
    /// The last plan `[horizon, action]`, in the action's bounds.
    plan: Vec<Vec<f64>>,
    /// The middle of the action's bounds and half their width.
    middle: Vec<f64>,
    half: Vec<f64>,
}

impl Planner {
    /// A planner for a task; `noise` is the standard deviation added to the executed action, as a share of half the action range.
    pub fn new(task: &str, options: EnvironmentOptions, noise: f64) -> Result<Self> {
        Ok(Self::with_settings(Environment::new(task, options)?, PlannerSettings::for_task(task), noise))
    }

    /// The same with other settings.
    pub fn with_settings(simulation: Environment, settings: PlannerSettings, noise: f64) -> Self {
        Self {
            settings,
            noise,
            simulation,
            now: Snapshot::default(),
            plan: Vec::new(),
            middle: Vec::new(),
            half: Vec::new(),
        }
    }

    /// Forgets the last plan and takes over an episode's model.
    pub fn begin(&mut self, start: &Start) -> Result<()> {
        self.simulation.reset_to(start)?;
        let bounds = self.simulation.action_spec();
        self.middle = bounds.min.iter().zip(&bounds.max).map(|(low, high)| f64::midpoint(*low, *high)).collect();
        self.half = bounds.min.iter().zip(&bounds.max).map(|(low, high)| (high - low) / 2.0).collect();
        self.plan = vec![self.middle.clone(); self.settings.horizon];
        Ok(())
    }

    /// Plans from the environment's present state and returns the action to execute.
    pub fn act(&mut self, environment: &Environment, rng: &mut impl RngCore) -> Vec<f64> {
        environment.save(&mut self.now);
        let mut best = self.shifted();
        let mut best_value = self.value(&best);
        let last = best.clone();
        for sample in 1..self.settings.samples {
            let is_fresh = (sample as f64) < self.settings.fresh * self.settings.samples as f64;
            let plan = if is_fresh {
                self.variation(&vec![self.middle.clone(); last.len()], 1.0, rng)
            } else {
                let spread = self.settings.spread * FINEST.powf(rng.random::<f64>());
                self.variation(&last, spread, rng)
            };
            let value = self.value(&plan);
            if value > best_value {
                (best, best_value) = (plan, value);
            }
        }
        let mut action = best[0].clone();
        self.plan = best;
        if self.noise > 0.0 {
            for (number, half) in action.iter_mut().zip(&self.half) {
                *number += self.noise * half * standard_normal(rng);
            }
            self.clip(&mut action);
        }
        action
    }

    /// The last plan from its second action on, held at its end.
    fn shifted(&self) -> Vec<Vec<f64>> {
        let mut plan = self.plan[1..].to_vec();
        plan.push(self.plan[self.plan.len() - 1].clone());
        plan
    }

    /// A plan plus a smooth random change: normal numbers at the knots, straight lines between them.
    fn variation(&self, plan: &[Vec<f64>], spread: f64, rng: &mut impl RngCore) -> Vec<Vec<f64>> {
        let changes: Vec<Vec<f64>> = (0..self.settings.knots)
            .map(|_| self.half.iter().map(|half| spread * half * standard_normal(rng)).collect())
            .collect();
        let last = changes.len() - 1;
        let knots_per_step = last as f64 / (plan.len().max(2) - 1) as f64;
        let vary = |(step, action): (usize, &Vec<f64>)| {
            let place = step as f64 * knots_per_step;
            let left = (place as usize).min(last);
            let (right, share) = ((left + 1).min(last), place - left as f64);
            let changed = action
                .iter()
                .enumerate()
                .map(|(axis, number)| number + (1.0 - share) * changes[left][axis] + share * changes[right][axis]);
            let mut changed: Vec<f64> = changed.collect();
            self.clip(&mut changed);
            changed
        };
        plan.iter().enumerate().map(vary).collect()
    }

    fn clip(&self, action: &mut [f64]) {
        for ((number, middle), half) in action.iter_mut().zip(&self.middle).zip(&self.half) {
            *number = number.clamp(middle - half, middle + half);
        }
    }

    /// The rewards a plan earns from the present state. A plan that breaks the simulation earns what it got until then.
    fn value(&mut self, plan: &[Vec<f64>]) -> f64 {
        self.simulation.restore(&self.now);
        plan.iter().map_while(|action| self.simulation.step(action).ok()).sum()
    }
}
