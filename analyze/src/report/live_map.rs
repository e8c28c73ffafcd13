//! A map that answers: every row a point, coloured by any column; a click shows a row's frame and its neighbours, a slider runs through its episode, a
//! region shows the frames in it.
//!
//! Numbers are written as base64 of little-endian arrays and frames lie on sprite sheets of at most 32 × 32 as JPEG, at the end of the page, so that a
//! browser paints the words and figures before it reads them.

use std::fmt::Write as _;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::json;

use crate::picture::Pixels;
use crate::picture::encode::encode_jpeg;
use crate::picture::svg::escape;

/// Frames along a side of a sprite sheet (a browser's limit on an image's side is never near).
const SHEET: usize = 32;
/// Qualities tried for the sprite sheets, of 100, and by how much the side of a frame is divided.
const TRIES: [(u8, u32); 5] = [(85, 1), (70, 1), (50, 1), (60, 2), (40, 2)];

/// A column to colour by.
#[derive(Clone, Debug, PartialEq)]
pub struct LiveColumn {
    /// Its name.
    pub name: String,
    /// One value a row; NaN where there is none. Kinds by number.
    pub values: Vec<f32>,
    /// What the kinds are called; empty for quantities.
    pub kinds: Vec<String>,
}

/// The map.
#[derive(Clone, Debug, Default)]
pub struct LiveMap {
    /// Whose it is: the run.
    pub name: String,
    /// `[rows]`.
    pub episode: Vec<u32>,
    /// `[rows]`.
    pub step: Vec<u32>,
    /// `[rows]`.
    pub positions: Vec<[f32; 2]>,
    /// What the points can be coloured by, at least one.
    pub columns: Vec<LiveColumn>,
    /// Rows that can be chosen, in order of episode and step.
    pub alive: Vec<u32>,
    /// Neighbours a row that can be chosen has.
    pub k: usize,
    /// `[alive, k]`: their rows, nearest first.
    pub near: Vec<u32>,
    /// `[alive, k]`: how far they are.
    pub distance: Vec<f32>,
    /// Rows that have a frame, in the order of the frames.
    pub framed: Vec<u32>,
    /// The frames, all of one size.
    pub frames: Vec<Pixels>,
}

impl LiveMap {
    /// The map's place in the page.
    pub(super) fn write(&self, body: &mut String, id: &str) {
        let help = "Click a point for its frame and neighbours; drag to move, turn the wheel to zoom, hold Shift and drag to select a region. \
                    Keys: left and right through time, up and down through episodes, + and − to zoom, 0 for the whole map, Escape to end a selection.";
        let name = escape(&self.name);
        let disabled = if self.frames.is_empty() { " hidden" } else { "" };
        let _ = writeln!(
            body,
            "<div class=\"live\" id=\"{id}\"><div><h4>{name}</h4>\
             <div class=\"tools\"><label>colour <select></select></label><button type=\"button\" class=\"region\" aria-pressed=\"false\">select a region</button>\
             <button type=\"button\" class=\"in\" aria-label=\"zoom in\">+</button><button type=\"button\" class=\"out\" aria-label=\"zoom out\">−</button>\
             <button type=\"button\" class=\"whole\">whole map</button></div>\
             <div class=\"stage\"><canvas class=\"cloud\" tabindex=\"0\" role=\"application\" aria-label=\"map of the latents of {name}, {rows} points\" \
             aria-describedby=\"{id}-help\"></canvas></div><div class=\"legend\"></div>\
             <div class=\"film\"{disabled}><button type=\"button\" class=\"play\" aria-pressed=\"false\" aria-label=\"play the episode\">▶</button>\
             <input type=\"range\" class=\"time\" min=\"0\" max=\"0\" value=\"0\" aria-label=\"step within the episode\"><output></output></div>\
             <p class=\"help\" id=\"{id}-help\">{help}</p></div>\
             <div><div class=\"card\" aria-live=\"polite\"><p>No point is chosen yet.</p></div><div class=\"chosen\" aria-live=\"polite\"></div></div></div>",
            rows = self.positions.len(),
        );
    }

    /// About the bytes that the map's numbers take on the page.
    pub(super) fn number_bytes(&self) -> usize {
        let of_rows = self.positions.len() * (4 + self.columns.len());
        let of_chosen = self.alive.len() * (1 + 2 * self.k) + self.framed.len();
        (of_rows + of_chosen) * size_of::<f32>() * 4 / 3
    }

