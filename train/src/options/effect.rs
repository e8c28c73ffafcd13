//! Options that have no effect: changed, although nothing of the run looks at them. In: options, and those that they were laid over. Out: which, and why. A value that one of the
//! presets has passes, since a run's config.toml says every value of the preset that it began with and not its name.

use toml::Table;

use super::Options;
use super::presets::PRESETS;
use crate::error::{Result, TrainError};
use crate::learners::{auxiliary, objective};

impl Options {
    /// A value that a preset has may stand: a run's config.toml says all of its own.
    ///
    /// # Errors
    /// An option differs from `base`'s, and neither the objective nor a term that is on looks at it.
    pub fn check_effect(&self, base: &Self) -> Result<()> {
        match self.idle(base) {
            Some((flag, why)) => Err(TrainError::Options(format!("--{flag} has no effect: {why}; leave it out"))),
            None => Ok(()),
        }
    }

    /// The first of these entries that has been changed from `base`'s value to one that no preset has.
    pub fn first_changed<'a>(&self, base: &Self, keys: &[&'a str]) -> Option<&'a str> {
        let changes = Changes::of(self, base)?;
        keys.iter().copied().find(|key| changes.has(key))
    }

    /// Weights of the dynamics term that nothing looks at: where it does not reach the latents, or shapes them by a term of the objective's own. Terms that wait rise with it.
    pub(super) fn unread(&self) -> Vec<&'static str> {
        let weighs = self.objective.dynamics_shape_latents();
        let rises = weighs || auxiliary::asked(self).any(|term| term.waits());
        [("dynamics_weight", weighs), ("dynamics_warmup", rises)]
            .into_iter()
            .filter_map(|(key, is_read)| (!is_read).then_some(key))
            .collect()
    }

    fn idle(&self, base: &Self) -> Option<(String, String)> {
        let changes = Changes::of(self, base)?;
        let (mine, theirs) = (&changes.mine, &changes.theirs);
        let changed = |key: &str| changes.has(key);
        let name = self.objective.to_string();
        let is_read = |flag: &str| self.objective.reads().iter().any(|option| option.flag == flag);
        let own = objective::REGISTRY.iter().flat_map(|definition| definition.options());
        let mut own = own.filter(|option| changed(&option.key()) && !is_read(option.flag));
        if let Some(option) = own.next() {
            return Some((option.flag.to_owned(), format!("the objective {name} does not look at it")));
        }
        let off = auxiliary::REGISTRY.iter().filter(|term| term.weight(self) <= 0.0);
        let mut of_terms = off.flat_map(|term| term.options().iter().map(move |option| (option, term)));
        // What turns a term off has that effect: with the base's value it would be on.
        let turns_off = |key: &str, term: &dyn auxiliary::Auxiliary| {
            let mut back = mine.clone();
            back.extend(theirs.get(key).map(|value| (key.to_owned(), value.clone())));
            back.try_into::<Self>().is_ok_and(|back| term.weight(&back) > 0.0)
        };
        let has_no_effect = |key: &str, term: &dyn auxiliary::Auxiliary| changed(key) && !turns_off(key, term);
        if let Some((option, term)) = of_terms.find(|(option, term)| has_no_effect(&option.key(), **term)) {
            return Some((option.flag.to_owned(), format!("the term {} is off", term.metric())));
        }
        let without = |key: &str, there: bool, why: &str| {
            (!there && changed(key)).then(|| (key.replace('_', "-"), format!("the objective {name} {why}")))
        };
        let (adversary, waits) = (self.objective.networks(self, 1).adversary, self.objective.gate(self).is_some());
        let unread = self.unread();
        let unweighted = "does not weigh its dynamics by it";
        without("adversary_lr", adversary, "has no adversary")
            .or_else(|| without("dynamics_weight", !unread.contains(&"dynamics_weight"), unweighted))
            .or_else(|| without("dynamics_warmup", !unread.contains(&"dynamics_warmup"), unweighted))
            .or_else(|| without("dynamics_start", waits, "does not wait"))
            .or_else(|| without("dynamics_after", waits, "does not wait"))
    }
}

/// Options beside those that they were laid over, and every preset's.
struct Changes {
    mine: Table,
    theirs: Table,
    presets: [Table; PRESETS.len()],
}

impl Changes {
    /// None where options cannot be written as a table, which all of them can.
    fn of(mine: &Options, theirs: &Options) -> Option<Self> {
        let named: Table = [("objective".to_owned(), mine.objective.to_string().into())].into_iter().collect();
        let presets = PRESETS.map(|(preset, _)| {
            let options = Options::resolve(preset, &[("the preset", named.clone())]).ok();
            options.and_then(|options| Table::try_from(options).ok()).unwrap_or_default()
        });
        Some(Self { mine: Table::try_from(mine).ok()?, theirs: Table::try_from(theirs).ok()?, presets })
    }

