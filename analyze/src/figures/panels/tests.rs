//! Colours, marks and words of panels.

use super::{Coloring, Heading, Panel, Panels, own_dot};
use crate::picture::color::FAINT;
use crate::picture::{Picture, Shape};

fn panel(distractor: u32, rows: std::ops::Range<usize>) -> Panel {
    Panel { state: 0, distractor, rows: rows.collect() }
}

/// A grid of which one cell ends early, from step 50 on.
fn panels(points: Vec<[f64; 2]>) -> Panels {
    Panels {
        heading: Heading::new("a test"),
        points,
        states: vec![0],
        distractors: vec![0, 1],
        panels: vec![panel(0, 0..48), panel(1, 48..58)],
        absent: "not recorded",
        steps: (50..98).chain(50..60).collect(),
        coloring: None,
    }
}

fn texts(picture: &Picture) -> Vec<&str> {
    picture
        .shapes
        .iter()
        .filter_map(|shape| if let Shape::Text { text, .. } = shape { Some(text.as_str()) } else { None })
        .collect()
}

#[test]
fn a_step_has_one_colour_in_cells_of_any_length() {
    let panels = panels(vec![[0.0, 0.0]; 58]);
    let color = |row: usize| panels.layers(&[row], panels.time(), None)[0].0;
    assert_eq!(panels.time(), (50, 97));
    assert_eq!((color(0), color(9)), (color(48), color(57)));
    assert_ne!(color(57), color(47), "the last row of the short one is not the last step");
}

#[test]
fn dots_shrink_with_the_panel_and_with_its_rows() {
    assert!(own_dot(90.0, 50) > own_dot(40.0, 250) && own_dot(40.0, 250) > own_dot(8.0, 250));
    assert!(own_dot(40.0, 250) > 1.5 * own_dot(40.0, 1000), "a long trajectory does not melt together");
}

#[test]
fn a_first_step_far_away_is_a_triangle_in_its_own_panel() {
    let mut points: Vec<[f64; 2]> = (0..58).map(|i| f64::from(i).sin_cos()).map(|(sin, cos)| [sin, cos]).collect();
    points[0] = [100.0, 0.0];
    points.push([0.0, -90.0]);
    let mut panels = panels(points);
    panels.steps.push(0);
    let picture = panels.draw();
    let is_triangle = |shape: &&Shape| matches!(shape, Shape::Polygon { points, .. } if points.len() == 3);
    assert_eq!(picture.shapes.iter().filter(is_triangle).count(), 1);
    let said = texts(&picture).join(" ");
    assert!(said.contains("1 point lies outside: a triangle at the frame; 1 of the grey points lies"), "{said}");
}

#[test]
fn rows_without_a_kind_or_a_value_are_named() {
    let mut panels = panels((0..58).map(|i| [f64::from(i), 0.0]).collect());
    let kinds = (0..58).map(|i| (i > 5).then_some(i % 3)).collect();
    panels.coloring = Some(Coloring::Kind { name: "weather".into(), kinds, names: Vec::new() });
    assert!(texts(&panels.draw()).contains(&"no weather"));
    panels.coloring = Some(Coloring::Quantity { name: "height".into(), values: vec![f64::NAN; 58] });
    let picture = panels.draw();
    assert!(texts(&picture).contains(&"no value") && texts(&picture).contains(&"dark grey: no height"));
    assert!(picture.shapes.iter().any(|shape| matches!(shape, Shape::Dots { color, .. } if *color == FAINT)));
}
