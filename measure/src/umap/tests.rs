use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Position, Start, UmapOptions, neighbour_graph, transform, umap, umap_of_graph};
use crate::neighbours::{Metric, Space};
use crate::quality::{Quality, QualityOptions, quality};
use crate::{Error, Table};

/// 20 arcs on the unit sphere in 32 dimensions, 100 points each.
fn golden() -> Vec<f32> {
    let bytes = include_bytes!("../../tests/golden/arcs.f32");
    bytes.as_chunks::<4>().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect()
}

fn keys(rows: usize) -> (Vec<u32>, Vec<u32>) {
    ((0..rows as u32).map(|row| row / 100).collect(), (0..rows as u32).map(|row| row % 100).collect())
}

fn generator(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

fn with_space<T>(values: &[f32], dims: usize, run: impl FnOnce(&Space<'_>) -> T) -> T {
    let (episode, step) = keys(values.len() / dims);
    run(&Space::new(Table::new(dims, values, &episode, &step).unwrap(), Metric::Euclidean).unwrap())
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
            assert!(quality.trustworthiness >= 0.999 && quality.kept >= 0.80, "{quality:?}");
        }
    });
}

/// Two of umap-learn's own test sets; its means over the seeds 0, 1 and 2 are in `tests/golden/README.md`.
#[test]
fn is_as_good_as_the_reference_on_its_usual_sets() {
    let iris = include_bytes!("../../tests/golden/iris.f32");
    let iris: Vec<f32> = iris.as_chunks::<4>().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
    let digits: Vec<f32> = include_bytes!("../../tests/golden/digits-500.u8").iter().map(|&x| f32::from(x)).collect();
    for (name, values, dims, trustworthiness, kept) in
        [("iris", iris, 4, 0.9793, 0.7502), ("digits", digits, 64, 0.9868, 0.6994)]
    {
        with_space(&values, dims, |space| {
            let of_seed = |seed| measured(space, &umap(space, UmapOptions::default(), &mut generator(seed)).unwrap());
            let found = [0, 1, 2].map(of_seed);
            let mean = |of: fn(&Quality) -> f64| found.iter().map(of).sum::<f64>() / 3.0;
            let ours = (mean(|q| q.trustworthiness), mean(|q| q.kept));
            assert!(ours.0 > trustworthiness - 0.002 && ours.1 > kept - 0.01, "{name}: {ours:?}");
        });
    }
}

#[test]
fn depends_on_data_and_seed_and_not_on_threads() {
    let values = &golden()[..600 * 32];
    let run = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let options = UmapOptions { epochs: Some(60), ..UmapOptions::default() };
        pool.install(|| with_space(values, 32, |space| umap(space, options, &mut generator(seed)).unwrap()))
    };
    assert_eq!(run(1, 0), run(3, 0));
    assert_ne!(run(1, 0), run(1, 1));
}

#[test]
fn a_graph_is_laid_out_again_without_searching() {
    with_space(&golden()[..500 * 32], 32, |space| {
        let options = UmapOptions { epochs: Some(50), ..UmapOptions::default() };
        let graph = neighbour_graph(space, options).unwrap();
        let again = umap_of_graph(space.table(), &graph, options, &mut generator(4)).unwrap();
        assert_eq!(again, umap(space, options, &mut generator(4)).unwrap());
        let loose = umap_of_graph(space.table(), &graph, UmapOptions { min_dist: 0.9, ..options }, &mut generator(4));
        assert_ne!(again, loose.unwrap());
    });
}

/// Latents in another unit have the same neighbourhoods: quality does not depend on it.
#[test]
fn the_unit_of_the_latents_does_not_matter() {
    for unit in [1e-30_f32, 1.0, 1e30] {
        let values: Vec<f32> = golden()[..500 * 32].iter().map(|x| x * unit).collect();
        with_space(&values, 32, |space| {
            let quality = measured(space, &umap(space, UmapOptions::default(), &mut generator(0)).unwrap());
            assert!(quality.trustworthiness > 0.99, "unit {unit}: {quality:?}");
        });
    }
}

fn finite(map: &[Position]) -> bool {
    map.as_flattened().iter().all(|x| x.is_finite() && x.abs() < 1e3)
}

