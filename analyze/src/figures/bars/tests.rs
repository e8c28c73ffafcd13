//! Colours, intervals and titles of bars.

use super::{Bar, BarGroup, Bars, Heading};
use crate::picture::color::{Color, INK, KINDS};
use crate::picture::font::{Weight, width};
use crate::picture::{Picture, Shape};

fn group(axis: &str, labels: &[&str]) -> BarGroup {
    let bar = |label: &&str| Bar { label: (*label).into(), value: 0.5, interval: None, chance: None };
    BarGroup { axis: axis.into(), range: Some((0.0, 1.0)), bars: labels.iter().map(bar).collect() }
}

fn draw(groups: Vec<BarGroup>) -> Picture {
    Bars { heading: Heading::new("a test"), groups }.draw()
}

/// The colours of the bars from top to bottom.
fn colors(picture: &Picture) -> Vec<Color> {
    let of = |shape: &Shape| if let Shape::Polygon { color, .. } = shape { Some(*color) } else { None };
    picture.shapes.iter().filter_map(of).collect()
}

#[test]
fn a_source_has_one_colour_in_all_groups() {
    let first = group("retrieval", &["latent, 1 nearest", "actions only, 1 nearest", "latent, 5 nearest"]);
    let second = group("symmetry", &["actions only", "latent", "distance"]);
    let [blue, orange, green] = [KINDS[0], KINDS[1], KINDS[2]];
    assert_eq!(colors(&draw(vec![first, second])), [blue, orange, blue, orange, blue, green]);
}

#[test]
fn a_method_has_the_colour_of_other_figures_wherever_it_stands() {
    let tables = |labels: &[&str]| colors(&draw(vec![group("state", labels), group("retrieval", &labels[..1])]));
    let [vibes, no_adversary, reconstruction] = [KINDS[0], KINDS[1], KINDS[2]];
    assert_eq!(tables(&["reconstruction", "vibes"]), [reconstruction, vibes, reconstruction]);
    let found = tables(&["mine", "reacher-no-adversary-1", "reconstruction-2"]);
    assert_eq!(found, [vibes, no_adversary, reconstruction, vibes], "what is not known takes what is left");
}

#[test]
fn an_interval_that_leaves_the_axis_has_no_end_there() {
    let ends = |interval: (f64, f64)| {
        let mut one = group("share", &["latent"]);
        one.bars[0].interval = Some(interval);
        let is_end = |shape: &&Shape| {
            let Shape::Line { points, color, .. } = shape else { return false };
            *color == INK && points.len() == 2 && (points[1].1 - points[0].1).abs() > 3.0
        };
        draw(vec![one]).shapes.iter().filter(is_end).count()
    };
    assert_eq!((ends((0.4, 0.6)), ends((0.4, 1.6)), ends((-0.3, 1.6)), ends((1.2, 1.6))), (2, 1, 0, 0));
}

#[test]
fn a_long_title_is_broken_into_lines_inside_the_figure() {
    let title = "share of fifteen neighbours in common with the run cartpole-swingup-no-adversary-with-a-long-name-1";
    let picture = draw(vec![group(title, &["latent"])]);
    let mut found = Vec::new();
    for shape in &picture.shapes {
        if let Shape::Text { at, text, style } = shape
            && text.len() > 9
            && title.contains(text.as_str())
        {
            assert!(at.0 + width(text, style.size, Weight::Regular) <= picture.width, "{text}");
            found.push(text.as_str());
        }
    }
    assert_eq!(found.join(" "), title);
}
