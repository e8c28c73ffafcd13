//! `graph.arrow`: the neighbour graph that a map was laid out from, kept so that a map with another layout needs no second search. Columns `row`,
//! `neighbour` (uint32, rows of the table of latents) and `distance` (float64), nearest first; the schema's metadata says of which latents it is.

use std::path::Path;

use arrow::array::AsArray;
use arrow::datatypes::{Float64Type, UInt32Type};
use vibes_data::read_table;
use vibes_measure::neighbours::Neighbours;

use super::{Column, write_table};

/// Metadata key of the description of what the graph is of.
const RECIPE: &str = "vibes.graph";
/// Metadata key of the neighbours per row.
const SIZE: &str = "vibes.k";

/// A neighbour graph and what it is of.
#[derive(Clone, Debug, PartialEq)]
pub struct GraphTable {
    /// What it is of: the latents' checksum, the metric, the rows.
    pub recipe: String,
    /// One query a row of the table.
    pub neighbours: Neighbours,
}

impl GraphTable {
    /// Writes the graph whole or not at all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), vibes_data::Error> {
        let (near, k) = (&self.neighbours, self.neighbours.k());
        let columns = [
            ("row", Column::UInt32((0..near.all_rows().len()).map(|at| (at / k) as u32).collect())),
            ("neighbour", Column::UInt32(near.all_rows().to_vec())),
            ("distance", Column::Float64(near.all_distances().to_vec())),
        ];
        write_table(path, &columns, &[(RECIPE, self.recipe.clone()), (SIZE, k.to_string())])
    }

    /// Reads a graph back; none if there is no readable one.
    #[must_use]
    pub fn read(path: &Path) -> Option<Self> {
        let batches = read_table(path).ok()?;
        let schema = batches.first()?.schema();
        let named = |key: &str| schema.metadata().get(key).cloned();
        let (recipe, k) = (named(RECIPE)?, named(SIZE)?.parse().ok()?);
        let (mut rows, mut distances) = (Vec::new(), Vec::new());
        for batch in batches {
            rows.extend_from_slice(batch.column_by_name("neighbour")?.as_primitive_opt::<UInt32Type>()?.values());
            distances.extend_from_slice(batch.column_by_name("distance")?.as_primitive_opt::<Float64Type>()?.values());
        }
        let neighbours = Neighbours::from_parts(k, rows, distances).ok()?;
        let queries = neighbours.queries() as u32;
        neighbours.all_rows().iter().all(|&row| row < queries).then_some(Self { recipe, neighbours })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_graph_reads_back_as_it_was_written_and_nothing_else_does() {
        let dir = tempfile::tempdir().expect("folder");
        let path = dir.path().join("graph.arrow");
        let near = |rows: Vec<u32>| Neighbours::from_parts(2, rows, vec![0.5, 1.0, 0.5, 2.0, 0.1, 0.2]).expect("graph");
        let graph = GraphTable { recipe: "latents".into(), neighbours: near(vec![1, 2, 0, 2, 0, 1]) };
        graph.write(&path).expect("written");
        assert_eq!(GraphTable::read(&path), Some(graph.clone()));
        GraphTable { neighbours: near(vec![1, 2, 0, 2, 0, 3]), ..graph }.write(&path).expect("written");
        assert_eq!(GraphTable::read(&path), None, "a row past the last");
        std::fs::write(&path, b"no table").expect("written");
        assert_eq!(GraphTable::read(&path), None);
        let keys = Column::UInt32(vec![0, 1]);
        let about = [(RECIPE, "latents".to_owned()), (SIZE, "1".to_owned())];
        let words = Column::Text(vec!["near".to_owned(), "far".to_owned()]);
        let columns = [("row", keys.clone()), ("neighbour", keys), ("distance", words)];
        write_table(&path, &columns, &about).expect("written");
        assert_eq!(GraphTable::read(&path), None, "distances in words");
    }
}
