//! A picture: a list of shapes in points (1/72 inch, y down), written as SVG and as PNG.
//!
//! Figures put shapes in, [`svg`] and [`png`] take them out. Text is drawn as outlines of an embedded font, so a picture looks the same in
//! a browser, in a paper and as pixels, and on a machine without fonts.

pub mod color;
pub mod encode;
pub mod font;
pub mod number;
pub mod plot;
pub mod png;
pub mod svg;

use std::sync::Arc;

use color::Color;
use font::Weight;

/// Width of one column of a two-column paper, points (3.3 in).
pub const COLUMN: f64 = 237.6;
/// Width of a page of such a paper, points (6.9 in).
pub const PAGE: f64 = 496.8;

/// A point, in points from the picture's upper left corner.
pub type Point = (f64, f64);

/// An axis-aligned rectangle, points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    /// Left edge.
    pub x: f64,
    /// Upper edge.
    pub y: f64,
    /// Width.
    pub w: f64,
    /// Height.
    pub h: f64,
}

impl Rect {
    /// A rectangle from its upper left corner and its size.
    #[must_use]
    pub fn new(x: f64, y: f64, w: f64, h: f64) -> Self {
        Self { x, y, w, h }
    }

    /// The right edge.
    #[must_use]
    pub fn right(&self) -> f64 {
        self.x + self.w
    }

    /// The lower edge.
    #[must_use]
    pub fn bottom(&self) -> f64 {
        self.y + self.h
    }
}

/// An RGB image inside a picture, `[height, width, 3]`, row major.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pixels {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `[height, width, 3]` bytes.
    pub rgb: Vec<u8>,
}

/// Where a text stands relative to its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// The text begins at the point.
    Start,
    /// The text is centred on the point.
    Middle,
    /// The text ends at the point.
    End,
}

impl Anchor {
    /// Which share of a text's width lies before its point.
    #[must_use]
    pub fn before(self) -> f64 {
        match self {
            Self::Start => 0.0,
            Self::Middle => 0.5,
            Self::End => 1.0,
        }
    }
}

/// How a text looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextStyle {
    /// Size of the em square, points.
    pub size: f64,
    /// Regular or bold.
    pub weight: Weight,
    /// Colour.
    pub color: Color,
    /// Which part of the text stands at the point.
    pub anchor: Anchor,
    /// Turned a quarter to the left (reads upwards), as labels of y axes are.
    pub upwards: bool,
}

impl TextStyle {
    /// Regular dark text of a size, beginning at its point.
    #[must_use]
    pub fn new(size: f64) -> Self {
        Self { size, weight: Weight::Regular, color: color::INK, anchor: Anchor::Start, upwards: false }
    }

    /// The same, bold.
    #[must_use]
    pub fn bold(self) -> Self {
        Self { weight: Weight::Bold, ..self }
    }

    /// The same in another colour.
    #[must_use]
    pub fn color(self, color: Color) -> Self {
        Self { color, ..self }
    }

    /// The same with another anchor.
    #[must_use]
    pub fn anchor(self, anchor: Anchor) -> Self {
        Self { anchor, ..self }
    }

    /// The same, reading upwards.
    #[must_use]
    pub fn upwards(self) -> Self {
        Self { upwards: true, ..self }
    }
}

/// One shape.
#[derive(Clone, Debug)]
pub enum Shape {
    /// A line through points.
    Line {
        /// The corners, at least two.
        points: Vec<Point>,
        /// Width in points.
        width: f64,
        /// Colour.
        color: Color,
        /// Dash and gap lengths in points; none is a solid line.
        dash: Option<(f64, f64)>,
    },
    /// A filled polygon.
    Polygon {
        /// The corners, at least three.
        points: Vec<Point>,
        /// Colour.
        color: Color,
    },
    /// Equal round dots. Coordinates are relative to `origin`, so that panels can share one list.
    Dots {
        /// Where the list's (0, 0) lies.
        origin: Point,
        /// The centres.
        centers: Arc<Vec<Point>>,
        /// Radius in points.
        radius: f64,
        /// Colour.
        color: Color,
    },
    /// An image stretched over a rectangle.
    Image {
        /// The pixels.
        pixels: Arc<Pixels>,
        /// Where they go.
        rect: Rect,
    },
    /// A line of text on its baseline.
    Text {
        /// The anchor point on the baseline.
        at: Point,
        /// What it says.
        text: String,
        /// How it looks.
        style: TextStyle,
    },
}

/// A picture of a given size on white, with a title for those who cannot see it.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Width, points.
    pub width: f64,
    /// Height, points.
    pub height: f64,
    /// What the picture shows, in one sentence.
    pub title: String,
    /// The shapes, the first at the bottom.
    pub shapes: Vec<Shape>,
}

impl Picture {
    /// An empty picture.
    #[must_use]
    pub fn new(width: f64, height: f64, title: impl Into<String>) -> Self {
        Self { width, height, title: title.into(), shapes: Vec::new() }
    }

    /// Adds a solid line.
    pub fn line(&mut self, points: &[Point], width: f64, color: Color) {
        self.shapes.push(Shape::Line { points: points.to_vec(), width, color, dash: None });
    }

    /// Adds a dashed line.
    pub fn dashed(&mut self, points: &[Point], width: f64, color: Color, dash: (f64, f64)) {
        self.shapes.push(Shape::Line { points: points.to_vec(), width, color, dash: Some(dash) });
    }

    /// Adds a filled rectangle.
    pub fn fill(&mut self, r: Rect, color: Color) {
        self.polygon(&[(r.x, r.y), (r.right(), r.y), (r.right(), r.bottom()), (r.x, r.bottom())], color);
    }

    /// Adds the outline of a rectangle.
    pub fn frame(&mut self, r: Rect, width: f64, color: Color) {
        self.line(
            &[(r.x, r.y), (r.right(), r.y), (r.right(), r.bottom()), (r.x, r.bottom()), (r.x, r.y)],
            width,
            color,
        );
    }

    /// Adds a filled polygon.
    pub fn polygon(&mut self, points: &[Point], color: Color) {
        self.shapes.push(Shape::Polygon { points: points.to_vec(), color });
    }

    /// Adds one dot.
    pub fn dot(&mut self, at: Point, radius: f64, color: Color) {
        self.shapes.push(Shape::Dots { origin: at, centers: Arc::new(vec![(0.0, 0.0)]), radius, color });
    }

    /// Adds dots that share a list.
    pub fn dots(&mut self, origin: Point, centers: Arc<Vec<Point>>, radius: f64, color: Color) {
        self.shapes.push(Shape::Dots { origin, centers, radius, color });
    }

    /// Adds an image.
    pub fn image(&mut self, pixels: Arc<Pixels>, rect: Rect) {
        self.shapes.push(Shape::Image { pixels, rect });
    }

    /// Adds a line of text.
    pub fn text(&mut self, at: Point, text: impl Into<String>, style: TextStyle) {
        self.shapes.push(Shape::Text { at, text: text.into(), style });
    }
}
