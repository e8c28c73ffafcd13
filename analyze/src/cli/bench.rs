//! `bench`: a rate card of what the analyzer spends its time on.

use std::time::Instant;

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::{Value, json};

use super::{Globals, Outcome, say};
use vibes_measure::Table;
use vibes_measure::neighbours::{Exclude, Metric, Space, nearest};
use vibes_measure::quality::{QualityOptions, quality};
use vibes_measure::umap::{UmapOptions, neighbour_graph, umap_of_graph};

/// Measure how long neighbours and maps take on this machine, on random latents of 32 dimensions.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    /// A tenth of the rows, for a quick look.
    #[arg(long)]
    quick: bool,
    /// Seed of the latents.
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

const DIMS: usize = 32;
/// Rows of an episode.
const EPISODE: usize = 250;

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    let size = |rows: usize| if options.quick { rows / 10 } else { rows };
    let mut rows = Vec::new();
    let queries = size(125_000);
    rows.push(timed(globals, format!("20 queries, 5 neighbours, {queries} x {DIMS}"), 0.1, || {
        neighbours(options.seed, queries)
    })?);
    for (count, target) in [(10_000, None), (25_000, Some(10.0))] {
        let count = size(count);
        let data = Data::draw(options.seed, count);
        let space = Space::new(data.table()?, Metric::Euclidean)?;
        let began = Instant::now();
        let graph = neighbour_graph(&space, UmapOptions::default())?;
        let seconds = began.elapsed().as_secs_f64();
        rows.push(report(globals, format!("15-neighbour graph, {count} x {DIMS}"), seconds, target));
        let began = Instant::now();
        umap_of_graph(space.table(), &graph, UmapOptions::default(), &mut ChaCha8Rng::seed_from_u64(options.seed))?;
        let layout = began.elapsed().as_secs_f64();
        rows.push(report(globals, format!("UMAP with its graph, {count} x {DIMS}"), seconds + layout, None));
    }
    let count = size(100_000);
    rows.push(timed(globals, format!("quality of a map, {count} x {DIMS}"), 2.0, || map_quality(options.seed, count))?);
    let threads = rayon::current_num_threads();
    let line = format!("bench: {} timings on {threads} threads; the seconds are above", rows.len());
    let json = json!({ "threads": threads, "timings": rows });
    Ok(Outcome { line, json, ..Outcome::default() })
}

struct Data {
    values: Vec<f32>,
    episode: Vec<u32>,
    step: Vec<u32>,
}

impl Data {
    /// Episodes that walk slowly through the space, as latents do.
    fn draw(seed: u64, rows: usize) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut values: Vec<f32> = Vec::with_capacity(rows * DIMS);
        for row in 0..rows {
            for d in 0..DIMS {
                let last = if row % EPISODE == 0 { 0.0 } else { values[(row - 1) * DIMS + d] };
                let fresh: f32 = rng.random_range(-1.0..1.0);
                values.push(if row % EPISODE == 0 { fresh } else { 0.98 * last + 0.2 * fresh });
            }
        }
        Self {
            values,
            episode: (0..rows).map(|r| (r / EPISODE) as u32).collect(),
            step: (0..rows).map(|r| (r % EPISODE) as u32).collect(),
        }
    }

    fn table(&self) -> Result<Table<'_>, vibes_measure::Error> {
        Table::new(DIMS, &self.values, &self.episode, &self.step)
    }
}

/// Seconds of the search alone: the space is prepared once and asked many times.
fn neighbours(seed: u64, rows: usize) -> anyhow::Result<f64> {
    let data = Data::draw(seed, rows);
    let space = Space::new(data.table()?, Metric::Standardized)?;
    let queries: Vec<usize> = (0..20).map(|i| i * rows / 20).collect();
    let began = Instant::now();
    nearest(&space, &queries, 5, Exclude::Trajectory)?;
    Ok(began.elapsed().as_secs_f64())
}

/// Seconds that trustworthiness and neighbours kept take, of a map that keeps two of the dimensions.
fn map_quality(seed: u64, rows: usize) -> anyhow::Result<f64> {
    let data = Data::draw(seed, rows);
    let map: Vec<[f32; 2]> = data.values.chunks_exact(DIMS).map(|latent| [latent[0], latent[1]]).collect();
    let space = Space::new(data.table()?, Metric::Euclidean)?;
    let began = Instant::now();
    quality(&space, &map, QualityOptions::default(), &mut ChaCha8Rng::seed_from_u64(seed))?;
    Ok(began.elapsed().as_secs_f64())
}

fn timed(
    globals: &Globals,
    what: String,
    target: f64,
    work: impl FnOnce() -> anyhow::Result<f64>,
) -> anyhow::Result<Value> {
    Ok(report(globals, what, work()?, Some(target)))
}

fn report(globals: &Globals, what: String, seconds: f64, target: Option<f64>) -> Value {
    let aim = target.map_or_else(String::new, |t| format!("  (aim: under {t} s)"));
    say(globals, format_args!("{what:<48} {seconds:>8.3} s{aim}"));
    json!({ "what": what, "seconds": seconds, "aim": target })
}
