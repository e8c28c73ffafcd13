//! Making a map: the neighbour graph, kept in `graph.arrow`, and the layout. Of a table too large to lay out whole, rows are drawn and the others
//! placed among them a chunk at a time.

use std::path::Path;

use rand::Rng;
use rand::seq::index;
use serde_json::json;
use vibes_data::Latents;

use super::super::session::Session;
use super::super::{Globals, say};
use super::{MapOptions, Method, checksum};
use crate::output::GraphTable;
use vibes_measure::neighbours::{self, Exclude, Neighbours, Space};
use vibes_measure::pca::pca;
use vibes_measure::tsne::{TsneOptions, tsne_of_graph};
use vibes_measure::umap::{Position, UmapOptions, among_neighbours, transform, umap_of_graph};
use vibes_measure::{Error, Table};

/// The version of the neighbour graphs: one more whenever the same latents and metric would give another one, so that those of older programs are made
/// anew.
const GRAPH: u32 = 1;
/// Rows placed at a time.
const CHUNK: usize = 65_536;

/// Positions of all rows.
pub(super) struct LaidOut {
    pub(super) positions: Vec<Position>,
    /// Whether the neighbour graph was there already.
    pub(super) graph_reused: bool,
}

impl MapOptions {
    /// Lays out the session's latents, or as many of them as are to be laid out and places the others among these.
    pub(super) fn lay_out(
        &self,
        session: &mut Session,
        globals: &Globals,
        rng: &mut impl Rng,
    ) -> anyhow::Result<LaidOut> {
        let rows = session.latents.len();
        if self.method == Method::Pca {
            return Ok(LaidOut { positions: pca(&session.table()?)?.positions, graph_reused: false });
        }
        if rows <= self.fit_rows {
            return self.lay_out_rows(session.table()?, None, session, globals, rng);
        }
        let mut drawn = index::sample(rng, rows, self.fit_rows).into_vec();
        drawn.sort_unstable();
        let part = Part::of(&session.latents, &drawn);
        let table = part.table()?;
        let mut laid_out = self.lay_out_rows(table, Some(self.fit_rows), session, globals, rng)?;
        let mut others = vec![true; rows];
        drawn.iter().for_each(|&row| others[row] = false);
        let others: Vec<usize> = (0..rows).filter(|&row| others[row]).collect();
        say(globals, format_args!("map: {} rows laid out, {} to be placed among them", drawn.len(), others.len()));
        let space = Space::new(table, self.metric)?;
        let of_drawn = std::mem::take(&mut laid_out.positions);
        let placed = place(&session.latents, &others, |new| match self.method {
            Method::Umap => transform(&space, &of_drawn, new, self.umap(), rng),
            _ => among_neighbours(&space, &of_drawn, new, self.umap().neighbourhood(drawn.len())),
        })?;
        laid_out.positions = vec![[0.0; 2]; rows];
        for (row, at) in drawn.into_iter().zip(of_drawn).chain(others.into_iter().zip(placed)) {
            laid_out.positions[row] = at;
        }
        Ok(laid_out)
    }

    fn lay_out_rows(
        &self,
        table: Table<'_>,
        drawn: Option<usize>,
        session: &Session,
        globals: &Globals,
        rng: &mut impl Rng,
    ) -> anyhow::Result<LaidOut> {
        let tsne = TsneOptions { perplexity: self.perplexity, ..TsneOptions::default() };
        let rows = table.rows();
        let size = if self.method == Method::Umap { self.umap().graph_size(rows)? } else { tsne.graph_size(rows)? };
        let space = Space::new(table, self.metric)?;
        let (graph, graph_reused) = self.graph(&space, size, drawn, session, globals)?;
        let positions = match self.method {
            Method::Umap => umap_of_graph(&table, &graph, self.umap(), rng)?,
            _ => tsne_of_graph(&table, &graph, tsne, rng)?,
        };
        Ok(LaidOut { positions, graph_reused })
    }

    pub(super) fn umap(&self) -> UmapOptions {
        UmapOptions {
            neighbours: self.neighbours,
            min_dist: self.min_dist,
            spread: self.spread,
            epochs: self.epochs,
            ..UmapOptions::default()
        }
    }

    /// The neighbour graph, and whether it was there: in the output folder or the folder `figures` beside the latents, of the same latents and metric,
    /// with at least as many neighbours.
    fn graph(
        &self,
        space: &Space<'_>,
        size: usize,
        drawn: Option<usize>,
        session: &Session,
        globals: &Globals,
    ) -> anyhow::Result<(Neighbours, bool)> {
        let drawn = drawn.map(|rows| json!({ "rows": rows, "seed": session.seed }));
        let latents = checksum(&session.latents);
        let recipe =
            json!({ "graph": GRAPH, "latents": latents, "metric": self.metric.name(), "drawn": drawn }).to_string();
        let path = session.out.join("graph.arrow");
        let beside = session.path.parent().unwrap_or(Path::new("")).join("figures/graph.arrow");
        for path in [&path, &beside] {
            let known = GraphTable::read(path).filter(|known| {
                known.recipe == recipe
                    && known.neighbours.queries() == space.table().rows()
                    && known.neighbours.k() >= size
            });
            if let Some(known) = known {
                say(globals, format_args!("map: neighbour graph used again: {}", path.display()));
                return Ok((known.neighbours.truncated(size), true));
            }
        }
        let neighbours = neighbours::graph(space, size, Exclude::Itself)?;
        let table = GraphTable { recipe, neighbours };
        table.write(&path)?;
        Ok((table.neighbours, false))
    }
}

/// Places some rows of the latents, a chunk at a time, so that memory follows the chunk.
pub(super) fn place(
    latents: &Latents,
    rows: &[usize],
    mut chunk: impl FnMut(&Table<'_>) -> Result<Vec<Position>, Error>,
) -> Result<Vec<Position>, Error> {
    let mut placed = Vec::with_capacity(rows.len());
    for rows in rows.chunks(CHUNK) {
        placed.extend(chunk(&Part::of(latents, rows).table()?)?);
    }
    Ok(placed)
}

/// Some rows of the latents.
struct Part {
    dims: usize,
    values: Vec<f32>,
    episode: Vec<u32>,
    step: Vec<u32>,
}

impl Part {
    fn of(l: &Latents, rows: &[usize]) -> Self {
        Self {
            dims: l.dims,
            values: rows.iter().flat_map(|&row| l.row(row)).copied().collect(),
            episode: rows.iter().map(|&row| l.episode[row]).collect(),
            step: rows.iter().map(|&row| l.step[row]).collect(),
        }
    }

    fn table(&self) -> Result<Table<'_>, Error> {
        Table::new(self.dims, &self.values, &self.episode, &self.step)
    }
}
