//! Pixels as the bytes of a file.

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder as _, ImageError};

use super::Pixels;

/// The bytes of a PNG file.
///
/// # Errors
/// If the pixels do not fill the stated size.
pub fn encode_png(pixels: &Pixels) -> Result<Vec<u8>, ImageError> {
    let mut bytes = Vec::new();
    let (width, height) = (pixels.width, pixels.height);
    PngEncoder::new(&mut bytes).write_image(&pixels.rgb, width, height, ExtendedColorType::Rgb8)?;
    Ok(bytes)
}

/// The bytes of a JPEG file; `quality` of 100.
///
/// # Errors
/// If the pixels do not fill the stated size.
pub fn encode_jpeg(pixels: &Pixels, quality: u8) -> Result<Vec<u8>, ImageError> {
    let mut bytes = Vec::new();
    let (width, height) = (pixels.width, pixels.height);
    let encoder = JpegEncoder::new_with_quality(&mut bytes, quality);
    encoder.write_image(&pixels.rgb, width, height, ExtendedColorType::Rgb8)?;
    Ok(bytes)
}
