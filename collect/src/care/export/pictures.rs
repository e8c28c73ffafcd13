//! Pictures as PNG files in memory.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use vibes_data::ImageSize;

use crate::error::{Error, Result};

/// One RGB picture, `[height, width, 3]`, as a PNG.
pub(super) fn png(pixels: &[u8], size: ImageSize) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::Adaptive)
        .write_image(pixels, size.width, size.height, ExtendedColorType::Rgb8)
        .map_err(|error| Error::Selection { fact: error.to_string(), expected: "three bytes a pixel".into() })?;
    Ok(bytes)
}
