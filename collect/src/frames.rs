//! Pictures of states as they are, without distractors, one PNG a row.
//!
//! In: a task's environment, where the episode starts, positions row by row. Out: `000000.png`, `000001.png`, … in a folder.

use std::path::Path;

use crate::{Error, Result};
use vibes_env::distractors::View;
use vibes_env::render::{RenderSettings, Renderer};
use vibes_env::videos::VideoLibrary;
use vibes_env::{Environment, Start};

/// Draws every row of positions `[rows][nq]` into `folder`, which is made if it is missing. Pictures of the same rows that are there are drawn over.
///
/// # Errors
/// On a machine that cannot draw, when a file cannot be written, or when pictures of further rows lie there: they would pass for rows of this episode.
pub fn draw_frames(
    environment: &mut Environment,
    start: &Start,
    positions: &[Vec<f64>],
    settings: RenderSettings,
    folder: &Path,
) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(Error::io("make the folder", folder))?;
    check_surplus(folder, positions.len())?;
    environment.reset_to(start)?;
    let mut renderer = Renderer::new(settings, environment.scenery(), environment.physics().model())?;
    let mut picture = vec![0; renderer.picture_bytes()];
    for (row, qpos) in positions.iter().enumerate() {
        renderer.draw(qpos, &View::default(), &VideoLibrary::none(), &mut picture)?;
        write_png(&folder.join(format!("{row:06}.png")), &picture, settings.size)?;
    }
    Ok(())
}

/// That the folder has no picture of a row that this episode does not have.
fn check_surplus(folder: &Path, rows: usize) -> Result<()> {
    for file in std::fs::read_dir(folder).map_err(Error::io("list", folder))? {
        let name = file.map_err(Error::io("list", folder))?.file_name();
        let stem = name.to_str().and_then(|name| name.strip_suffix(".png")).filter(|stem| stem.len() == 6);
        if let Some(row) = stem.and_then(|stem| stem.parse::<usize>().ok()).filter(|&row| row >= rows) {
            let fact = format!("a picture of row {row} of another episode lies here, and this one has {rows} rows");
            return Err(Error::malformed(folder, fact, "remove those pictures, or name another folder"));
        }
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
