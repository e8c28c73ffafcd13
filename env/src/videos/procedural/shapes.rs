//! Pictures of shapes that hide each other, from far to near: the dead leaves model, whose sizes fall off as natural ones do.

use rand::Rng;

use super::noise::Noise;
use super::palette::Palette;
use super::{SIDE, to_bytes};

/// Shapes from far to near, each moving on its own.
#[derive(Debug)]
pub(super) struct Shapes {
    shapes: Vec<Shape>,
    ground: [f32; 3],
    grain: Noise,
    /// Of the camera, pixels a frame.
    pan: [f32; 2],
}

#[derive(Debug)]
struct Shape {
    center: [f32; 2],
    /// Pixels a frame.
    velocity: [f32; 2],
    half_size: [f32; 2],
    /// Radians, and radians a frame.
    turn: [f32; 2],
    is_round: bool,
    color: [f32; 3],
    /// Change of brightness from one end to the other.
    shade: f32,
    /// Depth of its texture.
    texture: f32,
}

const SMALLEST: f32 = 5.0;
const LARGEST: f32 = 90.0;
/// Shapes drift over the edge and come in on the other side of a frame with this margin.
const MARGIN: f32 = 100.0;

impl Shapes {
    pub(super) fn leaves(rng: &mut impl Rng) -> Self {
        Self::draw(rng, true, 420)
    }

    pub(super) fn tiles(rng: &mut impl Rng) -> Self {
        Self::draw(rng, false, 300)
    }

    fn draw(rng: &mut impl Rng, is_round: bool, count: usize) -> Self {
        let palette = Palette::draw(rng);
        let wind: [f32; 2] = std::array::from_fn(|_| rng.random_range(-1.2..1.2));
        let shapes = (0..count).map(|i| Shape::draw(rng, &palette, is_round, i as f32 / count as f32, wind)).collect();
        let pan = if is_round { [0.0; 2] } else { std::array::from_fn(|_| rng.random_range(-1.5..1.5)) };
        Self { shapes, ground: palette.at(rng.random()), grain: Noise { seed: rng.random() }, pan }
    }

    pub(super) fn frame(&self, time: f32) -> Vec<u8> {
        let mut picture = vec![self.ground; SIDE * SIDE];
        for (number, shape) in self.shapes.iter().enumerate() {
            self.paint(shape, number as f32 * 7.3, time, &mut picture);
        }
        picture.into_iter().flat_map(to_bytes).collect()
    }

    fn paint(&self, shape: &Shape, texture_offset: f32, time: f32, picture: &mut [[f32; 3]]) {
        let period = SIDE as f32 + 2.0 * MARGIN;
        let center: [f32; 2] = std::array::from_fn(|i| {
            (shape.center[i] + (shape.velocity[i] - self.pan[i]) * time + MARGIN).rem_euclid(period) - MARGIN
        });
        let (sin, cos) = (shape.turn[0] + shape.turn[1] * time).sin_cos();
        let reach = shape.half_size[0].hypot(shape.half_size[1]);
        let range =
            |middle: f32| (middle - reach).max(0.0) as usize..((middle + reach).max(0.0) as usize + 1).min(SIDE);
        for y in range(center[1]) {
            for x in range(center[0]) {
                let (dx, dy) = (x as f32 - center[0], y as f32 - center[1]);
                let (u, v) = ((dx * cos + dy * sin) / shape.half_size[0], (dy * cos - dx * sin) / shape.half_size[1]);
                let inside = if shape.is_round { u * u + v * v < 1.0 } else { u.abs().max(v.abs()) < 1.0 };
                if inside {
                    let scale = shape.half_size[0] / 9.0;
                    let grain = self.grain.fractal([u * scale + texture_offset, v * scale, 0.0], 3);
                    let light = 1.0 + shape.shade * v + shape.texture * grain;
                    picture[y * SIDE + x] = shape.color.map(|channel| channel * light);
                }
            }
        }
    }
}

impl Shape {
    /// `nearness` in `0..1`: near shapes move faster.
    fn draw(rng: &mut impl Rng, palette: &Palette, is_round: bool, nearness: f32, wind: [f32; 2]) -> Self {
        // Sizes with density r^-3 between the smallest and the largest.
        let uniform: f32 = rng.random();
        let (small, large) = (SMALLEST.powi(-2), LARGEST.powi(-2));
        // Far shapes fill the picture, so they are larger.
        let size = (small + (large - small) * uniform).powf(-0.5) * (1.0 + 3.0 * (1.0 - nearness).powi(3));
        let aspect = if is_round { rng.random_range(0.7..1.0) } else { rng.random_range(0.25..1.0) };
        let speed = 0.3 + nearness;
        Self {
            center: std::array::from_fn(|_| rng.random_range(-MARGIN..SIDE as f32 + MARGIN)),
            velocity: std::array::from_fn(|i| speed * (wind[i] + rng.random_range(-0.8..0.8))),
            half_size: [size, size * aspect],
            turn: [rng.random_range(0.0..std::f32::consts::TAU), rng.random_range(-0.03..0.03)],
            is_round,
            color: palette.at(rng.random()),
            shade: rng.random_range(-0.3..0.3),
            texture: rng.random_range(0.1..0.7),
        }
    }
}
