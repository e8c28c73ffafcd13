//! The updates before the actor's first episode, and those after each beginning anew: no control step is lived through meanwhile, so that without a count of their own they look like a
//! hang. In: the lines of a run. Out: how many of them are made.

use vibes_train::online::options::OnlineOptions;
use vibes_train::online::{Line, OnlineState};
use vibes_train::run::Run;

/// Where these updates stand.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct First {
    /// Updates made before them.
    before: u64,
    /// How many they are.
    count: u64,
    /// What comes after them.
    until: &'static str,
    /// Updates made in all.
    made: u64,
    /// How many they are after a beginning anew.
    after_reset: u64,
}

impl First {
    pub(super) fn of(options: &OnlineOptions) -> Self {
        let (count, after_reset) = (options.first_updates, options.reset_updates);
        Self { before: 0, count, until: "the actor's first episode", made: 0, after_reset }
    }

    /// Takes up what a run's newest checkpoint says; without one there is nothing to go on with.
    pub(super) fn go_on(&mut self, run: &Run) {
        let state = run.newest_model().ok().and_then(|model| std::fs::read(model.with_file_name("online.json")).ok());
        let state: Option<OnlineState> = state.and_then(|bytes| serde_json::from_slice(&bytes).ok());
        if let Some(state) = state {
            self.go_on_from(&state);
        }
    }

    fn go_on_from(&mut self, state: &OnlineState) {
        if state.resets > 0 {
            self.made = state.updates_before_reset;
            self.reset(self.after_reset);
        }
        self.made = state.updates;
    }

    /// All begins anew.
    pub(super) fn reset(&mut self, count: u64) {
        (self.before, self.count, self.until) = (self.made, count, "the next episode");
    }

    /// `first updates: 80 of 1000, before the actor's first episode` where a line is of such updates: of those that no episode was lived through beside.
    pub(super) fn after(&mut self, line: &Line) -> Option<String> {
        let learned = line.learned.as_ref().map(|learned| learned.world.update);
        self.made = learned.or(line.update).unwrap_or(self.made);
        let is_first = learned.is_some() && line.training_return.is_none();
        let made = self.made.saturating_sub(self.before);
        is_first.then(|| format!("first updates: {made} of {}, before {}", self.count, self.until))
    }
}

#[cfg(test)]
mod tests {
    use vibes_train::metrics::Row;
    use vibes_train::online::Learned;
    use vibes_train::online::prepare::{default_options, default_world};

    use super::*;

    fn learned(update: u64) -> Learned {
        Learned {
            world: Row { update, ..Row::default() },
            imagined_return: 0.0,
            value: 0.0,
            value_over_bound: 0.0,
            return_scale: 1.0,
            entropy: 0.0,
            disagreement: None,
            recorded_disagreement: None,
            critic_loss: 0.0,
            actor_gradient_norm: None,
            critic_gradient_norm: 0.0,
            foreseen_reward: 0.0,
            recorded_reward: 0.0,
            foresight: None,
        }
    }

    #[test]
    fn updates_that_no_episode_is_beside_are_counted() {
        let mut options = default_options(default_world("cartpole-swingup").unwrap(), false);
        options.first_updates = 1000;
        let mut first = First::of(&options);
        let line = |update: u64, training_return: Option<f64>| Line {
            protocol: None,
            control_steps: 5000,
            agent_steps: 5000,
            episodes: 5,
            training_return,
            update: None,
            learned: Some(learned(update)),
            pace: None,
        };
        let said = first.after(&line(80, None));
        assert_eq!(said.as_deref(), Some("first updates: 80 of 1000, before the actor's first episode"));
        assert_eq!(first.after(&line(1300, Some(7.5))), None);
        first.reset(400);
        let said = first.after(&line(1320, None));
        assert_eq!(said.as_deref(), Some("first updates: 20 of 400, before the next episode"));
        // Gone on with in the updates after a beginning anew, and where the next one is due at once.
        let mut again = First::of(&OnlineOptions { reset_updates: 400, ..options.clone() });
        again.go_on_from(&OnlineState {
            updates: 1320,
            resets: 1,
            updates_before_reset: 1300,
            ..OnlineState::default()
        });
        let said = again.after(&line(1340, None));
        assert_eq!(said.as_deref(), Some("first updates: 40 of 400, before the next episode"));
        let mut due = First::of(&options);
        due.go_on_from(&OnlineState { updates: 1300, ..OnlineState::default() });
        due.reset(400);
        let said = due.after(&line(1320, None));
        assert_eq!(said.as_deref(), Some("first updates: 20 of 400, before the next episode"));
    }
}