/// Three heaps of points far from each other, of 300, 40 and 5 (too few for a spectrum of their own).
#[test]
fn parts_that_are_not_connected_stay_apart() {
    let mut rng = generator(0);
    let heaps = [(300, 0.0_f32), (40, 50.0), (5, 100.0)];
    let values: Vec<f32> = heaps
        .iter()
        .flat_map(|&(count, at)| (0..count).map(move |_| at))
        .flat_map(|at| [at + rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)])
        .collect();
    with_space(&values, 3, |space| {
        let options = UmapOptions { neighbours: Some(5), ..UmapOptions::default() };
        let map = umap(space, options, &mut generator(0)).unwrap();
        assert!(finite(&map));
        let centre = |rows: std::ops::Range<usize>| {
            let count = rows.len() as f32;
            map[rows].iter().fold([0.0; 2], |sum, at| [sum[0] + at[0] / count, sum[1] + at[1] / count])
        };
        let distance = |a: Position, b: Position| (a[0] - b[0]).hypot(a[1] - b[1]);
        let centres = [centre(0..300), centre(300..340), centre(340..345)];
        for (row, &at) in map.iter().enumerate().skip(300) {
            let own = if row < 340 { 1 } else { 2 };
            let nearest = (0..3).min_by(|&a, &b| distance(at, centres[a]).total_cmp(&distance(at, centres[b])));
            assert_eq!(nearest, Some(own), "row {row}");
        }
    });
}

/// Two heaps that hang together by one point between them: nothing here may take long or end in NaN.
#[test]
fn a_graph_that_almost_falls_apart_is_laid_out() {
    let mut rng = generator(0);
    let at = |row: usize| if row == 400 { 5.0_f32 } else { 10.0 * (row % 2) as f32 };
    let values: Vec<f32> =
        (0..801).flat_map(|row| [at(row) + rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)]).collect();
    with_space(&values, 2, |space| {
        let start = std::time::Instant::now();
        let map = umap(space, UmapOptions::default(), &mut generator(0)).unwrap();
        assert!(finite(&map) && measured(space, &map).trustworthiness > 0.97, "{:?}", measured(space, &map));
        assert!(start.elapsed().as_secs() < 60);
    });
}

/// 100 places, 12 points on each; and one place with more points than a neighbourhood holds.
#[test]
fn duplicated_points_are_laid_out_together() {
    let mut rng = generator(0);
    let places: Vec<[f32; 4]> = (0..100).map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0))).collect();
    let values: Vec<f32> = (0..1300).flat_map(|row| places[if row < 1200 { row % 100 } else { 0 }]).collect();
    with_space(&values, 4, |space| {
        let map = umap(space, UmapOptions::default(), &mut generator(0)).unwrap();
        assert!(finite(&map));
        let distance = |a: usize, b: usize| (map[a][0] - map[b][0]).hypot(map[a][1] - map[b][1]);
        let own = (0..1000).map(|row| distance(row, row + 100)).sum::<f32>() / 1000.0;
        let other = (0..1000).map(|row| distance(row, row + 57)).sum::<f32>() / 1000.0;
        assert!(own < 0.3 * other, "{own} {other}");
    });
}

#[test]
fn new_points_land_beside_their_like() {
    let values = golden();
    let (old, new): (Vec<usize>, Vec<usize>) = (0..2000).partition(|row| row % 5 != 2);
    let part =
        |rows: &[usize]| rows.iter().flat_map(|&row| &values[row * 32..(row + 1) * 32]).copied().collect::<Vec<f32>>();
    let (old_values, new_values) = (part(&old), part(&new));
    with_space(&old_values, 32, |space| {
        let map = umap(space, UmapOptions::default(), &mut generator(0)).unwrap();
        let keys = vec![0; new.len()];
        let table = Table::new(32, &new_values, &keys, &keys).unwrap();
        let placed = transform(space, &map, &table, UmapOptions::default(), &mut generator(0)).unwrap();
        assert_eq!(placed, transform(space, &map, &table, UmapOptions::default(), &mut generator(0)).unwrap());
        // The nearest old point on the map is of the same arc as the new one.
        let same_arc = |(at, &row): (&Position, &usize)| {
            let distance = |old: &Position| (old[0] - at[0]).hypot(old[1] - at[1]);
            let nearest = (0..map.len()).min_by(|&a, &b| distance(&map[a]).total_cmp(&distance(&map[b]))).unwrap();
            old[nearest] / 100 == row / 100
        };
        let right = placed.iter().zip(&new).filter(|pair| same_arc(*pair)).count();
        assert!(right >= 390, "{right} of 400");
        let narrow = Table::new(16, &new_values, &[0; 800], &[0; 800]).unwrap();
        assert!(transform(space, &map, &narrow, UmapOptions::default(), &mut generator(0)).is_err());
    });
}

