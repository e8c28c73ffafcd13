//! Marks of probes that lie on each other, or outside of the axis.

use super::{BELOW, Heading, ProbeChart, ProbeMark, ProbeRow};
use crate::picture::{Picture, Shape};

/// A quantity with these scores, one a source.
fn draw(scores: &[f64]) -> Picture {
    let mark =
        |(source, &score): (usize, &f64)| ProbeMark { source, score, interval: Some((score - 0.2, score + 0.02)) };
    let row = ProbeRow {
        section: "task".into(),
        quantity: "height".into(),
        marks: scores.iter().enumerate().map(mark).collect(),
    };
    ProbeChart {
        heading: Heading::new("a test"),
        axis: "R² on held-out episodes".into(),
        sources: (0..scores.len()).map(|source| format!("source {source}")).collect(),
        rows: vec![row],
    }
    .draw()
}

/// From where to where each arrow reaches, downwards.
fn arrows(picture: &Picture) -> Vec<(f64, f64)> {
    let of = |shape: &Shape| {
        let Shape::Polygon { points, .. } = shape else { return None };
        let heights = points.iter().map(|point| point.1);
        let ends = (heights.clone().fold(f64::INFINITY, f64::min), heights.fold(0.0, f64::max));
        (points.len() == 3).then_some(ends)
    };
    picture.shapes.iter().filter_map(of).collect()
}

#[test]
fn four_scores_below_the_axis_are_four_arrows_side_by_side() {
    let arrows = arrows(&draw(&[-0.5, -0.5, -2.0, -0.3]));
    assert_eq!(arrows.len(), 4);
    for (i, one) in arrows.iter().enumerate() {
        assert!(arrows[..i].iter().all(|other| one.0 >= other.1 || other.0 >= one.1), "{arrows:?}");
    }
}

#[test]
fn a_score_below_the_axis_is_spoken_of() {
    let says_so = |picture: &Picture| {
        picture.shapes.iter().any(|shape| matches!(shape, Shape::Text { text, .. } if text.as_str() == BELOW))
    };
    assert!(says_so(&draw(&[0.5, -0.3])) && !says_so(&draw(&[0.5, -0.05])));
}

#[test]
fn an_interval_that_leaves_the_axis_has_no_end_there() {
    let ends = |score: f64| {
        let is_end = |shape: &&Shape| {
            let Shape::Line { points, .. } = shape else { return false };
            let height = points.first().zip(points.last()).map_or(0.0, |(a, b)| (a.1 - b.1).abs());
            points.len() == 2 && (3.0..4.0).contains(&height)
        };
        draw(&[score]).shapes.iter().filter(is_end).count()
    };
    assert_eq!((ends(0.5), ends(0.0), ends(0.99), ends(-0.5)), (2, 1, 1, 0));
}
