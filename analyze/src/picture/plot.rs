//! A picture as a canvas for Plotters: axes, ticks and series are its work, and become shapes of the picture.
//!
//! Plotters thinks in whole pixels and leaves fonts to the viewer. This canvas reports a size 64 times that of the picture in points and divides back, so
//! that places are exact to a 64th of a point, and text becomes outlines of the embedded font, measured by it.

use std::convert::Infallible;
use std::sync::Arc;

use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind, FontStyle,
    FontTransform,
};

use super::color::Color;
use super::font::{self, Weight};
use super::{Anchor, Picture, Pixels, Point, Rect, Shape, TextStyle};

/// Plotters' pixels in a point.
pub const UNITS: f64 = 64.0;
/// Height of capitals above the baseline, of the size.
const CAPITALS: f64 = 0.73;

/// Points as whole pixels of Plotters.
#[must_use]
pub fn units(points: f64) -> i32 {
    (points * UNITS).round() as i32
}

/// Points as a width or a size.
#[must_use]
pub fn width_units(points: f64) -> u32 {
    (points * UNITS).round().max(0.0) as u32
}

/// A picture that Plotters draws on.
#[derive(Debug)]
pub struct Canvas<'p> {
    picture: &'p mut Picture,
}

impl<'p> Canvas<'p> {
    /// The picture as a canvas.
    pub fn new(picture: &'p mut Picture) -> Self {
        Self { picture }
    }
}

type Done = Result<(), DrawingErrorKind<Infallible>>;

fn point(at: BackendCoord) -> Point {
    (f64::from(at.0) / UNITS, f64::from(at.1) / UNITS)
}

fn color(color: BackendColor) -> Color {
    let (r, g, b) = color.rgb;
    Color::new(r, g, b).alpha(color.alpha as f32)
}

fn is_seen(color: BackendColor) -> bool {
    color.alpha > 0.0
}

fn between(a: BackendCoord, b: BackendCoord) -> Rect {
    let (a, b) = (point(a), point(b));
    Rect::new(a.0.min(b.0), a.1.min(b.1), (b.0 - a.0).abs(), (b.1 - a.1).abs())
}

fn weight(style: FontStyle) -> Weight {
    if matches!(style, FontStyle::Bold) { Weight::Bold } else { Weight::Regular }
}