    /// The map's data, for the end of the page; frames take at most `most_bytes` before they are written as text, a third more as text.
    ///
    /// Beyond it they are packed tighter, then drawn smaller.
    pub(super) fn write_data(&self, data: &mut String, id: &str, most_bytes: usize) {
        let (sheets, size) = self.sheets(most_bytes);
        let numbers = |values: &mut dyn Iterator<Item = f32>| {
            STANDARD.encode(values.flat_map(f32::to_le_bytes).collect::<Vec<u8>>())
        };
        let keys = |values: &[u32]| STANDARD.encode(values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
        let columns = self.columns.iter().map(|column| {
            let kinds = Some(&column.kinds).filter(|kinds| !kinds.is_empty());
            json!({ "name": column.name, "values": numbers(&mut column.values.iter().copied()), "kinds": kinds })
        });
        let document = json!({
            "width": size.0, "height": size.1, "sheet": SHEET, "k": self.k, "extent": self.extent(),
            "x": numbers(&mut self.positions.iter().map(|p| p[0])), "y": numbers(&mut self.positions.iter().map(|p| p[1])),
            "episode": keys(&self.episode), "step": keys(&self.step), "columns": columns.collect::<Vec<_>>(),
            "alive": keys(&self.alive), "near": keys(&self.near), "distance": numbers(&mut self.distance.iter().copied()),
            "framed": keys(&self.framed),
        });
        // In a script element "</script" would end it, and "<!--<script" would hide its end: in JSON a "<" stands within texts alone.
        let document = document.to_string().replace('<', "\\u003c");
        let _ = writeln!(data, "<script type=\"application/json\" data-map=\"{id}\">{document}</script>");
        for (number, sheet) in sheets.iter().enumerate() {
            let sheet = STANDARD.encode(sheet);
            let _ = writeln!(data, "<script type=\"text/plain\" data-sheet=\"{id}-{number}\">{sheet}</script>");
        }
    }

    /// The map's box: left, right, lower, upper.
    fn extent(&self) -> [f32; 4] {
        let none = [f32::INFINITY, f32::NEG_INFINITY, f32::INFINITY, f32::NEG_INFINITY];
        let with = |e: [f32; 4], p: &[f32; 2]| [e[0].min(p[0]), e[1].max(p[0]), e[2].min(p[1]), e[3].max(p[1])];
        let extent = self.positions.iter().fold(none, with);
        if extent.iter().all(|end| end.is_finite()) { extent } else { [0.0, 1.0, 0.0, 1.0] }
    }

    /// The sprite sheets, packed so that they stay within their share of the page, and the size of a frame on them.
    fn sheets(&self, most_bytes: usize) -> (Vec<Vec<u8>>, (u32, u32)) {
        let size = self.frames.first().map_or((1, 1), |f| (f.width, f.height));
        let mut packed = (Vec::new(), size);
        for (quality, divide) in TRIES {
            let frames: Vec<Pixels> = self.frames.iter().map(|frame| shrunk(frame, divide)).collect();
            let sheets = frames.chunks(SHEET * SHEET).map(|sheet| sprite_sheet(sheet, quality));
            packed = (sheets.collect::<Vec<_>>(), (size.0.div_ceil(divide), size.1.div_ceil(divide)));
            if packed.0.iter().map(Vec::len).sum::<usize>() <= most_bytes {
                break;
            }
        }
        packed
    }
}

/// A frame whose side is divided: the mean of the pixels that become one.
fn shrunk(frame: &Pixels, divide: u32) -> Pixels {
    if divide <= 1 {
        return frame.clone();
    }
    let (w, h) = (frame.width.div_ceil(divide), frame.height.div_ceil(divide));
    let mean = |x: u32, y: u32, channel: usize| {
        let inside = |v: u32, end: u32| (v * divide..((v + 1) * divide).min(end)).collect::<Vec<_>>();
        let (xs, ys) = (inside(x, frame.width), inside(y, frame.height));
        let at = |x: u32, y: u32| u32::from(frame.rgb[((y * frame.width + x) * 3) as usize + channel]);
        let sum: u32 = ys.iter().flat_map(|&y| xs.iter().map(move |&x| (x, y))).map(|(x, y)| at(x, y)).sum();
        (sum / (xs.len() * ys.len()).max(1) as u32) as u8
    };
    let pixel = |i: u32| [0, 1, 2].map(|channel| mean(i % w, i / w, channel));
    Pixels { width: w, height: h, rgb: (0..w * h).flat_map(pixel).collect() }
}

/// The frames of a sheet in rows of [`SHEET`], as JPEG.
fn sprite_sheet(frames: &[Pixels], quality: u8) -> Vec<u8> {
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
    encode_jpeg(&sheet, quality).unwrap_or_default()
}