#[test]
fn starts_from_principal_components_as_well() {
    with_space(&golden(), 32, |space| {
        let options = UmapOptions { start: Start::Pca, ..UmapOptions::default() };
        let quality = measured(space, &umap(space, options, &mut generator(0)).unwrap());
        assert!(quality.trustworthiness > 0.99 && quality.kept > 0.7, "{quality:?}");
    });
}

#[test]
fn refuses_what_cannot_be_laid_out() {
    with_space(&golden()[..10 * 32], 32, |space| {
        let run = |options| umap(space, options, &mut generator(0));
        let many = UmapOptions { neighbours: Some(15), ..UmapOptions::default() };
        assert!(matches!(run(many), Err(Error::TooFewNeighbours { needed: 14, found: 9, .. })));
        let options = UmapOptions { neighbours: Some(4), ..UmapOptions::default() };
        assert!(run(options).is_ok());
        assert!(matches!(run(UmapOptions { min_dist: 2.0, ..options }), Err(Error::Option { option: "min-dist", .. })));
        assert!(matches!(
            run(UmapOptions { spread: f64::NAN, ..options }),
            Err(Error::Option { option: "spread", .. })
        ));
        assert!(matches!(
            run(UmapOptions { neighbours: Some(1), ..options }),
            Err(Error::Option { option: "neighbours", .. })
        ));
    });
}

/// The default fits tables of any size from two rows on, as those of a short recording are.
#[test]
fn the_default_fits_the_rows() {
    for rows in [2, 3, 4, 10, 15, 16] {
        with_space(&golden()[..rows * 32], 32, |space| {
            let map = umap(space, UmapOptions::default(), &mut generator(0)).unwrap();
            assert!(map.len() == rows && map.as_flattened().iter().all(|x| x.is_finite()), "{rows} rows");
        });
    }
}

/// Half of the rows in one point, as a collapsed encoder puts them. The neighbours are those of the definition, and memory does not grow with the square of
/// the equal rows: what each query keeps is as small as without them.
#[test]
fn many_equal_rows_are_no_trouble() {
    let mut rng = generator(2);
    let rows = 3000;
    let values: Vec<f32> =
        (0..rows * 8).map(|at| if at / 8 % 2 == 0 { 0.5 } else { rng.random_range(-1.0..1.0) }).collect();
    with_space(&values, 8, |space| {
        let neighbours = neighbour_graph(space, UmapOptions::default()).unwrap();
        let first: Vec<u32> = (0..14).map(|i| 2 * i).collect();
        assert_eq!(neighbours.rows(rows - 2), first, "of equal rows the first by row");
        assert_eq!(neighbours.rows(0), (1..15).map(|i| 2 * i).collect::<Vec<u32>>());
        let map = umap(space, UmapOptions { epochs: Some(20), ..UmapOptions::default() }, &mut generator(0)).unwrap();
        assert!(map.as_flattened().iter().all(|x| x.is_finite()));
    });
}

/// The peer's arcs: `rows / 250` of them.
fn arcs(rows: usize, dims: usize) -> Vec<f32> {
    let mut rng = generator(0);
    let mut normal = |_| (0..12).map(|_| rng.random_range(-0.5..0.5_f32)).sum::<f32>();
    let mut values = Vec::new();
    for _ in 0..rows / 250 {
        let unit = |x: Vec<f32>| {
            let length = x.iter().map(|x| x * x).sum::<f32>().sqrt();
            x.iter().map(|x| x / length).collect::<Vec<f32>>()
        };
        let (u, v) = (unit((0..dims).map(&mut normal).collect()), unit((0..dims).map(&mut normal).collect()));
        for step in 0..250 {
            let w = 2.5 * step as f32 / 249.0;
            let point = unit(u.iter().zip(&v).map(|(u, v)| w.cos() * u + w.sin() * v).collect());
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
            let neighbours = neighbour_graph(space, UmapOptions::default()).unwrap();
            let t1 = start.elapsed();
            let graph = super::FuzzyGraph::new(&neighbours);
            let t2 = start.elapsed();
            super::start(space.table(), &graph, Start::Spectral, &mut generator(0)).unwrap();
            let t3 = start.elapsed();
            println!("graph {t1:?} fuzzy {t2:?} spectral {t3:?} components {}", graph.components().1);
            let start = std::time::Instant::now();
            let map = umap(space, UmapOptions::default(), &mut generator(0)).unwrap();
            println!("{rows} x 32: {:.2} s, {:?}", start.elapsed().as_secs_f64(), measured(space, &map));
        });
    }
}
