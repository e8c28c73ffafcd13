//! What a map says of points that are not where they would be, or are not there.

use super::{Coloring, Heading, Map};
use crate::picture::color::CONTEXT;
use crate::picture::{Picture, Shape};

/// Points along a circle, and some far away from it.
fn map(count: u32, far: &[[f64; 2]], values: impl Fn(usize) -> f64) -> Map {
    let circle = (0..count).map(|i| {
        let (sin, cos) = f64::from(i).sin_cos();
        [sin, cos]
    });
    let points: Vec<[f64; 2]> = circle.chain(far.iter().copied()).collect();
    let values = (0..points.len()).map(values).collect();
    Map {
        heading: Heading::new("a test"),
        axes: "UMAP".into(),
        points,
        backdrop: Vec::new(),
        coloring: Coloring::Quantity { name: "reward".into(), values },
    }
}

fn texts(picture: &Picture) -> String {
    let text = |shape: &Shape| if let Shape::Text { text, .. } = shape { text.clone() } else { String::new() };
    picture.shapes.iter().map(text).collect::<Vec<_>>().join("\n")
}

fn triangles(picture: &Picture) -> usize {
    picture.shapes.iter().filter(|shape| matches!(shape, Shape::Polygon { points, .. } if points.len() == 3)).count()
}

fn dots(picture: &Picture) -> usize {
    let count = |shape: &Shape| if let Shape::Dots { centers, .. } = shape { centers.len() } else { 0 };
    picture.shapes.iter().map(count).sum()
}

#[test]
fn points_far_away_are_triangles_and_the_map_keeps_its_shape() {
    let plain = map(600, &[], |i| i as f64).draw();
    let far = map(600, &[[90.0, 0.5], [0.5, -70.0], [-80.0, 0.0]], |i| i as f64).draw();
    assert!((far.height - plain.height).abs() < 15.0, "{} and {}", far.height, plain.height);
    assert_eq!((triangles(&plain), triangles(&far), dots(&far)), (0, 3, 600));
    assert!(texts(&far).contains("3 points lie outside: triangles at the frame"), "{}", texts(&far));
    assert!(!texts(&plain).contains("outside"));
}

#[test]
fn points_of_the_backdrop_may_lie_outside_too() {
    let mut placed = map(600, &[], |i| i as f64);
    placed.backdrop = placed.points.iter().copied().chain([[90.0, 0.5]]).collect();
    let picture = placed.draw();
    let is_grey =
        |shape: &Shape| matches!(shape, Shape::Polygon { points, color } if points.len() == 3 && *color == CONTEXT);
    assert_eq!(picture.shapes.iter().filter(|shape| is_grey(shape)).count(), 1);
    assert!(texts(&picture).contains("1 point lies outside: a triangle at the frame"));
}

#[test]
fn points_that_are_left_out_and_those_without_a_value_are_spoken_of() {
    let many = map(80_001, &[], |i| if i % 7 == 0 { f64::NAN } else { i as f64 }).draw();
    let said = texts(&many).replace('\n', " ");
    assert!(said.contains("one in 3 of 80001 points is drawn") && said.contains("grey: no reward"), "{said}");
    assert_eq!(dots(&many), 26_667);
}
