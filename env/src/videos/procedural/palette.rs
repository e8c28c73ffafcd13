//! Colours that go together: a few hues around one, one opposite, from dark to light.

use rand::Rng;

use super::noise::mix;

/// Colours by lightness.
#[derive(Clone, Copy, Debug)]
pub(super) struct Palette {
    stops: [[f32; 3]; 6],
}

impl Palette {
    pub(super) fn draw(rng: &mut impl Rng) -> Self {
        let base: f32 = rng.random();
        let spread = rng.random_range(0.04..0.18);
        let opposite = rng.random_range(1..5);
        let stops = std::array::from_fn(|i| {
            let turn = if i == opposite { 0.5 } else { rng.random_range(-spread..spread) };
            let value = 0.12 + 0.16 * i as f32 + rng.random_range(-0.06..0.06);
            hsv(base + turn, rng.random_range(0.25..0.85), value)
        });
        Self { stops }
    }

    /// The colour at `position` in `0..=1`, dark to light.
    pub(super) fn at(&self, position: f32) -> [f32; 3] {
        let scaled = position.clamp(0.0, 0.999) * (self.stops.len() - 1) as f32;
        let (low, share) = (scaled as usize, scaled.fract());
        std::array::from_fn(|channel| mix(self.stops[low][channel], self.stops[low + 1][channel], share))
    }
}

/// Hue, saturation and value to RGB.
fn hsv(hue: f32, saturation: f32, value: f32) -> [f32; 3] {
    [5.0, 3.0, 1.0].map(|offset| {
        let k = (offset + hue.rem_euclid(1.0) * 6.0) % 6.0;
        value - value * saturation * k.min(4.0 - k).clamp(0.0, 1.0)
    })
}
