//! The built-in background videos: synthetic, but with the statistics of natural pictures (occluding shapes of all sizes, 1/f spectra,
//! correlated colours) and with motion.
//!
//! In: a name such as `leaves-003`. Out: its frames, RGB `[240, 240, 3]`, a function of the name alone. The training families (`leaves`: dead
//! leaves; `clouds`: drifting 1/f noise; `waves`: moving textures) and the validation families (`tiles`: occluding rectangles under a panning
//! camera; `marble`: folded noise; `cells`: a moving mosaic) share nothing, so that held-out videos are held out in kind.

mod noise;
mod palette;
mod shapes;
mod textures;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::VideoSet;
use super::davis;
use crate::error::{Error, Result};
use shapes::Shapes;
use textures::Texture;

/// Side of a frame, pixels.
pub(super) const SIDE: usize = 240;
/// Frames of a video, about as many as DAVIS videos have.
pub const FRAMES: usize = 60;
/// Changes with the pictures.
pub(super) const VERSION: u32 = 2;

/// A kind of video.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// Discs of all sizes that hide each other and move at different speeds.
    Leaves,
    /// 1/f noise that drifts and changes.
    Clouds,
    /// Sums of travelling waves.
    Waves,
    /// Rectangles of all sizes that hide each other, under a panning camera.
    Tiles,
    /// Noise folded along its own slopes, with veins.
    Marble,
    /// A mosaic of cells whose centres wander.
    Cells,
}

impl Family {
    /// The families of a set.
    pub fn of(set: VideoSet) -> [Self; 3] {
        match set {
            VideoSet::Train => [Self::Leaves, Self::Clouds, Self::Waves],
            VideoSet::Val => [Self::Tiles, Self::Marble, Self::Cells],
        }
    }

    /// The first part of its videos' names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Leaves => "leaves",
            Self::Clouds => "clouds",
            Self::Waves => "waves",
            Self::Tiles => "tiles",
            Self::Marble => "marble",
            Self::Cells => "cells",
        }
    }
}

/// The names of the first `count` videos of a set, the families in turn; without a count as many as DAVIS has.
pub fn list(set: VideoSet, count: Option<usize>) -> Vec<String> {
    let count = count.unwrap_or(match set {
        VideoSet::Train => davis::TRAIN.len(),
        VideoSet::Val => davis::VAL.len(),
    });
    let families = Family::of(set);
    (0..count.max(1)).map(|i| format!("{}-{:03}", families[i % families.len()].name(), i / families.len())).collect()
}

/// One video, ready to give any of its frames.
#[derive(Debug)]
pub struct ProceduralVideo {
    scene: Scene,
}

#[derive(Debug)]
enum Scene {
    Shapes(Shapes),
    Texture(Texture),
}

impl ProceduralVideo {
    /// The video of that name.
    ///
    /// # Errors
    /// When the name is not a family and a number.
    pub fn named(name: &str) -> Result<Self> {
        let unknown = || Error::UnknownName {
            what: "procedural video",
            name: name.to_owned(),
            known: "leaves-000, clouds-000, waves-000, … (train) and tiles-000, marble-000, cells-000, … (val)"
                .to_owned(),
        };
        let (family, number) = name.split_once('-').ok_or_else(unknown)?;
        let number: u64 = number.parse().map_err(|_error| unknown())?;
        let mut families = [VideoSet::Train, VideoSet::Val].into_iter().flat_map(Family::of);
        let family = families.find(|known| known.name() == family).ok_or_else(unknown)?;
        let mut rng = ChaCha8Rng::seed_from_u64(number);
        rng.set_stream(family as u64);
        let scene = match family {
            Family::Leaves => Scene::Shapes(Shapes::leaves(&mut rng)),
            Family::Tiles => Scene::Shapes(Shapes::tiles(&mut rng)),
            Family::Clouds => Scene::Texture(Texture::clouds(&mut rng)),
            Family::Waves => Scene::Texture(Texture::waves(&mut rng)),
            Family::Marble => Scene::Texture(Texture::marble(&mut rng)),
            Family::Cells => Scene::Texture(Texture::cells(&mut rng)),
        };
        Ok(Self { scene })
    }

    /// Frame `index`: RGB, `[240, 240, 3]`.
    pub fn frame(&self, index: usize) -> Vec<u8> {
        match &self.scene {
            Scene::Shapes(shapes) => shapes.frame(index as f32),
            Scene::Texture(texture) => texture.frame(index as f32),
        }
    }
}

/// A linear colour in `0..=1` as bytes.
fn to_bytes(rgb: [f32; 3]) -> [u8; 3] {
    rgb.map(|channel| (channel.clamp(0.0, 1.0) * 255.0 + 0.5) as u8)
}
