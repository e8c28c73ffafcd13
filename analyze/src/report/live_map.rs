//! A map to hover over: all points as background, some of them alive with their frame and their neighbours' frames.
//!
//! Frames lie on sprite sheets of at most 32 × 32 frames (a browser's limit on an image's side is never near), as JPEG.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::json;

use crate::picture::Pixels;
use crate::picture::png::encode_jpeg;

/// Frames along a side of a sprite sheet.
const SHEET: usize = 32;
/// Quality of the sprite sheets, of 100.
const JPEG_QUALITY: u8 = 85;

/// A point that can be hovered over.
#[derive(Clone, Debug, PartialEq)]
pub struct LivePoint {
    /// Place on the map.
    pub x: f32,
    /// Place on the map.
    pub y: f32,
    /// `EPISODE:STEP` and what else is known, for the card.
    pub text: String,
    /// A value in 0..=1 for its colour.
    pub color: f32,
    /// Index of its frame, if there is one.
    pub frame: Option<usize>,
    /// Its neighbours: text and frame, nearest first.
    pub neighbours: Vec<(String, Option<usize>)>,
}

/// The map.
#[derive(Clone, Debug, Default)]
pub struct LiveMap {
    /// What the colours say.
    pub color_name: String,
    /// All points, `[rows, 2]`.
    pub background: Vec<[f32; 2]>,
    /// Those that can be hovered over.
    pub points: Vec<LivePoint>,
    /// The frames, all of one size.
    pub frames: Vec<Pixels>,
}

impl LiveMap {
    pub(super) fn write(&self, body: &mut String, number: usize) {
        let size = self.frames.first().map_or((1, 1), |f| (f.width, f.height));
        let round = |v: f32| (f64::from(v) * 1000.0).round() / 1000.0;
        let points: Vec<_> = self
            .points
            .iter()
            .map(|p| json!([round(p.x), round(p.y), round(p.color), p.text, p.frame, p.neighbours]))
            .collect();
        let data = json!({
            "colorName": self.color_name, "width": size.0, "height": size.1, "sheet": SHEET,
            "background": self.background.iter().map(|p| [round(p[0]), round(p[1])]).collect::<Vec<_>>(),
            "points": points,
        });
        // In a script element only "</" could end the element.
        let data = data.to_string().replace("</", "<\\/");
        let _ = writeln!(
            body,
            "<div class=\"live\" id=\"map{number}\"><canvas class=\"cloud\" width=\"560\" height=\"440\" tabindex=\"0\" \
             aria-label=\"map of the latents; hover over a point, or use the arrow keys\"></canvas>\
             <div class=\"card\" aria-live=\"polite\"><p>Hover over a coloured point.</p></div>"
        );
        for sheet in self.frames.chunks(SHEET * SHEET) {
            let jpeg = sprite_sheet(sheet);
            let _ = writeln!(
                body,
                "<img hidden class=\"sheet\" alt=\"\" src=\"data:image/jpeg;base64,{}\">",
                STANDARD.encode(jpeg)
            );
        }
        let _ = writeln!(body, "<script type=\"application/json\">{data}</script></div>");
    }
}

/// The frames of a sheet in rows of [`SHEET`], as JPEG.
fn sprite_sheet(frames: &[Pixels]) -> Vec<u8> {
    let (w, h) = frames.first().map_or((1, 1), |f| (f.width as usize, f.height as usize));
    let (columns, rows) = (frames.len().min(SHEET), frames.len().div_ceil(SHEET));
    let mut rgb = vec![255; columns * w * rows * h * 3];
    for (i, frame) in frames.iter().enumerate().filter(|(_, f)| f.rgb.len() == w * h * 3) {
        let (left, top) = (i % SHEET * w, i / SHEET * h);
        for y in 0..h {
            let at = ((top + y) * columns * w + left) * 3;
            rgb[at..at + w * 3].copy_from_slice(&frame.rgb[y * w * 3..(y + 1) * w * 3]);
        }
    }
    let sheet = Pixels { width: (columns * w) as u32, height: (rows * h) as u32, rgb };
    encode_jpeg(&sheet, JPEG_QUALITY).unwrap_or_default()
}
