//! Options that an objective or an auxiliary term declares for itself: name, kind, default, help. In: declarations, and tables that were typed or read. Out:
//! a value for every declared option. They lie in `config.toml` and on the command line beside all others.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use toml::Value;

use crate::error::{Result, TrainError};

/// One declared option.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Declared {
    /// Its flag without the dashes before it; in files the dashes inside are underscores.
    pub flag: &'static str,
    /// What it may be, and what it is by default.
    pub kind: Kind,
    /// A line of help.
    pub help: &'static str,
}

/// What an option may be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A finite number, 0 or above.
    Number {
        /// Where none is given.
        default: f64,
    },
    /// A whole number, 0 or above.
    Whole {
        /// Where none is given.
        default: u64,
    },
    /// One of some words.
    Choice {
        /// Where none is given.
        default: &'static str,
        /// The words.
        among: &'static [&'static str],
    },
}

/// The values of all declared options, by the names they have in files.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Own(BTreeMap<String, Value>);

impl Declared {
    /// Its name in files.
    pub fn key(&self) -> String {
        self.flag.replace('-', "_")
    }

    fn default(&self) -> Value {
        match self.kind {
            Kind::Number { default } => Value::Float(default),
            Kind::Whole { default } => Value::Integer(i64::try_from(default).unwrap_or(i64::MAX)),
            Kind::Choice { default, .. } => Value::String(default.to_owned()),
        }
    }

    /// A value that was written in a file or typed, as this option's kind.
    ///
    /// # Errors
    /// It is of another kind, or not among the choices.
    pub fn parse(&self, value: &Value) -> Result<Value> {
        let refuse = |wanted: &str| TrainError::Options(format!("--{} is {value}; it must be {wanted}", self.flag));
        match (self.kind, value) {
            (Kind::Number { .. }, Value::Float(number)) if number.is_finite() && *number >= 0.0 => Ok(value.clone()),
            (Kind::Number { .. }, Value::Integer(whole)) if *whole >= 0 => Ok(Value::Float(*whole as f64)),
            (Kind::Whole { .. }, Value::Integer(whole)) if *whole >= 0 => Ok(value.clone()),
            (Kind::Choice { among, .. }, Value::String(word)) if among.contains(&word.as_str()) => Ok(value.clone()),
            (Kind::Number { .. }, _) => Err(refuse("a number, 0 or above")),
            (Kind::Whole { .. }, _) => Err(refuse("a whole number, 0 or above")),
            (Kind::Choice { among, .. }, _) => Err(refuse(&format!("one of {}", among.join(", ")))),
        }
    }
}

impl Own {
    /// The defaults of these options.
    pub fn defaults(declared: impl Iterator<Item = Declared>) -> Self {
        Self(declared.map(|option| (option.key(), option.default())).collect())
    }

    /// Checks every value, and that each is of these options.
    ///
    /// # Errors
    /// A value that its option cannot have.
    pub fn checked(self, declared: impl Iterator<Item = Declared>) -> Result<Self> {
        let known: BTreeMap<String, Declared> = declared.map(|option| (option.key(), option)).collect();
        let parse = |(key, value): (String, Value)| match known.get(&key) {
            Some(option) => Ok((key, option.parse(&value)?)),
            None => Err(TrainError::Options(format!("no option `{key}`"))),
        };
        Ok(Self(self.0.into_iter().map(parse).collect::<Result<_>>()?))
    }

    /// The value of a number.
    pub fn number(&self, option: &Declared) -> f64 {
        self.value(option).as_float().unwrap_or(0.0)
    }

    /// The value of a whole number.
    pub fn whole(&self, option: &Declared) -> u64 {
        self.value(option).as_integer().and_then(|whole| u64::try_from(whole).ok()).unwrap_or(0)
    }

    /// The value of a choice.
    pub fn text(&self, option: &Declared) -> &str {
        match (self.0.get(&option.key()), option.kind) {
            (Some(Value::String(word)), _) => word,
            (_, Kind::Choice { default, .. }) => default,
            _ => "",
        }
    }

    /// As it was given, or the default: runs of before the option was declared do not name it.
    fn value(&self, option: &Declared) -> Value {
        self.0.get(&option.key()).and_then(|value| option.parse(value).ok()).unwrap_or_else(|| option.default())
    }
}
