//! Pictures as SVG: letters are outlines defined once and used many times, images are embedded, nothing is fetched.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::sync::Arc;

use base64::Engine as _;

use super::color::Color;
use super::font::{self, Segment, Weight};
use super::{Picture, Pixels, Point, Shape, TextStyle};

/// The picture as an SVG document.
#[must_use]
pub fn render(picture: &Picture) -> String {
    let mut writer = Writer::default();
    for shape in &picture.shapes {
        writer.shape(shape);
    }
    let (w, h) = (number(picture.width), number(picture.height));
    let title = escape(&picture.title);
    let Writer { body, defs, .. } = writer;
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:xlink=\"http://www.w3.org/1999/xlink\" width=\"{w}pt\" height=\"{h}pt\" \
         viewBox=\"0 0 {w} {h}\" role=\"img\">\n<title>{title}</title>\n<defs>\n{defs}</defs>\n\
         <rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n{body}</svg>\n"
    )
}

/// What a document of [`render`] shows, in one sentence: the title of its picture.
pub(crate) fn title(document: &str) -> Option<String> {
    let (title, _) = document.split_once("<title>")?.1.split_once("</title>")?;
    // The ampersand comes last: what it stands before may be text.
    let signs = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&#39;", "'"), ("&amp;", "&")];
    Some(signs.iter().fold(title.to_string(), |text, (escaped, sign)| text.replace(escaped, sign)))
}

/// A number with at most two decimals and no trailing zeros.
pub(crate) fn number(v: f64) -> String {
    let s = format!("{v:.2}");
    let s = s.trim_end_matches('0').trim_end_matches('.');
    if s == "-0" { "0".to_string() } else { s.to_string() }
}

/// The text with the five characters escaped that mean something in XML.
pub(crate) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;").replace('\'', "&#39;")
}

/// A PNG image as a data address.
pub(crate) fn data_uri(pixels: &Pixels) -> String {
    let png = super::encode::encode_png(pixels).unwrap_or_default();
    format!("data:image/png;base64,{}", base64::engine::general_purpose::STANDARD.encode(png))
}

#[derive(Default)]
struct Writer {
    body: String,
    defs: String,
    glyphs: BTreeMap<(Weight, u16), usize>,
    dots: Vec<(Arc<Vec<Point>>, usize)>,
    images: Vec<(Arc<Pixels>, usize)>,
    next: usize,
}

impl Writer {
    fn shape(&mut self, shape: &Shape) {
        match shape {
            Shape::Line { points, width, color, dash } => self.line(points, *width, *color, *dash),
            Shape::Polygon { points, color } => {
                let _ = writeln!(self.body, "<path d=\"{}Z\"{}/>", steps(points), fill(*color));
            }
            Shape::Dots { origin, centers, radius, color } => self.dots(*origin, centers, *radius, *color),
            Shape::Image { pixels, rect } => {
                let id = self.image(pixels);
                let (sx, sy) = (rect.w / f64::from(pixels.width.max(1)), rect.h / f64::from(pixels.height.max(1)));
                let (x, y) = (number(rect.x), number(rect.y));
                let _ = writeln!(
                    self.body,
                    "<use xlink:href=\"#i{id}\" transform=\"translate({x} {y}) scale({sx:.5} {sy:.5})\"/>"
                );
            }
            Shape::Text { at, text, style } => self.text(*at, text, style),
        }
    }

    fn line(&mut self, points: &[Point], width: f64, color: Color, dash: Option<(f64, f64)>) {
        let dash = dash.map_or_else(String::new, |(a, b)| format!(" stroke-dasharray=\"{} {}\"", number(a), number(b)));
        let _ = writeln!(
            self.body,
            "<path d=\"{}\" fill=\"none\" stroke-linejoin=\"round\"{}{dash}/>",
            steps(points),
            stroke(color, width)
        );
    }

