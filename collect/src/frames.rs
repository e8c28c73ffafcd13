//! Pictures of states as they are, without distractors, one PNG a row.
//!
//! In: a task's environment, where the episode starts, positions row by row. Out: `000000.png`, `000001.png`, … in a folder.

use std::path::Path;

use crate::{Error, Result};
use vibes_env::distractors::View;
use vibes_env::render::{RenderSettings, Renderer};
use vibes_env::videos::VideoLibrary;
use vibes_env::{Environment, Start};

/// Draws every row of positions `[rows][nq]` into `folder`, which is made if it is missing.
///
/// # Errors
/// On a machine that cannot draw, or when a file cannot be written.
pub fn draw_frames(
    environment: &mut Environment,
    start: &Start,
    positions: &[Vec<f64>],
    settings: RenderSettings,
    folder: &Path,
) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(Error::io("make the folder", folder))?;
    environment.reset_to(start)?;
    let mut renderer = Renderer::new(settings, environment.scenery(), environment.physics().model())?;
    let mut picture = vec![0; renderer.picture_bytes()];
    for (row, qpos) in positions.iter().enumerate() {
        renderer.draw(qpos, &View::default(), &VideoLibrary::none(), &mut picture)?;
        write_png(&folder.join(format!("{row:06}.png")), &picture, settings.size)?;
    }
    Ok(())
}

fn write_png(path: &Path, rgb: &[u8], size: usize) -> Result<()> {
    image::save_buffer(path, rgb, size as u32, size as u32, image::ColorType::Rgb8).map_err(|error| {
        let source = match error {
            image::ImageError::IoError(error) => error,
            other => std::io::Error::other(other),
        };
        Error::io("write the picture", path)(source)
    })
}
