//! `map.arrow`: where every row lies on the map. Columns `episode`, `step` (uint32), `x`, `y` (float32); the schema's metadata says how the
//! map was made, so that a map that is still right is read back instead of computed again.

use std::path::Path;

use arrow::array::AsArray;
use arrow::datatypes::{Float32Type, UInt32Type};
use vibes_data::read_table;

use super::{Column, write_table};

/// Metadata key of the description of how the map was made.
const RECIPE: &str = "vibes.map";
/// Metadata key of the map's quality, as JSON.
const QUALITY: &str = "vibes.quality";
/// Metadata key of the path of the latents that the map is of.
const LATENTS: &str = "vibes.latents";

/// A map with its row keys.
#[derive(Clone, Debug, PartialEq)]
pub struct MapTable {
    /// `[rows]`.
    pub episode: Vec<u32>,
    /// `[rows]`.
    pub step: Vec<u32>,
    /// `[rows, 2]`.
    pub positions: Vec<[f32; 2]>,
    /// How it was made: method, options, seed and the latents' checksum.
    pub recipe: String,
    /// Its quality, as JSON.
    pub quality: String,
    /// The path of its latents, as it was named.
    pub latents: String,
}

impl MapTable {
    /// Writes the table whole or not at all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), vibes_data::Error> {
        let axis = |d: usize| Column::Float32(self.positions.iter().map(|p| p[d]).collect());
        let keys = [("episode", Column::UInt32(self.episode.clone())), ("step", Column::UInt32(self.step.clone()))];
        let columns: Vec<_> = keys.into_iter().chain([("x", axis(0)), ("y", axis(1))]).collect();
        let about = [(RECIPE, self.recipe.clone()), (QUALITY, self.quality.clone()), (LATENTS, self.latents.clone())];
        write_table(path, &columns, &about)
    }

    /// Reads a map back; none if there is no readable one.
    #[must_use]
    pub fn read(path: &Path) -> Option<Self> {
        let batches = read_table(path).ok()?;
        let schema = batches.first()?.schema();
        let named = |key: &str| schema.metadata().get(key).cloned().unwrap_or_default();
        let (recipe, quality, latents) = (named(RECIPE), named(QUALITY), named(LATENTS));
        let mut map = Self { episode: Vec::new(), step: Vec::new(), positions: Vec::new(), recipe, quality, latents };
        for batch in batches {
            let keys =
                |name: &str| Some(batch.column_by_name(name)?.as_primitive_opt::<UInt32Type>()?.values().to_vec());
            let axis =
                |name: &str| Some(batch.column_by_name(name)?.as_primitive_opt::<Float32Type>()?.values().to_vec());
            map.episode.extend(keys("episode")?);
            map.step.extend(keys("step")?);
            map.positions.extend(axis("x")?.into_iter().zip(axis("y")?).map(|(x, y)| [x, y]));
        }
        Some(map)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_reads_back_as_it_was_written() {
        let dir = tempfile::tempdir().expect("folder");
        let path = dir.path().join("map.arrow");
        let map = MapTable {
            episode: vec![0, 0, 7],
            step: vec![0, 1, 3],
            positions: vec![[1.5, -2.0], [0.0, 0.25], [3.0, 9.0]],
            recipe: "umap".into(),
            quality: "{}".into(),
            latents: "runs/a/latents.arrow".into(),
        };
        map.write(&path).expect("written");
        assert_eq!(MapTable::read(&path), Some(map));
        assert_eq!(MapTable::read(&dir.path().join("other.arrow")), None);
        // Whatever is changed or cut off is an answer: this map or another one, or none.
        let bytes = std::fs::read(&path).expect("bytes");
        let damaged = dir.path().join("damaged.arrow");
        for at in 0..bytes.len() {
            for change in [bytes[..at].to_vec(), [&bytes[..at], &[!bytes[at]], &bytes[at + 1..]].concat()] {
                let _ = std::fs::remove_file(&damaged);
                std::fs::write(&damaged, change).expect("written");
                let _ = MapTable::read(&damaged);
            }
        }
    }
}
