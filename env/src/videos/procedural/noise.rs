//! Smooth noise in space and time, whose octaves add up to a 1/f spectrum.

/// Value noise over a hashed lattice.
#[derive(Clone, Copy, Debug)]
pub(super) struct Noise {
    pub(super) seed: u32,
}

impl Noise {
    /// One octave at a point (x, y, time), about `-1..=1`, correlated over distances of 1.
    pub(super) fn at(self, point: [f32; 3]) -> f32 {
        let cell = point.map(|x| x.floor());
        let inside: [f32; 3] = std::array::from_fn(|i| smooth(point[i] - cell[i]));
        let cell = cell.map(|x| x as i32);
        let corner =
            |dx, dy, dz| self.lattice(cell[0].wrapping_add(dx), cell[1].wrapping_add(dy), cell[2].wrapping_add(dz));
        let plane = |dz| {
            let (near, far) = (
                mix(corner(0, 0, dz), corner(1, 0, dz), inside[0]),
                mix(corner(0, 1, dz), corner(1, 1, dz), inside[0]),
            );
            mix(near, far, inside[1])
        };
        mix(plane(0), plane(1), inside[2])
    }

    /// `octaves` of them, each twice as fine, half as strong and 1.5 times as fast as the one before: a 1/f spectrum.
    pub(super) fn fractal(self, [x, y, time]: [f32; 3], octaves: u32) -> f32 {
        let (mut sum, mut strength, mut frequency, mut speed) = (0.0, 0.5, 1.0, 1.0);
        for octave in 0..octaves {
            let noise = Self { seed: self.seed.wrapping_add(octave.wrapping_mul(0x9E37_79B9)) };
            sum += strength * noise.at([x * frequency, y * frequency, time * speed]);
            strength *= 0.5;
            frequency *= 2.0;
            speed *= 1.5;
        }
        sum
    }

    fn lattice(self, x: i32, y: i32, z: i32) -> f32 {
        let mut hash = self.seed
            ^ (x as u32).wrapping_mul(0x85EB_CA6B)
            ^ (y as u32).wrapping_mul(0xC2B2_AE35)
            ^ (z as u32).wrapping_mul(0x27D4_EB2F);
        hash = (hash ^ (hash >> 15)).wrapping_mul(0x2C1B_3C6D);
        hash = (hash ^ (hash >> 12)).wrapping_mul(0x297A_2D39);
        hash ^= hash >> 15;
        (hash >> 8) as f32 / (1 << 23) as f32 - 1.0
    }
}

fn smooth(x: f32) -> f32 {
    x * x * (3.0 - 2.0 * x)
}

pub(super) fn mix(a: f32, b: f32, share: f32) -> f32 {
    a + (b - a) * share
}
