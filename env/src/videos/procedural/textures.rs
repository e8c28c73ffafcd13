//! Pictures computed point by point: drifting noise, travelling waves, marble and mosaics.

use rand::Rng;

use super::noise::{Noise, mix};
use super::palette::Palette;
use super::{SIDE, to_bytes};

/// A brightness and a tint at every point and time, coloured by two palettes.
#[derive(Debug)]
pub(super) struct Texture {
    pattern: Pattern,
    palettes: [Palette; 2],
    tint: Noise,
    fine: Noise,
    /// Pixels a frame.
    drift: [f32; 2],
}

#[derive(Debug)]
enum Pattern {
    Clouds { noise: Noise, scale: f32, pace: f32 },
    Waves(Vec<Wave>),
    Marble { noise: Noise, scale: f32, fold: f32, pace: f32 },
    Cells(Vec<Cell>),
}

#[derive(Debug)]
struct Wave {
    /// Radians a pixel.
    vector: [f32; 2],
    phase: f32,
    /// Radians a frame.
    speed: f32,
    strength: f32,
    /// Where it is strong: a window that moves with the drift.
    center: [f32; 2],
    width: f32,
}

#[derive(Debug)]
struct Cell {
    center: [f32; 2],
    /// Pixels, and radians a frame, of its wandering.
    radius: f32,
    pace: f32,
    phase: f32,
    lightness: f32,
}

impl Texture {
    pub(super) fn clouds(rng: &mut impl Rng) -> Self {
        let pattern = Pattern::Clouds {
            noise: noise(rng),
            scale: rng.random_range(50.0..120.0),
            pace: rng.random_range(0.01..0.04),
        };
        Self::draw(pattern, rng)
    }

    pub(super) fn waves(rng: &mut impl Rng) -> Self {
        let waves = (0..24).map(|i| Wave::draw(i, rng)).collect();
        Self::draw(Pattern::Waves(waves), rng)
    }

    pub(super) fn marble(rng: &mut impl Rng) -> Self {
        let (scale, fold) = (rng.random_range(60.0..140.0), rng.random_range(1.5..3.5));
        Self::draw(Pattern::Marble { noise: noise(rng), scale, fold, pace: rng.random_range(0.01..0.03) }, rng)
    }

    pub(super) fn cells(rng: &mut impl Rng) -> Self {
        let count = rng.random_range(40..110);
        Self::draw(Pattern::Cells((0..count).map(|_| Cell::draw(rng)).collect()), rng)
    }

    fn draw(pattern: Pattern, rng: &mut impl Rng) -> Self {
        Self {
            pattern,
            palettes: [Palette::draw(rng), Palette::draw(rng)],
            tint: noise(rng),
            fine: noise(rng),
            drift: std::array::from_fn(|_| rng.random_range(-2.0..2.0)),
        }
    }

    pub(super) fn frame(&self, time: f32) -> Vec<u8> {
        let mut picture = Vec::with_capacity(3 * SIDE * SIDE);
        for y in 0..SIDE {
            for x in 0..SIDE {
                picture.extend(to_bytes(self.color([x as f32, y as f32], time)));
            }
        }
        picture
    }

    fn color(&self, pixel: [f32; 2], time: f32) -> [f32; 3] {
        let [x, y]: [f32; 2] = std::array::from_fn(|i| pixel[i] + self.drift[i] * time);
        let lightness = self.lightness([x, y], pixel, time);
        let tint = (0.5 + 1.6 * self.tint.fractal([x / 90.0, y / 90.0, time * 0.02], 3)).clamp(0.0, 1.0);
        let grain = 1.0 + 0.25 * self.fine.fractal([x / 6.0, y / 6.0, 0.0], 2);
        let [first, second] = self.palettes.each_ref().map(|palette| palette.at(lightness));
        std::array::from_fn(|channel| mix(first[channel], second[channel], tint) * grain)
    }

    /// In `0..=1`.
    fn lightness(&self, [x, y]: [f32; 2], pixel: [f32; 2], time: f32) -> f32 {
        match &self.pattern {
            Pattern::Clouds { noise, scale, pace } => 0.5 + 1.3 * noise.fractal([x / scale, y / scale, time * pace], 6),
            Pattern::Waves(waves) => 0.5 + waves.iter().map(|wave| wave.at(pixel, time)).sum::<f32>(),
            Pattern::Marble { noise, scale, fold, pace } => {
                let point = [x / scale, y / scale, time * pace];
                let along = noise.fractal([point[0] + 5.2, point[1] + 1.3, point[2]], 3);
                let across = noise.fractal([point[0] - 3.1, point[1] + 7.7, point[2]], 3);
                let folded = noise.fractal([point[0] + fold * along, point[1] + fold * across, point[2]], 5);
                1.0 - (2.4 * folded.abs()).sqrt()
            }
            Pattern::Cells(cells) => mosaic(cells, pixel, time),
        }
    }
}

/// The lightness of the nearest cell, dark between cells.
fn mosaic(cells: &[Cell], pixel: [f32; 2], time: f32) -> f32 {
    let (mut nearest, mut second, mut lightness) = (f32::MAX, f32::MAX, 0.0);
    for cell in cells {
        let distance = cell.distance(pixel, time);
        if distance < nearest {
            (second, nearest, lightness) = (nearest, distance, cell.lightness);
        } else if distance < second {
            second = distance;
        }
    }
    let edge = ((second.sqrt() - nearest.sqrt()) / 5.0).min(1.0);
    lightness * (0.35 + 0.65 * edge)
}

impl Wave {
    /// Waves of rank i are shorter and weaker, as 1/f.
    fn draw(rank: usize, rng: &mut impl Rng) -> Self {
        let frequency = 0.03 * 1.11_f32.powi(rank as i32) * rng.random_range(0.8..1.2);
        let (sin, cos) = rng.random_range(0.0..std::f32::consts::TAU).sin_cos();
        Self {
            vector: [frequency * cos, frequency * sin],
            phase: rng.random_range(0.0..std::f32::consts::TAU),
            speed: rng.random_range(-0.35..0.35),
            strength: 0.009 / frequency,
            center: std::array::from_fn(|_| rng.random_range(0.0..SIDE as f32)),
            width: rng.random_range(60.0..200.0),
        }
    }

    fn at(&self, [x, y]: [f32; 2], time: f32) -> f32 {
        let (dx, dy) = (x - self.center[0], y - self.center[1]);
        let window = 1.0 / (1.0 + (dx * dx + dy * dy) / (self.width * self.width));
        self.strength * window * (self.vector[0] * x + self.vector[1] * y + self.phase + self.speed * time).sin()
    }
}

impl Cell {
    fn draw(rng: &mut impl Rng) -> Self {
        Self {
            center: std::array::from_fn(|_| rng.random_range(-20.0..SIDE as f32 + 20.0)),
            radius: rng.random_range(5.0..35.0),
            pace: rng.random_range(-0.08..0.08),
            phase: rng.random_range(0.0..std::f32::consts::TAU),
            lightness: rng.random_range(0.1..1.0),
        }
    }

    fn distance(&self, [x, y]: [f32; 2], time: f32) -> f32 {
        let (sin, cos) = (self.phase + self.pace * time).sin_cos();
        let (dx, dy) = (x - self.center[0] - self.radius * cos, y - self.center[1] - self.radius * sin);
        dx * dx + dy * dy
    }
}

fn noise(rng: &mut impl Rng) -> Noise {
    Noise { seed: rng.random() }
}
