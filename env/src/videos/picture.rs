//! Frames as files: PNG and JPEG, whole or refused.
//!
//! In: a file's bytes. Out: RGB and its size. The JPEG decoder fills in grey what a file no longer holds, so that whether one is whole is checked here: its
//! segments and scans are followed to the marker that ends the picture.

use std::io::Cursor;

use image::{DynamicImage, ImageFormat, ImageReader, Limits};

/// The most memory that decoding a frame may take, bytes. A file of a hundred bytes may say that it is a picture of gigabytes.
const MOST_MEMORY: u64 = 256 << 20;

/// A decoded picture: RGB `[height, width, 3]`, width, height.
pub type Picture = (Vec<u8>, usize, usize);

/// Decodes a PNG or a JPEG.
///
/// # Errors
/// In words, when it is neither, damaged, cut off, empty, or larger than 256 MiB.
pub fn decode(bytes: &[u8]) -> Result<Picture, String> {
    let format = image::guess_format(bytes).map_err(|error| format!("not a readable picture ({error})"))?;
    if format == ImageFormat::Jpeg && !is_whole_jpeg(bytes) {
        return Err("a JPEG that is cut off: its end marker is missing".to_owned());
    }
    let picture = decoded(bytes, format).map_err(|error| format!("not a readable picture ({error})"))?.into_rgb8();
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    if width == 0 || height == 0 {
        return Err("an empty picture".to_owned());
    }
    Ok((picture.into_raw(), width, height))
}

fn decoded(bytes: &[u8], format: ImageFormat) -> image::ImageResult<DynamicImage> {
    let mut limits = Limits::default();
    limits.max_alloc = Some(MOST_MEMORY);
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    reader.limits(limits);
    reader.decode()
}

/// The marker that begins a picture, the one that ends it, and the one that begins a scan of entropy-coded data.
const START: u8 = 0xD8;
const END: u8 = 0xD9;
const SCAN: u8 = 0xDA;

/// Whether a JPEG reaches its end marker (ITU-T T.81, annex B). Bytes after it do not matter.
pub fn is_whole_jpeg(bytes: &[u8]) -> bool {
    let mut rest = bytes;
    loop {
        let Some((marker, after)) = next_marker(rest) else { return false };
        rest = match marker {
            END => return true,
            // No length follows: the start, restarts, and a marker for temporary use.
            START | 0xD0..=0xD7 | 0x01 => after,
            _ => {
                let Some([high, low]) = after.first_chunk() else { return false };
                let length = usize::from(u16::from_be_bytes([*high, *low]));
                let Some(body) = after.get(length.max(2)..) else { return false };
                // Inside a scan the next marker is found like any other: a byte of data that looks like one has a zero after it.
                if marker == SCAN && body.is_empty() {
                    return false;
                }
                body
            }
        };
    }
}

/// The next marker and what follows it, past data, stuffed bytes and fill bytes.
fn next_marker(bytes: &[u8]) -> Option<(u8, &[u8])> {
    let mut rest = bytes;
    loop {
        let at = rest.iter().position(|&byte| byte == 0xFF)?;
        rest = &rest[at + 1..];
        match rest.first()? {
            0x00 => rest = &rest[1..],
            0xFF => {}
            &marker => return Some((marker, &rest[1..])),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn jpeg(width: u32, height: u32) -> Vec<u8> {
        let picture =
            image::RgbImage::from_fn(width, height, |x, y| image::Rgb([(x * 37 + y * 11) as u8, y as u8, x as u8]));
        let mut bytes = Cursor::new(Vec::new());
        picture.write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
        bytes.into_inner()
    }

    /// Cut anywhere, a picture is refused; whole, or with something after its end, it is read.
    #[test]
    fn a_picture_is_whole_or_refused() {
        let whole = jpeg(40, 30);
        let (rgb, width, height) = decode(&whole).unwrap();
        assert_eq!((rgb.len(), width, height), (40 * 30 * 3, 40, 30));
        for length in 0..whole.len() {
            assert!(decode(&whole[..length]).is_err(), "the first {length} of {} bytes", whole.len());
        }
        let with_more = [whole.as_slice(), b"a camera's own notes \xFF\xD8"].concat();
        assert_eq!(decode(&with_more).unwrap().0, rgb);
        let mut png = Cursor::new(Vec::new());
        image::RgbImage::new(40, 30).write_to(&mut png, ImageFormat::Png).unwrap();
        let png = png.into_inner();
        assert!(decode(&png).is_ok() && decode(&png[..png.len() / 2]).is_err());
        assert!(decode(b"no picture").is_err());
    }

    /// What a picture says of its size is believed only as far as memory goes.
    #[test]
    fn a_small_file_asks_for_no_gigabyte() {
        let mut bytes = Cursor::new(Vec::new());
        image::RgbImage::new(1, 1).write_to(&mut bytes, ImageFormat::Png).unwrap();
        let mut bytes = bytes.into_inner();
        // The header: its length, its name, width, height, five bytes more, and a checksum of all but the length.
        bytes[16..24].copy_from_slice(&[10_000_u32.to_be_bytes(), 10_000_u32.to_be_bytes()].concat());
        let checksum = bytes[12..29].iter().fold(u32::MAX, |sum, byte| {
            (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ (0xEDB8_8320 & (sum & 1).wrapping_neg()))
        });
        bytes[29..33].copy_from_slice(&(!checksum).to_be_bytes());
        let error = decode(&bytes).unwrap_err();
        assert!(error.contains("emory limit"), "{error}");
    }

    /// A thumbnail in a segment has an end marker of its own, which does not count.
    #[test]
    fn the_end_of_a_thumbnail_is_not_the_end() {
        let (whole, thumbnail) = (jpeg(40, 30), jpeg(8, 8));
        let segment = [&[0xFF, 0xE1], &((thumbnail.len() + 2) as u16).to_be_bytes()[..], &thumbnail].concat();
        let with = [&whole[..2], &segment, &whole[2..]].concat();
        assert!(is_whole_jpeg(&with));
        assert!(!is_whole_jpeg(&with[..with.len() - 2]));
        assert!(!is_whole_jpeg(&with[..with.len() / 2 + segment.len() / 2]));
    }
}
