//! The bar beside coloured points, which says which number has which colour.

use super::super::coloring::Span;
use super::BAR_ROOM;
use crate::picture::color::{CONTEXT, INK, viridis};
use crate::picture::font::{Weight, fit_ends, width};
use crate::picture::number::{LABEL_SIZE, Labels, TICK_SIZE, Ticks};
use crate::picture::{Anchor, Picture, Rect, TextStyle};

/// Pieces of one colour that a bar is drawn of.
const PIECES: u32 = 64;
/// Length of a tick, points.
const TICK: f64 = 2.0;
/// From a label's left end to the bar, points.
const AWAY: f64 = 4.0;
/// From the labels' right end to the baseline of the title, which reads upwards, points.
const TITLE: f64 = 8.1;
/// Height of a label's capitals, points.
const CAPITALS: f64 = 0.73 * TICK_SIZE;
/// Height of a label with a gap, points: ticks nearer to an end give way to its number.
const LINE: f64 = 8.0;
/// A bar that is as high as any, points: longer ones have no labels that are wider.
const HIGHEST: f64 = 250.0;

/// A number at a bar.
struct BarMark {
    /// At which share of the bar's height.
    share: f64,
    text: String,
}

/// The room that the bar of these numbers takes with the gap before it, its ticks and its title, points.
pub(in super::super) fn bar_room(span: Option<&Span>) -> f64 {
    BAR_ROOM.max(10.0 + AWAY + widest(&marks(span, HIGHEST)) + TITLE + 4.0)
}

/// Draws an upright viridis bar with the numbers of its ends, and some between, on its right and its title reading upwards. Where all points have one value, or
/// none has any, there is no scale: one spot says which colour they have.
pub(in super::super) fn color_bar(picture: &mut Picture, area: Rect, span: Option<&Span>, title: &str) {
    let marks = marks(span, area.h);
    if span.is_some_and(Span::varies) {
        scale(picture, area);
    } else {
        let spot = Rect::new(area.x, area.y + (area.h - area.w) / 2.0, area.w, area.w);
        picture.fill(spot, if span.is_some() { viridis(0.0) } else { CONTEXT });
        picture.frame(spot, 0.4, INK);
    }
    for mark in &marks {
        let y = area.bottom() - mark.share * area.h;
        picture.line(&[(area.right(), y), (area.right() + TICK, y)], 0.5, INK);
        // The numbers of the ends stand inside, so that they touch nothing above and beneath the bar.
        let baseline = (y + CAPITALS / 2.0).min(area.bottom()).max(area.y + CAPITALS);
        picture.text((area.right() + AWAY, baseline), mark.text.clone(), TextStyle::new(TICK_SIZE));
    }
    let title = fit_ends(title, LABEL_SIZE, Weight::Regular, area.h);
    let at = (area.right() + AWAY + widest(&marks) + TITLE, area.y + area.h / 2.0);
    picture.text(at, title, TextStyle::new(LABEL_SIZE).anchor(Anchor::Middle).upwards());
}

/// The colours from the lowest at the bottom to the highest.
fn scale(picture: &mut Picture, area: Rect) {
    let piece = area.h / f64::from(PIECES);
    for i in 0..PIECES {
        let from = f64::from(i);
        // A little overlap hides the seams between neighbouring pieces.
        let to = (from + 1.3).min(f64::from(PIECES));
        let place = Rect::new(area.x, area.bottom() - to * piece, area.w, (to - from) * piece);
        picture.fill(place, viridis((from + 0.5) / f64::from(PIECES)));
    }
    picture.frame(area, 0.4, INK);
}