impl DrawingBackend for Canvas<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        (width_units(self.picture.width), width_units(self.picture.height))
    }

    fn ensure_prepared(&mut self) -> Done {
        Ok(())
    }

    fn present(&mut self) -> Done {
        Ok(())
    }

    fn draw_pixel(&mut self, at: BackendCoord, of: BackendColor) -> Done {
        let (x, y) = point(at);
        self.picture.fill(Rect::new(x, y, 1.0 / UNITS, 1.0 / UNITS), color(of));
        Ok(())
    }

    fn draw_line<S: BackendStyle>(&mut self, from: BackendCoord, to: BackendCoord, style: &S) -> Done {
        self.draw_path([from, to], style)
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(&mut self, path: I, style: &S) -> Done {
        let points: Vec<Point> = path.into_iter().map(point).collect();
        if is_seen(style.color()) && points.len() > 1 {
            self.picture.line(&points, f64::from(style.stroke_width()) / UNITS, color(style.color()));
        }
        Ok(())
    }

    fn draw_rect<S: BackendStyle>(&mut self, a: BackendCoord, b: BackendCoord, style: &S, fill: bool) -> Done {
        let rect = between(a, b);
        match fill {
            _ if !is_seen(style.color()) => {}
            true => self.picture.fill(rect, color(style.color())),
            false => self.picture.frame(rect, f64::from(style.stroke_width()) / UNITS, color(style.color())),
        }
        Ok(())
    }

    fn draw_circle<S: BackendStyle>(&mut self, center: BackendCoord, radius: u32, style: &S, fill: bool) -> Done {
        let (at, radius, of) = (point(center), f64::from(radius) / UNITS, color(style.color()));
        if !is_seen(style.color()) {
            return Ok(());
        }
        if !fill {
            let corner = |i: u32| {
                let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 32.0).sin_cos();
                (at.0 + radius * cos, at.1 + radius * sin)
            };
            let points: Vec<Point> = (0..=32).map(corner).collect();
            self.picture.line(&points, f64::from(style.stroke_width()) / UNITS, of);
            return Ok(());
        }
        // Equal dots in a row share one list, as in a map of 40,000 points.
        if let Some(Shape::Dots { origin: (0.0, 0.0), centers, radius: r, color: c }) = self.picture.shapes.last_mut()
            && (*r - radius).abs() < 1e-9
            && *c == of
            && let Some(centers) = Arc::get_mut(centers)
        {
            centers.push(at);
            return Ok(());
        }
        self.picture.dots((0.0, 0.0), Arc::new(vec![at]), radius, of);
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(&mut self, corners: I, style: &S) -> Done {
        let points: Vec<Point> = corners.into_iter().map(point).collect();
        if is_seen(style.color()) && points.len() > 2 {
            self.picture.polygon(&points, color(style.color()));
        }
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(&mut self, text: &str, style: &S, at: BackendCoord) -> Done {
        if !is_seen(style.color()) || text.is_empty() {
            return Ok(());
        }
        let size = style.size() / UNITS;
        let anchor = match style.anchor().h_pos {
            HPos::Left => Anchor::Start,
            HPos::Center => Anchor::Middle,
            HPos::Right => Anchor::End,
        };
        // From the anchor down to the baseline.
        let down = match style.anchor().v_pos {
            VPos::Top => CAPITALS * size,
            VPos::Center => CAPITALS * size / 2.0,
            VPos::Bottom => -0.16 * size,
        };
        let at = point(at);
        let upwards = matches!(style.transform(), FontTransform::Rotate270 | FontTransform::Rotate90);
        let at = if upwards { (at.0 + down, at.1) } else { (at.0, at.1 + down) };
        let weight = weight(style.style());
        self.picture.text(at, text, TextStyle { size, weight, color: color(style.color()), anchor, upwards });
        Ok(())
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        style: &S,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        let size = style.size() / UNITS;
        let across = font::width(text, size, weight(style.style()));
        Ok(match style.transform() {
            FontTransform::None | FontTransform::Rotate180 => (width_units(across), width_units(size)),
            FontTransform::Rotate90 | FontTransform::Rotate270 => (width_units(size), width_units(across)),
        })
    }

    fn blit_bitmap(&mut self, at: BackendCoord, (width, height): (u32, u32), rgb: &[u8]) -> Done {
        let (x, y) = point(at);
        let (w, h) = (f64::from(width) / UNITS, f64::from(height) / UNITS);
        self.picture.image(Arc::new(Pixels { width, height, rgb: rgb.to_vec() }), Rect::new(x, y, w, h));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use plotters::prelude::{
        BLACK, Circle, Color as _, IntoDrawingArea as _, IntoFont as _, PathElement, RGBColor, Text,
    };

    use super::{Canvas, Shape, UNITS, Weight, units, width_units};
    use crate::picture::Picture;

    #[test]
    fn places_are_exact_to_a_64th_and_text_is_of_the_embedded_font() {
        let mut picture = Picture::new(100.0, 50.0, "a test");
        {
            let root = Canvas::new(&mut picture).into_drawing_area();
            let style = RGBColor(1, 2, 3).stroke_width(width_units(0.75));
            root.draw(&PathElement::new(vec![(units(0.5), units(1.25)), (units(99.984_375), units(3.0))], style))
                .expect("line");
            for i in 0..3 {
                let style = RGBColor(9, 9, 9).filled();
                root.draw(&Circle::new((units(f64::from(i)), units(2.0)), units(1.5), style)).expect("dot");
            }
            let style = ("sans-serif", UNITS * 7.0).into_font().color(&BLACK);
            root.draw(&Text::new("seven points", (units(10.0), units(20.0)), style)).expect("text");
        }
        let [Shape::Line { points, width, .. }, Shape::Dots { centers, radius, .. }, Shape::Text { at, style, .. }] =
            picture.shapes.as_slice()
        else {
            panic!("{:?}", picture.shapes)
        };
        assert_eq!((points[0], points[1], *width), ((0.5, 1.25), (99.984_375, 3.0), 0.75));
        assert_eq!((centers.as_slice(), *radius), ([(0.0, 2.0), (1.0, 2.0), (2.0, 2.0)].as_slice(), 1.5));
        assert_eq!((at.0, style.size, style.weight), (10.0, 7.0, Weight::Regular));
    }
}
