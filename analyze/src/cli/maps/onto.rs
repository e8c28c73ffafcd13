//! New latents on an old map: the old points stay where they are, and the map's own options hold.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use rand::Rng;
use serde_json::Value;
use vibes_data::Latents;

use super::super::wrong;
use super::checksum;
use super::layout::place;
use crate::input::{InputError, Origin, find_latents, read_rows};
use crate::output::MapTable;
use vibes_measure::Table;
use vibes_measure::neighbours::{Metric, Space};
use vibes_measure::umap::{Position, UmapOptions, transform};

/// An old map with the latents it is of.
pub(super) struct OldMap {
    pub(super) path: PathBuf,
    pub(super) map: MapTable,
    pub(super) metric: Metric,
    /// What was taken away from its latents.
    pub(super) origin: Origin,
    options: UmapOptions,
    latents: Latents,
}

impl OldMap {
    /// Opens a map and its latents: those named, or those that the map names. Of these it takes the rows that the map has, which may be some of them only.
    pub(super) fn open(path: &Path, named: Option<&Path>) -> anyhow::Result<Self> {
        let refuse = |fact: &str| InputError::NotAMap { fact: fact.into(), path: path.into() };
        let map = MapTable::read(path).ok_or_else(|| refuse("no readable map"))?;
        let recipe: Value =
            serde_json::from_str(&map.recipe).map_err(|_e| refuse("a map that does not say how it was made"))?;
        let given = &recipe["options"];
        if given["method"] != "umap" || !given["onto"].is_null() {
            return Err(refuse("a map by PCA or t-SNE, or itself placed on another").into());
        }
        let number = |name: &str, default: f64| given[name].as_f64().unwrap_or(default);
        let usual = UmapOptions::default();
        let options = UmapOptions {
            neighbours: given["neighbours"].as_u64().map(|n| n as usize),
            min_dist: number("min_dist", usual.min_dist),
            spread: number("spread", usual.spread),
            epochs: given["epochs"].as_u64().map(|n| n as usize),
            ..usual
        };
        let metric = Metric::from_str(given["metric"].as_str().unwrap_or("euclidean"))?;
        let missing = || InputError::NoOldLatents { named: map.latents.clone(), path: path.into() };
        let source = match named {
            Some(named) => named.to_path_buf(),
            None => find_latents(&map.latents, path).ok_or_else(missing)?,
        };
        let (read, origin) = read_rows(&source, &map.episode, &map.step)?;
        let latents = read.latents;
        if recipe["latents"] != checksum(&latents).as_str() {
            return Err(wrong(format!(
                "the map is of other latents (they have changed since, or others were named); make it anew with `vibes-analyze umap`: {}",
                source.display()
            )));
        }
        Ok(Self { path: path.into(), map, metric, origin, options, latents })
    }

    /// What the map is, for the recipe of what is placed on it.
    pub(super) fn checksum(&self) -> String {
        let positions = self.map.positions.iter().flatten().flat_map(|x| x.to_le_bytes());
        vibes_data::sha256_hex(&self.map.recipe.bytes().chain(positions).collect::<Vec<u8>>())
    }

    /// Where new latents lie on it.
    pub(super) fn place(&self, new: &Latents, rng: &mut impl Rng) -> anyhow::Result<Vec<Position>> {
        let l = &self.latents;
        if new.dims != l.dims {
            return Err(wrong(format!(
                "these latents have {} dimensions, those of the map {}; a map takes only latents of the model it was made of: {}",
                new.dims,
                l.dims,
                self.path.display()
            )));
        }
        let space = Space::new(Table::new(l.dims, &l.latent, &l.episode, &l.step)?, self.metric)?;
        let rows: Vec<usize> = (0..new.len()).collect();
        Ok(place(new, &rows, |new| transform(&space, &self.map.positions, new, self.options, rng))?)
    }
}
