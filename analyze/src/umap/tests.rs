use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Position, Start, UmapOptions, umap};
use crate::Table;
use crate::neighbours::{Metric, Space};
use crate::quality::{Quality, QualityOptions, quality};

/// 20 arcs on the unit sphere in 32 dimensions, 100 points each.
fn golden() -> Vec<f32> {
    let bytes = include_bytes!("../../tests/golden/umap_quality.f32");
    bytes
        .as_chunks::<4>()
        .0
        .iter()
        .map(|&bytes| f32::from_le_bytes(bytes))
        .collect()
}

fn keys(rows: usize) -> (Vec<u32>, Vec<u32>) {
    (
        (0..rows as u32).map(|row| row / 100).collect(),
        (0..rows as u32).map(|row| row % 100).collect(),
    )
}

fn generator(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

fn with_space<T>(values: &[f32], dims: usize, run: impl FnOnce(&Space<'_>) -> T) -> T {
    let (episode, step) = keys(values.len() / dims);
    run(&Space::new(
        Table::new(dims, values, &episode, &step).unwrap(),
        Metric::Euclidean,
    )
    .unwrap())
}

fn measured(space: &Space<'_>, map: &[Position]) -> Quality {
    quality(space, map, QualityOptions::default(), &mut generator(0)).unwrap()
}

#[test]
fn is_as_good_as_the_reference_on_its_golden_points() {
    with_space(&golden(), 32, |space| {
        for seed in 0..3 {
            let map = umap(space, UmapOptions::default(), &mut generator(seed)).unwrap();
            let quality = measured(space, &map);
            println!("{quality:?}");
            assert!(
                quality.trustworthiness >= 0.999 && quality.kept >= 0.80,
                "{quality:?}"
            );
        }
    });
}

/// The peer's arcs: `rows / 250` of them.
fn arcs(rows: usize, dims: usize) -> Vec<f32> {
    let mut rng = generator(0);
    let mut normal = |_| {
        (0..12)
            .map(|_| rng.random_range(-0.5..0.5_f32))
            .sum::<f32>()
    };
    let mut values = Vec::new();
    for _ in 0..rows / 250 {
        let unit = |x: Vec<f32>| {
            let length = x.iter().map(|x| x * x).sum::<f32>().sqrt();
            x.iter().map(|x| x / length).collect::<Vec<f32>>()
        };
        let (u, v) = (
            unit((0..dims).map(&mut normal).collect()),
            unit((0..dims).map(&mut normal).collect()),
        );
        for step in 0..250 {
            let w = 2.5 * step as f32 / 249.0;
            let point = unit(
                u.iter()
                    .zip(&v)
                    .map(|(u, v)| w.cos() * u + w.sin() * v)
                    .collect(),
            );
            values.extend(point.iter().map(|x| x + 0.05 * normal(0)));
        }
    }
    values
}

/// Prints the times; run with `--ignored --nocapture`.
#[test]
#[ignore = "a benchmark"]
fn bench() {
    for rows in [10_000, 25_000] {
        with_space(&arcs(rows, 32), 32, |space| {
            let start = std::time::Instant::now();
            let neighbours = super::neighbour_graph(space, UmapOptions::default()).unwrap();
            let t1 = start.elapsed();
            let graph = super::FuzzyGraph::new(&neighbours);
            let t2 = start.elapsed();
            super::start(space.table(), &graph, Start::Spectral, &mut generator(0)).unwrap();
            let t3 = start.elapsed();
            println!(
                "graph {t1:?} fuzzy {t2:?} spectral {t3:?} components {}",
                graph.components().1
            );
            let start = std::time::Instant::now();
            let map = umap(space, UmapOptions::default(), &mut generator(0)).unwrap();
            println!(
                "{rows} x 32: {:.2} s, {:?}",
                start.elapsed().as_secs_f64(),
                measured(space, &map)
            );
        });
    }
}