    /// Whether an entry has another value than before, and one that no preset has.
    fn has(&self, key: &str) -> bool {
        let value = self.mine.get(key);
        value != self.theirs.get(key) && self.presets.iter().all(|preset| preset.get(key) != value)
    }
}

#[cfg(test)]
mod tests {
    use toml::Value;

    use super::*;
    use crate::learners::objective::Objective;
    use crate::settings::own::{Declared, Kind};

    /// Another value than the option's default.
    fn other(option: &Declared) -> Value {
        match option.kind {
            Kind::Number { default } => Value::Float(default + 0.125),
            // Steps have an upper limit.
            Kind::Whole { default } => {
                Value::Integer(if default > 1 { default as i64 - 1 } else { default as i64 + 1 })
            }
            Kind::Choice { default, among } => {
                Value::String(among.iter().find(|word| **word != default).unwrap().to_string())
            }
        }
    }

    fn laid(objective: Objective, key: &str, value: Value) -> Result<()> {
        let layer = |entries: Vec<(&str, Value)>| -> Table {
            entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
        };
        let named = Value::String(objective.to_string());
        let base = Options::resolve("tiny", &[("a test", layer(vec![("objective", named.clone())]))])?;
        let options = Options::resolve("tiny", &[("a test", layer(vec![("objective", named), (key, value)]))])?;
        options.check_effect(&base)
    }

    #[test]
    fn a_term_that_is_turned_off_refuses_its_other_options() {
        let base = Options::resolve("small", &[]).unwrap();
        let fault = |text: &str| {
            let layer = [("a test", text.parse::<Table>().unwrap())];
            let refused = Options::resolve("small", &layer).unwrap().check_effect(&base);
            refused.map_or_else(|error| error.to_string(), |()| String::new())
        };
        assert_eq!((fault("inverse_weight = 0.0"), fault("reward_steps = 0")), (String::new(), String::new()));
        assert!(fault("inverse_weight = 0.0\ninverse_steps = 3").contains("--inverse-steps has no effect"));
        assert!(fault("reward_steps = 0\nreward_steps_weight = 0.5").contains("--reward-steps-weight has no effect"));
    }

    #[test]
    fn a_value_that_some_preset_has_is_no_change() {
        let base = Options::resolve("small", &[]).unwrap();
        let first = |text: &str| {
            let layer = [("a test", text.parse::<Table>().unwrap())];
            Options::resolve("small", &layer).unwrap().first_changed(&base, &["updates", "log_every", "minutes"])
        };
        assert_eq!((first("updates = 200\nlog_every = 5"), first("lr = 0.5")), (None, None));
        assert_eq!((first("updates = 201"), first("minutes = 4.0")), (Some("updates"), Some("minutes")));
    }

    #[test]
    fn an_objective_refuses_every_option_that_only_others_read() {
        for chosen in Objective::all() {
            for definition in objective::REGISTRY {
                for option in definition.options() {
                    let is_read = chosen.reads().iter().any(|read| read.flag == option.flag);
                    let answer = laid(chosen, &option.key(), other(option));
                    assert_eq!(answer.is_ok(), is_read, "{chosen} and --{}: {answer:?}", option.flag);
                }
            }
            let networks = chosen.networks(&Options::preset("tiny").unwrap(), 1);
            assert_eq!(laid(chosen, "adversary_lr", Value::Float(0.125)).is_ok(), networks.adversary, "{chosen}");
            for (key, value) in [("dynamics_weight", Value::Float(0.77)), ("dynamics_warmup", Value::Integer(77))] {
                assert_eq!(laid(chosen, key, value).is_ok(), chosen.dynamics_shape_latents(), "{chosen}, {key}");
            }
            assert!(laid(chosen, "hidden", Value::Integer(40)).is_ok());
        }
    }

    #[test]
    fn a_term_that_is_off_refuses_what_does_not_turn_it_on() {
        for term in auxiliary::REGISTRY {
            for option in term.options() {
                let table: Table = [(option.key(), other(option))].into_iter().collect();
                let on = Options::resolve("tiny", &[("a test", table)]).is_ok_and(|on| term.weight(&on) > 0.0);
                let answer = laid(Objective::default(), &option.key(), other(option));
                assert_eq!(answer.is_ok(), on, "--{}: {answer:?}", option.flag);
            }
        }
    }
}
