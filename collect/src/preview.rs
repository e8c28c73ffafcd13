//! What a task looks like under its distractors, on one sheet.
//!
//! In: a task, how strong the distractors are, the videos. Out: a [`ContactSheet`]: one line undistracted, one for each axis alone, one for all
//! together; from left to right the same episode of random actions.

use std::path::Path;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::{Error, Result};
use vibes_env::distractors::{Axes, AxisSeeds, DistractorSettings, DistractorTrajectory};
use vibes_env::render::{RenderSettings, Renderer, undistracted};
use vibes_env::videos::VideoLibrary;
use vibes_env::{Environment, EnvironmentOptions};

/// Pictures from left to right.
const COLUMNS: usize = 8;
/// Agent steps between them.
const STRIDE: usize = 12;
/// Pixels between pictures.
const GAP: usize = 4;

/// The lines of a sheet.
const LINES: [Axes; 5] = [
    Axes::NONE,
    Axes { background: true, ..Axes::NONE },
    Axes { camera: true, ..Axes::NONE },
    Axes { color: true, ..Axes::NONE },
    Axes::ALL,
];

/// What is drawn.
#[derive(Clone, Copy, Debug)]
pub struct PreviewOptions {
    /// Strength; the axes are the sheet's own.
    pub distractors: DistractorSettings,
    /// Of each picture.
    pub pictures: RenderSettings,
    /// Of the episode and the distractors.
    pub seed: u64,
}

/// A sheet of pictures.
#[derive(Clone, Debug)]
pub struct ContactSheet {
    width: usize,
    height: usize,
    rgb: Vec<u8>,
}

impl ContactSheet {
    /// Draws a task's sheet.
    ///
    /// # Errors
    /// For an unknown task, or a machine that cannot draw.
    pub fn draw(task: &str, options: &PreviewOptions, videos: &VideoLibrary) -> Result<Self> {
        let (environment, states) = simulate(task, options.seed)?;
        let repeat = environment.action_repeat() as usize;
        let (scenery, model) = (environment.scenery(), environment.physics().model());
        let from = undistracted(scenery, model, videos)?;
        let mut renderer = Renderer::new(options.pictures, scenery, model)?;
        renderer.begin_episode(&states[0])?;
        let mut sheet = Self::blank(options.pictures.size);
        let mut picture = vec![0; renderer.picture_bytes()];
        for (line, axes) in LINES.into_iter().enumerate() {
            let settings = DistractorSettings { axes, ..options.distractors };
            let steps = (COLUMNS - 1) * STRIDE;
            let trajectory =
                DistractorTrajectory::generate(&settings, &from, steps, repeat, AxisSeeds::from(options.seed));
            for column in 0..COLUMNS {
                let row = column * STRIDE;
                renderer.draw(&states[row], &trajectory.view(row), videos, &mut picture)?;
                sheet.place(&picture, options.pictures.size, column, line);
            }
        }
        Ok(sheet)
    }

    fn blank(size: usize) -> Self {
        let (width, height) = (COLUMNS * (size + GAP) + GAP, LINES.len() * (size + GAP) + GAP);
        Self { width, height, rgb: vec![255; 3 * width * height] }
    }

    fn place(&mut self, picture: &[u8], size: usize, column: usize, line: usize) {
        let (left, top) = (GAP + column * (size + GAP), GAP + line * (size + GAP));
        for (y, row) in picture.chunks_exact(3 * size).enumerate() {
            let start = 3 * ((top + y) * self.width + left);
            self.rgb[start..start + row.len()].copy_from_slice(row);
        }
    }

    /// Writes the sheet as PNG.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let (width, height) = (self.width as u32, self.height as u32);
        image::save_buffer(path, &self.rgb, width, height, image::ColorType::Rgb8).map_err(|error| {
            let source = match error {
                image::ImageError::IoError(error) => error,
                other => std::io::Error::other(other),
            };
            Error::io("write the sheet", path)(source)
        })
    }
}

/// Positions over an episode of random actions, each held for a while so that something moves.
fn simulate(task: &str, seed: u64) -> Result<(Environment, Vec<Vec<f64>>)> {
    let mut environment = Environment::new(task, EnvironmentOptions::default())?;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    environment.reset(&mut rng)?;
    let bounds = environment.action_spec();
    let mut states = vec![environment.physics().qpos().to_vec()];
    let mut action = Vec::new();
    for step in 0..(COLUMNS - 1) * STRIDE {
        if step % 4 == 0 {
            action = bounds.min.iter().zip(&bounds.max).map(|(low, high)| rng.random_range(*low..=*high)).collect();
        }
        environment.step(&action)?;
        states.push(environment.physics().qpos().to_vec());
    }
    Ok((environment, states))
}

#[cfg(test)]
mod tests {
    use super::*;
    use vibes_env::distractors::Difficulty;
    use vibes_env::render::Look;
    use vibes_env::videos::{VideoSet, VideoSource};

    #[test]
    fn a_sheet_shows_every_axis_over_the_same_episode() {
        let source = VideoSource::Procedural;
        let pictures = RenderSettings { size: 32, look: Look::Fast };
        let names = source.list(VideoSet::Val, Some(2)).unwrap();
        let videos = VideoLibrary::open(&source, VideoSet::Val, &names, pictures.look.sky_side(32)).unwrap();
        let distractors = DistractorSettings { difficulty: Difficulty::Hard, ..DistractorSettings::default() };
        let sheet = ContactSheet::draw("cartpole-swingup", &PreviewOptions { distractors, pictures, seed: 1 }, &videos)
            .unwrap();
        let tile = |column: usize, line: usize| -> Vec<u8> {
            let (left, top) = (GAP + column * (32 + GAP), GAP + line * (32 + GAP));
            (top..top + 32).flat_map(|y| sheet.rgb[3 * (y * sheet.width + left)..][..96].to_vec()).collect()
        };
        for line in 1..LINES.len() {
            assert_ne!(tile(3, line), tile(3, 0), "line {line} is undistracted");
        }
        assert_ne!(tile(0, 0), tile(COLUMNS - 1, 0), "nothing moves");
        let folder = tempfile::tempdir().unwrap();
        sheet.write(&folder.path().join("sheet.png")).unwrap();
        assert!(sheet.write(&folder.path().join("nowhere/sheet.png")).is_err());
    }
}
