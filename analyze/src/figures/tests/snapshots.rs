//! Every figure against its picture in `tests/snapshots`: a change of how figures look is seen, and made on purpose
//! (`VIBES_UPDATE_SNAPSHOTS=1 cargo test --workspace --lib snapshot` writes them anew; look at them before committing).

use std::path::Path;

use super::examples;
use crate::picture::encode::encode_png;
use crate::picture::png;

/// Dots an inch: text is still legible, and a picture takes some ten kilobytes.
const DPI: f64 = 100.0;
/// Most by which pictures may differ: mean over all channels, of 255, and the share of pixels off by more than a shade. Machines round
/// curves and anti-aliasing differently.
const MEAN: f64 = 0.3;
const OFF: f64 = 0.002;
const SHADE: u8 = 48;

/// Left out: sheets whose picture is mostly photographs, and lines that only the laws are for.
const LEFT_OUT: [&str; 3] = ["sheet-20", "sheet-long-keys", "curves-many"];

#[test]
fn every_figure_looks_like_its_snapshot() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots");
    let update = std::env::var_os("VIBES_UPDATE_SNAPSHOTS").is_some();
    for (name, figure) in examples().into_iter().filter(|(name, _)| !LEFT_OUT.contains(name)) {
        let path = folder.join(format!("{name}.png"));
        let pixels = png::rasterize(&figure.draw(), DPI).expect(name);
        if update {
            std::fs::write(&path, encode_png(&pixels).expect(name)).expect(name);
            continue;
        }
        let wanted = image::open(&path).unwrap_or_else(|e| panic!("{e}: {}", path.display())).to_rgb8();
        assert_eq!((pixels.width, pixels.height), wanted.dimensions(), "{name} has another size");
        let differences: Vec<u8> = pixels.rgb.iter().zip(wanted.as_raw()).map(|(a, b)| a.abs_diff(*b)).collect();
        let mean = differences.iter().map(|&d| f64::from(d)).sum::<f64>() / differences.len() as f64;
        let off = differences.chunks_exact(3).filter(|d| d.iter().any(|&d| d > SHADE)).count();
        let off = off as f64 / (differences.len() / 3) as f64;
        assert!(
            mean <= MEAN && off <= OFF,
            "{name} looks different: mean {mean:.3} of 255, {:.2}% of pixels",
            100.0 * off
        );
    }
}
