//! Pictures as an H.264 stream in which every picture stands whole (the macroblock type `I_PCM`): a decoder gets back exactly the luma and chroma written here.
//!
//! In: RGB pictures `[height, width, 3]`. Out: MP4 files. Lost is what 4:2:0 loses: chroma is averaged over 2 x 2 pixels, and the conversion to full-range
//! BT.601 rounds to whole numbers. In exchange any picture is decoded without its neighbours.

use std::path::Path;

use less_avc::ycbcr_image::{DataPlane, Planes, YCbCrImage};
use less_avc::{BitDepth, LessEncoder};
use vibes_data::ImageSize;

use super::mp4::Mp4Writer;
use crate::error::{Error, Result};

/// An MP4 file that grows picture by picture.
pub(super) struct Video {
    size: ImageSize,
    seconds: f64,
    state: Option<(LessEncoder, Mp4Writer)>,
}

impl Video {
    /// A video of pictures of this size, each shown for this long.
    ///
    /// # Errors
    /// [`Error::Selection`] for odd sides, which 4:2:0 does not have.
    pub(super) fn new(size: ImageSize, seconds: f64) -> Result<Self> {
        if size.width % 2 == 1 || size.height % 2 == 1 {
            let fact = format!("pictures of {} x {} in a video", size.height, size.width);
            return Err(Error::Selection { fact, expected: "even sides, or --pictures png".into() });
        }
        Ok(Self { size, seconds, state: None })
    }

    /// Appends a picture; the first one makes the file.
    pub(super) fn push(&mut self, path: &Path, pixels: &[u8]) -> Result<()> {
        let planes = ycbcr(pixels, self.size);
        let image = planes.image(self.size);
        let refused =
            |error: less_avc::Error| Error::malformed(path, error.to_string(), "a picture that H.264 can hold");
        match &mut self.state {
            Some((encoder, file)) => {
                let unit = encoder.encode(&image).map_err(refused)?;
                file.push(&unit.to_nal_unit())
            }
            None => {
                let (first, encoder) = LessEncoder::new(&image).map_err(refused)?;
                let mut file = Mp4Writer::create(
                    path,
                    self.size,
                    self.seconds,
                    &first.sps.to_nal_unit(),
                    &first.pps.to_nal_unit(),
                )?;
                file.push(&first.frame.to_nal_unit())?;
                self.state = Some((encoder, file));
                Ok(())
            }
        }
    }

    /// Bytes of the file so far.
    pub(super) fn bytes(&self) -> u64 {
        self.state.as_ref().map_or(0, |(_, file)| file.bytes())
    }

    /// Completes the file; the next picture begins another.
    pub(super) fn finish(&mut self) -> Result<()> {
        self.state.take().map_or(Ok(()), |(_, file)| file.finish())
    }
}

/// The three planes of a picture, padded to whole macroblocks of 16 x 16 by their last row and column.
struct Ycbcr {
    luma: Vec<u8>,
    chroma: [Vec<u8>; 2],
    stride: usize,
}

impl Ycbcr {
    fn image(&self, size: ImageSize) -> YCbCrImage<'_> {
        let plane = |data, stride| DataPlane { data, stride, bit_depth: BitDepth::Depth8 };
        let chroma = |i: usize| plane(&self.chroma[i], self.stride / 2);
        let planes = Planes::YCbCr((plane(&self.luma, self.stride), chroma(0), chroma(1)));
        YCbCrImage { planes, width: size.width, height: size.height }
    }
}

/// Full-range BT.601, as decoders assume where a stream says nothing.
fn ycbcr(pixels: &[u8], size: ImageSize) -> Ycbcr {
    let (height, width) = (size.height as usize, size.width as usize);
    let (rows, stride) = (height.next_multiple_of(16), width.next_multiple_of(16));
    let rgb = |y: usize, x: usize| -> [f32; 3] {
        let at = 3 * (y.min(height - 1) * width + x.min(width - 1));
        [0, 1, 2].map(|channel| f32::from(pixels[at + channel]))
    };
    let byte = |value: f32| value.round().clamp(0.0, 255.0) as u8;
    let mut luma = Vec::with_capacity(rows * stride);
    for y in 0..rows {
        luma.extend((0..stride).map(|x| {
            let [r, g, b] = rgb(y, x);
            byte(0.299 * r + 0.587 * g + 0.114 * b)
        }));
    }
    let mut chroma = [Vec::with_capacity(rows * stride / 4), Vec::with_capacity(rows * stride / 4)];
    for y in (0..rows).step_by(2) {
        for x in (0..stride).step_by(2) {
            let four = [rgb(y, x), rgb(y, x + 1), rgb(y + 1, x), rgb(y + 1, x + 1)];
            let [r, g, b] = [0, 1, 2].map(|channel| four.iter().map(|pixel| pixel[channel]).sum::<f32>() / 4.0);
            chroma[0].push(byte(128.0 - 0.168_736 * r - 0.331_264 * g + 0.5 * b));
            chroma[1].push(byte(128.0 + 0.5 * r - 0.418_688 * g - 0.081_312 * b));
        }
    }
    Ycbcr { luma, chroma, stride }
}