    /// Dots are zero-length strokes with round caps: a dozen bytes a dot.
    fn dots(&mut self, origin: Point, centers: &Arc<Vec<Point>>, radius: f64, color: Color) {
        let known = self.dots.iter().find(|(list, _)| Arc::ptr_eq(list, centers)).map(|(_, id)| *id);
        let id = known.unwrap_or_else(|| {
            let id = self.id();
            let mut d = String::new();
            let mut drawn = std::collections::BTreeSet::new();
            for &(x, y) in centers.iter() {
                let (x, y) = (number(x), number(y));
                if drawn.insert((x.clone(), y.clone())) {
                    let _ = write!(d, "M{x} {y}h0");
                }
            }
            let _ = writeln!(self.defs, "<path id=\"d{id}\" d=\"{d}\"/>");
            self.dots.push((centers.clone(), id));
            id
        });
        let (x, y) = (number(origin.0), number(origin.1));
        let _ = writeln!(
            self.body,
            "<use xlink:href=\"#d{id}\" x=\"{x}\" y=\"{y}\" fill=\"none\" stroke-linecap=\"round\"{}/>",
            stroke(color, 2.0 * radius)
        );
    }

    fn image(&mut self, pixels: &Arc<Pixels>) -> usize {
        if let Some((_, id)) = self.images.iter().find(|(known, _)| Arc::ptr_eq(known, pixels)) {
            return *id;
        }
        let id = self.id();
        let uri = data_uri(pixels);
        let _ = writeln!(
            self.defs,
            "<image id=\"i{id}\" width=\"{}\" height=\"{}\" xlink:href=\"{uri}\"/>",
            pixels.width, pixels.height
        );
        self.images.push((pixels.clone(), id));
        id
    }

    fn text(&mut self, at: Point, text: &str, style: &TextStyle) {
        let (letters, ems) = font::lay_out(text, style.weight);
        let start = -style.anchor.before() * ems;
        let turn = if style.upwards { " rotate(-90)" } else { "" };
        let (x, y, size) = (number(at.0), number(at.1), number(style.size));
        let label = escape(text);
        let fill = fill(style.color);
        let _ =
            write!(self.body, "<g aria-label=\"{label}\" transform=\"translate({x} {y}){turn} scale({size})\"{fill}>");
        for letter in letters {
            if let Some(id) = self.glyph(letter.glyph, style.weight) {
                let _ = write!(self.body, "<use xlink:href=\"#g{id}\" x=\"{:.3}\"/>", start + letter.x);
            }
        }
        self.body.push_str("</g>\n");
    }

    /// The number of a glyph's definition; none for a glyph without ink.
    fn glyph(&mut self, glyph: u16, weight: Weight) -> Option<usize> {
        if let Some(id) = self.glyphs.get(&(weight, glyph)) {
            return Some(*id);
        }
        let outline = font::outline(glyph, weight);
        if outline.is_empty() {
            return None;
        }
        let id = self.id();
        let _ = writeln!(self.defs, "<path id=\"g{id}\" d=\"{}\"/>", outline.iter().map(segment).collect::<String>());
        self.glyphs.insert((weight, glyph), id);
        Some(id)
    }

    fn id(&mut self) -> usize {
        self.next += 1;
        self.next
    }
}

fn steps(points: &[Point]) -> String {
    let mut d = String::new();
    for (i, &(x, y)) in points.iter().enumerate() {
        let _ = write!(d, "{}{} {}", if i == 0 { 'M' } else { 'L' }, number(x), number(y));
    }
    d
}

fn segment(s: &Segment) -> String {
    match *s {
        Segment::Move(x, y) => format!("M{x:.3} {y:.3}"),
        Segment::Line(x, y) => format!("L{x:.3} {y:.3}"),
        Segment::Quad(a, b, x, y) => format!("Q{a:.3} {b:.3} {x:.3} {y:.3}"),
        Segment::Cubic(a, b, c, d, x, y) => format!("C{a:.3} {b:.3} {c:.3} {d:.3} {x:.3} {y:.3}"),
        Segment::Close => "Z".to_string(),
    }
}

fn fill(color: Color) -> String {
    let opacity = if color.alpha < 1.0 { format!(" fill-opacity=\"{:.2}\"", color.alpha) } else { String::new() };
    format!(" fill=\"{}\"{opacity}", color.hex())
}

fn stroke(color: Color, width: f64) -> String {
    let opacity = if color.alpha < 1.0 { format!(" stroke-opacity=\"{:.2}\"", color.alpha) } else { String::new() };
    format!(" stroke=\"{}\" stroke-width=\"{}\"{opacity}", color.hex(), number(width))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_title_is_read_as_it_was_written() {
        for wanted in ["4,000 latents, coloured by time", "a < b & c's \"d\" &lt; e", ""] {
            assert_eq!(title(&render(&Picture::new(10.0, 10.0, wanted))).as_deref(), Some(wanted));
        }
        assert_eq!(title("<svg></svg>"), None);
    }
}
