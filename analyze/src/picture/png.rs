//! Pictures as pixels: the same shapes through a small anti-aliasing rasteriser.

use tiny_skia::{
    FillRule, FilterQuality, LineJoin, Paint, PathBuilder, Pixmap, PixmapPaint, Stroke, StrokeDash, Transform,
};

use super::color::Color;
use super::font::{self, Segment};
use super::{Picture, Pixels, Point, Rect, Shape, TextStyle};

/// Resolution of written figures, pixels an inch.
pub const DPI: f64 = 300.0;

/// The picture at `dpi` pixels an inch. None if it would have no pixels, or more than 16,384 on a side.
#[must_use]
pub fn rasterize(picture: &Picture, dpi: f64) -> Option<Pixels> {
    let scale = dpi / 72.0;
    let size =
        |points: f64| Some((points * scale).round()).filter(|&v| (1.0..=16_384.0).contains(&v)).map(|v| v as u32);
    let (width, height) = (size(picture.width)?, size(picture.height)?);
    let mut map = Pixmap::new(width, height)?;
    map.fill(tiny_skia::Color::WHITE);
    let to_pixels = Transform::from_scale(scale as f32, scale as f32);
    for shape in &picture.shapes {
        draw(&mut map, shape, to_pixels);
    }
    let rgb = map.pixels().iter().flat_map(|p| [p.red(), p.green(), p.blue()]).collect();
    Some(Pixels { width, height, rgb })
}

fn draw(map: &mut Pixmap, shape: &Shape, to_pixels: Transform) {
    match shape {
        Shape::Line { points, width, color, dash } => line(map, points, *width, *color, *dash, to_pixels),
        Shape::Polygon { points, color } => {
            let mut path = path_through(points);
            path.close();
            if let Some(path) = path.finish() {
                map.fill_path(&path, &paint(*color), FillRule::Winding, to_pixels, None);
            }
        }
        Shape::Dots { origin, centers, radius, color } => dots(map, *origin, centers, *radius, *color, to_pixels),
        Shape::Image { pixels, rect } => image(map, pixels, *rect, to_pixels),
        Shape::Text { at, text, style } => letters(map, *at, text, style, to_pixels),
    }
}

fn paint(color: Color) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    let [r, g, b] = color.rgb;
    paint.set_color_rgba8(r, g, b, (color.alpha.clamp(0.0, 1.0) * 255.0).round() as u8);
    paint
}

fn path_through(points: &[Point]) -> PathBuilder {
    let mut path = PathBuilder::new();
    for (i, &(x, y)) in points.iter().enumerate() {
        if i == 0 {
            path.move_to(x as f32, y as f32);
        } else {
            path.line_to(x as f32, y as f32);
        }
    }
    path
}

fn line(map: &mut Pixmap, points: &[Point], width: f64, color: Color, dash: Option<(f64, f64)>, to_pixels: Transform) {
    let stroke = Stroke {
        width: width as f32,
        line_join: LineJoin::Round,
        dash: dash.and_then(|(on, off)| StrokeDash::new(vec![on as f32, off as f32], 0.0)),
        ..Stroke::default()
    };
    if let Some(path) = path_through(points).finish() {
        map.stroke_path(&path, &paint(color), &stroke, to_pixels, None);
    }
}

/// As in SVG, the dots of one list make one area: where they overlap they do not grow darker.
fn dots(map: &mut Pixmap, origin: Point, centers: &[Point], radius: f64, color: Color, to_pixels: Transform) {
    let at = to_pixels.pre_translate(origin.0 as f32, origin.1 as f32);
    let paint = paint(color);
    if color.alpha >= 1.0 {
        // Opaque dots one by one: the same picture, and far quicker for many of them.
        for &(x, y) in centers {
            if let Some(path) = PathBuilder::from_circle(x as f32, y as f32, radius as f32) {
                map.fill_path(&path, &paint, FillRule::Winding, at, None);
            }
        }
        return;
    }
    let mut path = PathBuilder::new();
    for &(x, y) in centers {
        path.push_circle(x as f32, y as f32, radius as f32);
    }
    if let Some(path) = path.finish() {
        map.fill_path(&path, &paint, FillRule::Winding, at, None);
    }
}

fn image(map: &mut Pixmap, pixels: &Pixels, rect: Rect, to_pixels: Transform) {
    let rgba: Vec<u8> = pixels.rgb.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]).collect();
    let Some(source) =
        tiny_skia::IntSize::from_wh(pixels.width, pixels.height).and_then(|size| Pixmap::from_vec(rgba, size))
    else {
        return;
    };
    let (sx, sy) = (rect.w / f64::from(pixels.width), rect.h / f64::from(pixels.height));
    let place = to_pixels.pre_translate(rect.x as f32, rect.y as f32).pre_scale(sx as f32, sy as f32);
    let paint = PixmapPaint { quality: FilterQuality::Bilinear, ..PixmapPaint::default() };
    map.draw_pixmap(0, 0, source.as_ref(), &paint, place, None);
}

fn letters(map: &mut Pixmap, at: Point, text: &str, style: &TextStyle, to_pixels: Transform) {
    let (letters, ems) = font::lay_out(text, style.weight);
    let mut path = PathBuilder::new();
    for letter in letters {
        let x = letter.x - style.anchor.before() * ems;
        for segment in font::outline(letter.glyph, style.weight) {
            push(&mut path, segment, x);
        }
    }
    let mut place = to_pixels.pre_translate(at.0 as f32, at.1 as f32);
    if style.upwards {
        place = place.pre_concat(Transform::from_rotate(-90.0));
    }
    place = place.pre_scale(style.size as f32, style.size as f32);
    if let Some(path) = path.finish() {
        map.fill_path(&path, &paint(style.color), FillRule::Winding, place, None);
    }
}

fn push(path: &mut PathBuilder, segment: Segment, dx: f64) {
    let f = |x: f64| (x + dx) as f32;
    match segment {
        Segment::Move(x, y) => path.move_to(f(x), y as f32),
        Segment::Line(x, y) => path.line_to(f(x), y as f32),
        Segment::Quad(a, b, x, y) => path.quad_to(f(a), b as f32, f(x), y as f32),
        Segment::Cubic(a, b, c, d, x, y) => path.cubic_to(f(a), b as f32, f(c), d as f32, f(x), y as f32),
        Segment::Close => path.close(),
    }
}
