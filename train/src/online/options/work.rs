//! How much a run does: its episodes, the updates that these pay for, and where it begins anew. In: the options of a run that begins. Out: counts, or what of it would never come to pass.

use super::OnlineOptions;
use crate::error::{Result, TrainError};

impl OnlineOptions {
    /// Updates that one agent step pays for, when an update sees `rows` rows.
    pub fn updates_per_step(&self, rows: usize) -> f64 {
        self.rows_per_step / rows.max(1) as f64
    }

    /// Random episodes at the beginning: where no recordings are given one at least, since there is nothing else to learn from.
    fn random_episodes(&self, is_given: bool) -> u64 {
        u64::from(if is_given { self.prefill } else { self.prefill.max(1) })
    }

    /// Control steps of an episode.
    fn episode_control_steps(&self) -> u64 {
        (u64::from(self.world.steps) * u64::from(self.world.action_repeat)).max(1)
    }

    /// After how many episodes all begins anew: a run stops for it at the end of the episode in which the control steps asked for are reached.
    fn reset_episodes(&self) -> impl Iterator<Item = u64> {
        let episode = self.episode_control_steps();
        self.reset_at.iter().map(move |at| at.div_ceil(episode))
    }

    /// Whether world model, actor and critic begin anew after so many control steps, having done so `resets` times; at the end of a run there is nothing to begin for.
    pub fn is_reset_due(&self, resets: u64, control_steps: u64) -> bool {
        let due = self.reset_at.get(resets as usize);
        control_steps < self.control_steps && due.is_some_and(|at| control_steps >= *at)
    }

    /// Updates that a run makes, when an update sees `rows` rows: until it begins anew for the first time, from then on to the next, and so on to its end. The random episodes pay for none,
    /// and what the last episode pays for is not made any more.
    pub(super) fn updates_by_life(&self, rows: usize, is_given: bool) -> Vec<u64> {
        let random = self.random_episodes(is_given);
        let paid = |episodes: u64| {
            let paying = episodes.saturating_sub(1).saturating_sub(random) * u64::from(self.world.steps.max(1));
            (paying as f64 * self.updates_per_step(rows)) as u64
        };
        let episodes = self.control_steps.div_ceil(self.episode_control_steps());
        let ends: Vec<u64> = self.reset_episodes().filter(|end| *end < episodes).chain([episodes]).collect();
        let begins = [0].into_iter().chain(ends.iter().copied());
        let first = [self.first_updates].into_iter().chain(std::iter::repeat(self.reset_updates));
        let lives = begins.zip(&ends).zip(first);
        lives.map(|((begin, end), first)| first.saturating_add(paid(*end).saturating_sub(paid(begin)))).collect()
    }

    /// Updates that a run makes between two beginnings where it makes the fewest, those before the next episode included.
    pub fn fewest_updates(&self, rows: usize, is_given: bool) -> u64 {
        self.updates_by_life(rows, is_given).into_iter().min().unwrap_or(0)
    }

    /// Updates in which the actor is held still unless another number is asked for.
    pub fn default_critic_first(is_given: bool) -> u64 {
        if is_given { 500 } else { 100 }
    }

    /// That a new run, with or without recordings given, comes to what was asked for: an actor that acts, beginnings anew, and an actor that sees the short first horizon if there is one.
    ///
    /// # Errors
    /// The control steps are over before the random episodes are, a beginning anew would have nothing before or after it, or the short horizon is over before the actor moves.
    pub fn check_new(&self, is_given: bool) -> Result<()> {
        let episodes = self.random_episodes(is_given);
        let random = episodes * self.episode_control_steps();
        if episodes > 0 && self.control_steps <= random {
            let asked = self.control_steps;
            return Err(TrainError::Options(format!(
                "--control-steps is {asked}, and the {episodes} random episodes before the actor's (--prefill) take {random}; it must be above that"
            )));
        }
        self.check_resets(episodes)?;
        if self.short_for > 0 && self.short_horizon == 0 {
            let text = "--short-for has no effect without --short-horizon; leave it out, or say how short";
            return Err(TrainError::Options(text.to_owned()));
        }
        if self.short_horizon > 0 && self.short_for <= self.critic_first {
            let (updates, critic) = (self.short_for, self.critic_first);
            return Err(TrainError::Options(format!(
                "--short-for is {updates}, and the actor moves after {critic} updates (--critic-first); it must be above that, or leave out --short-horizon"
            )));
        }
        Ok(())
    }

    /// That an episode with the actor lies before, between and after the beginnings anew: what is learned where none does would be thrown away at once.
    fn check_resets(&self, random: u64) -> Result<()> {
        let (episode, asked) = (self.episode_control_steps(), self.control_steps);
        let wrong = |text: String| Err(TrainError::Options(text));
        let mut before = random;
        for (at, end) in self.reset_at.iter().zip(self.reset_episodes()) {
            if end >= asked.div_ceil(episode) {
                return wrong(format!(
                    "--reset-at has {at}, the episode of which ends after {}, and the run is over after {asked} control steps; it must be below that",
                    end.saturating_mul(episode)
                ));
            }
            if end <= before {
                let what = if before == random {
                    "the random episodes (--prefill)"
                } else {
                    "the episode of the one before it"
                };
                return wrong(format!(
                    "--reset-at has {at}, and {what} ends after {} control steps; it must be above that",
                    before * episode
                ));
            }
            before = end;
        }
        Ok(())
    }

    /// That the actor of a new run, whose updates see `rows` rows, moves before the run is over and after each beginning anew, where it was asked for how long it is held still. A trial that
    /// is shorter than the number that holds by default is told so and goes on.
    ///
    /// # Errors
    /// The critic has every update for itself.
    pub fn check_actor_moves(&self, rows: usize, is_given: bool) -> Result<()> {
        let (critic, updates) = (self.critic_first, self.fewest_updates(rows, is_given));
        if critic < updates.max(1) || critic == Self::default_critic_first(is_given) {
            return Ok(());
        }
        let made = self.where_fewest();
        Err(TrainError::Options(format!(
            "--critic-first is {critic}, and about {updates} updates are made {made}; it must be below that, or the actor does not move"
        )))
    }

    /// Where the fewest updates between two beginnings are counted, in words.
    pub fn where_fewest(&self) -> &'static str {
        if self.reset_at.is_empty() { "in all" } else { "between two beginnings, where they are fewest (--reset-at)" }
    }
}