/// What is written beside a bar of a height: both ends always, and round numbers that do not come too near to them.
fn marks(span: Option<&Span>, height: f64) -> Vec<BarMark> {
    let alone = |text: String| vec![BarMark { share: 0.5, text }];
    let Some(span) = span else { return alone("no value".into()) };
    let (lo, hi) = span.range;
    let largest = lo.abs().max(hi.abs());
    if !span.varies() {
        let extent = if span.is_whole { 100.0 } else { largest / 10.0 };
        return alone(format!("all {}", Labels::of_ends(largest, extent).text(lo)));
    }
    let ends = Labels::of_ends(largest, hi - lo);
    let end = |share: f64, value: f64, is_cut: bool, sign: &str| {
        let sign = if is_cut { sign } else { "" };
        BarMark { share, text: format!("{sign}{}", ends.text(value)) }
    };
    let ticks = Ticks::new((lo, hi), height, span.is_whole, |_| (28.0, 28.0));
    let between = ticks.at.iter().map(|&value| BarMark { share: span.share(value), text: ticks.text(value) });
    let near = LINE / height;
    let between = between.filter(|mark| (near..=1.0 - near).contains(&mark.share));
    let (low, high) = (end(0.0, lo, span.cut.0, "≤ "), end(1.0, hi, span.cut.1, "≥ "));
    std::iter::once(low).chain(between).chain(std::iter::once(high)).collect()
}

/// The width of the widest label, points.
fn widest(marks: &[BarMark]) -> f64 {
    marks.iter().map(|mark| width(&mark.text, TICK_SIZE, Weight::Regular)).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(values: &[f64], height: f64) -> Vec<String> {
        marks(Span::of(values).as_ref(), height).into_iter().map(|mark| mark.text).collect()
    }

    #[test]
    fn both_ends_of_a_bar_have_their_numbers() {
        assert_eq!(texts(&[-1.234, 3.456], 100.0), ["−1.23", "0", "2", "3.46"]);
        assert_eq!(texts(&[0.0, 1.0, 2.0, 3.0], 30.0), ["0", "3"], "a low bar has no room for more");
        assert_eq!(texts(&[0.0, 1e-9], 40.0)[1..], ["1e−9"]);
        let steps: Vec<f64> = (0..250).map(f64::from).collect();
        assert_eq!(texts(&steps, 100.0), ["0", "100", "200", "249"]);
        assert_eq!(texts(&[0.0, 1.0], 250.0), ["0", "1"], "whole numbers have no halves between them");
    }

    #[test]
    fn a_column_of_one_value_has_no_range() {
        assert_eq!(texts(&[7.0, 7.0, f64::NAN], 100.0), ["all 7"]);
        assert_eq!(texts(&[0.123_456; 3], 100.0), ["all 0.1235"]);
        assert_eq!((texts(&[0.0], 100.0), texts(&[f64::NAN], 100.0)), (vec!["all 0".into()], vec!["no value".into()]));
        let mut picture = Picture::new(60.0, 100.0, "a test");
        color_bar(&mut picture, Rect::new(2.0, 2.0, 7.0, 90.0), Span::of(&[7.0]).as_ref(), "step");
        assert!(picture.shapes.len() < 8, "a spot rather than a scale");
    }

    #[test]
    fn an_end_beyond_which_some_lie_says_so() {
        let mut values: Vec<f64> = (0..100).map(f64::from).collect();
        values.push(1e6);
        assert_eq!(texts(&values, 100.0).last().map(String::as_str), Some("≥ 99"));
        values.push(-1e6);
        assert_eq!(texts(&values, 100.0)[0], "≤ 0");
    }

    #[test]
    fn wide_numbers_have_room() {
        let span = Span::of(&[-100_523.0, -100_499.0]);
        let (room, widest) = (bar_room(span.as_ref()), widest(&marks(span.as_ref(), 100.0)));
        assert!(widest > 25.0 && room >= 10.0 + AWAY + widest + TITLE, "{room} for labels of {widest}");
        assert!((bar_room(Span::of(&[0.0, 1.0]).as_ref()) - BAR_ROOM).abs() < 1e-9, "others have as much as ever");
    }
}
