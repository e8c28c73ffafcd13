//! The map that lies in the output folder already. In: its file, and how the map that is asked for would be made. Out: whether it is that map, another one
//! of the same rows, which may stand in for it, or one whose place will be taken.

use std::path::Path;

use serde_json::{Value, json};

use super::super::session::{Session, relative_paths};
use super::onto::OldMap;
use super::{MapOptions, checksum};
use crate::output::MapTable;

/// The version of the layouts: one more whenever the same latents, options and seed would give another map, so that those of older programs are made anew.
const LAYOUT: u32 = 1;

/// How a map is made, as its file holds it: the layout's version, options, seed, and the latents' checksum, twice where they were moved to be placed on another map.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Recipe(Value);

impl Recipe {
    /// That of the session's latents with these options; `latents` is their checksum as the file holds them, before they were moved to the origin of the old map's.
    pub(super) fn new(options: &MapOptions, session: &Session, latents: &str, old: Option<&OldMap>) -> Self {
        let mut recipe = json!({
            "layout": LAYOUT, "options": relative_paths(options.json(), &session.out), "seed": session.seed,
            "latents": latents, "onto": old.map(OldMap::checksum),
        });
        // Where they were moved to tells maps on old ones of other origins apart; all others are known without it, as before.
        if let Some(moved) = old.map(|_old| checksum(&session.latents)).filter(|moved| moved != latents) {
            recipe["moved"] = moved.into();
        }
        Self(recipe)
    }

    /// As it stands in the file.
    pub(super) fn text(&self) -> String {
        self.0.to_string()
    }

    /// What a reader of the outputs must know to make the map again.
    pub(super) fn about(&self) -> Value {
        json!({ "options": self.option_values(), "seed": self.0["seed"] })
    }

    /// An option.
    pub(super) fn option(&self, name: &str) -> &Value {
        &self.0["options"][name]
    }

    /// In what a map that was made by this recipe differs from one by another: `min_dist 0.5, seed 3`.
    pub(super) fn differences(&self, other: &Self) -> String {
        let options = self.option_values().as_object().into_iter().flatten();
        let differing = options.filter(|(name, value)| other.option(name) != *value);
        let seed = ("seed", &self.0["seed"]);
        let differing = differing.map(|(name, value)| (name.as_str(), value));
        let all = differing.chain(Some(seed).filter(|seed| other.0["seed"] != *seed.1));
        let texts = all.map(|(name, value)| match value {
            Value::Null => format!("{name} as usual"),
            // Where the other map lies is told as seen from the folder, which would mislead whoever reads it elsewhere.
            Value::String(_) if name.starts_with("onto") => format!("{name} another"),
            Value::String(text) => format!("{name} {text}"),
            other => format!("{name} {other}"),
        });
        texts.collect::<Vec<_>>().join(", ")
    }

    fn option_values(&self) -> &Value {
        &self.0["options"]
    }
}

/// What is there.
#[derive(Debug)]
pub(super) enum There {
    /// No map that can be read.
    Nothing,
    /// The map that is asked for.
    Same(MapTable),
    /// A map of the same latents and rows, made in another way.
    OtherWay(MapTable, Recipe),
    /// A map of something else, or of an older program: what is to be said of it.
    Other(&'static str),
}

impl There {
    /// Looks at the map that a file holds.
    pub(super) fn at(path: &Path, recipe: &Recipe, session: &Session) -> Self {
        let Some(map) = MapTable::read(path) else { return Self::Nothing };
        let made = Recipe(serde_json::from_str(&map.recipe).unwrap_or(Value::Null));
        let l = &session.latents;
        if made.0["latents"] != recipe.0["latents"] || map.episode != l.episode || map.step != l.step {
            return Self::Other("of other latents or rows");
        }
        if made.0["layout"] != recipe.0["layout"] {
            return Self::Other("by another version of this program");
        }
        if made == *recipe { Self::Same(map) } else { Self::OtherWay(map, made) }
    }

    /// That the map took the place of another one; none if there was none.
    pub(super) fn replaced(&self) -> Option<String> {
        let what = match self {
            Self::Nothing | Self::Same(_) => return None,
            Self::OtherWay(..) => "made with other options",
            Self::Other(what) => what,
        };
        Some(format!(
            "a map.arrow {what} was there and was replaced: figures and numbers of other verbs in this folder may show the old map"
        ))
    }
}
