//! What lies on what, how far axes reach, and what a figure says of lines and bands that are not whole.

use super::line::held;
use super::*;
use crate::picture::Shape;

/// Values at 0, 1, 2 and so on, with a band of this half width.
fn curve(group: usize, mean: &[f64], half: f64) -> Curve {
    let x = (0..mean.len()).map(|at| at as f64).collect();
    let band = mean.iter().map(|mean| Some((mean - half, mean + half))).collect();
    Curve { group, x, mean: mean.to_vec(), band, runs: Vec::new() }
}

fn facet(curves: Vec<Curve>) -> Facet {
    Facet { metric: "return".into(), curves }
}

fn figure(facets: Vec<Facet>, columns: Option<usize>) -> Curves {
    Curves {
        heading: Heading::new("Training"),
        axis: "updates".into(),
        groups: ["one", "two"].map(String::from).to_vec(),
        columns,
        facets,
        foot: String::new(),
    }
}

/// Every text of a picture with its place.
fn texts(picture: &Picture) -> Vec<(String, f64)> {
    let text = |shape: &Shape| match shape {
        Shape::Text { text, at, .. } => Some((text.clone(), at.0)),
        _ => None,
    };
    picture.shapes.iter().filter_map(text).collect()
}

fn says(picture: &Picture, words: &str) -> bool {
    // A foot may be broken anywhere.
    texts(picture).into_iter().map(|text| text.0).collect::<Vec<_>>().join(" ").contains(words)
}

#[test]
fn the_facts_are_those_of_the_foot() {
    let mut shown = figure(vec![facet(vec![curve(0, &[0.0, 1.0, 2.0], 100.0)])], None);
    assert_eq!(shown.facts(), ["a band that reaches the edge of its panel goes on beyond it"]);
    shown.facets[0].curves[0].runs = vec![2, 2, 1];
    shown.foot = "band of a single run".into();
    assert_eq!(shown.facts().len(), 2);
    assert_eq!(shown.foot_text(), format!("band of a single run; {}", shown.facts().join("; ")));
    assert!(figure(vec![facet(vec![curve(0, &[0.0, 1.0], 0.5)])], None).foot_text().is_empty());
}

#[test]
fn every_band_lies_beneath_every_line() {
    let shown = figure(vec![facet(vec![curve(0, &[0.0, 1.0, 2.0], 0.5), curve(1, &[0.5, 1.0, 1.5], 0.5)])], None);
    let shapes = shown.draw().shapes;
    let bands: Vec<usize> = (0..shapes.len()).filter(|at| matches!(shapes[*at], Shape::Polygon { .. })).collect();
    let is_line = |shape: &Shape| matches!(shape, Shape::Line { points, .. } if points.len() == 3);
    let lines: Vec<usize> = (0..shapes.len()).filter(|at| is_line(&shapes[*at])).collect();
    assert_eq!((bands.len(), lines.len()), (2, 2));
    assert!(bands.iter().max() < lines.iter().min(), "{bands:?} {lines:?}");
}

/// Of two runs, whose interval is 12.7 standard errors wide.
#[test]
fn a_wide_band_leaves_room_to_the_means_and_stays_in_its_panel() {
    let wide = facet(vec![curve(0, &[0.0, 1.0, 2.0], 100.0)]);
    let (low, high) = wide.y_range();
    assert!((low + 2.24).abs() < 1e-9 && (high - 4.24).abs() < 1e-9, "{low} {high}");
    let mut picture = Picture::new(200.0, 200.0, "a test");
    wide.draw(&mut picture, Rect::new(40.0, 20.0, 150.0, 120.0), "updates", &[0]);
    for shape in &picture.shapes {
        if let Shape::Polygon { points, .. } = shape {
            assert!(points.iter().all(|point| (19.5..=140.5).contains(&point.1)), "{points:?}");
        }
    }
    let words = "a band that reaches the edge of its panel goes on beyond it";
    assert!(says(&figure(vec![wide.clone()], None).draw(), words));
    let narrow = facet(vec![curve(0, &[0.0, 1.0, 2.0], 0.5)]);
    assert!(!says(&figure(vec![narrow.clone()], None).draw(), "beyond"));
    let named = Facet { metric: "gap".into(), ..wide };
    assert!(says(&figure(vec![narrow, named], None).draw(), &format!("{words} (gap)")));
    // Means that do not differ have nothing to take a range from but their bands.
    let (low, high) = facet(vec![curve(0, &[1.0, 1.0], 3.0)]).y_range();
    assert!(low < -2.0 && high > 4.0, "{low} {high}");
}

#[test]
fn a_line_is_broken_and_thin_where_fewer_runs_reach() {
    let mean: Vec<f64> = (0..10).map(f64::from).collect();
    let runs = [vec![3; 6], vec![2; 4]].concat();
    let picture = figure(vec![facet(vec![Curve { runs, ..curve(0, &mean, 0.5) }])], None).draw();
    let line = |shape: &Shape| match shape {
        Shape::Line { points, width, color, .. } if points.len() > 2 && *color == kind(0) => {
            Some((points.len(), *width))
        }
        _ => None,
    };
    let lines: Vec<(usize, f64)> = picture.shapes.iter().filter_map(line).collect();
    assert!(matches!(lines.as_slice(), [(6, whole), (4, thin)] if thin < whole), "{lines:?}");
    let bands = picture.shapes.iter().filter(|shape| matches!(shape, Shape::Polygon { .. })).count();
    assert_eq!(bands, 2, "no band leads from three runs to two");
    assert!(says(&picture, "drawn thinner, where fewer runs"));
    assert!(!says(&figure(vec![facet(vec![curve(0, &mean, 0.5)])], None).draw(), "thinner"));
}

#[test]
fn an_axis_that_begins_near_nothing_begins_at_nothing() {
    let from = |first: f64| {
        let own = curve(0, &[1.0, 2.0], 0.5);
        facet(vec![Curve { x: vec![first, 10_000.0], ..own }]).x_range()
    };
    assert_eq!(from(100.0), (0.0, 10_000.0));
    assert_eq!([from(2000.0).0, from(-100.0).0, from(0.0).0], [2000.0, -100.0, 0.0]);
}

#[test]
fn a_facet_without_curves_keeps_its_place() {
    let named = |metric: &str, curves: Vec<Curve>| Facet { metric: metric.into(), curves };
    let own = || vec![curve(0, &[1.0, 2.0], 0.5)];
    let facets =
        vec![named("a: one", own()), named("b: one", Vec::new()), named("a: two", own()), named("b: two", own())];
    let found = texts(&figure(facets, Some(2)).draw());
    let at = |name: &str| found.iter().find(|text| text.0 == name).map(|text| text.1);
    assert_eq!((at("a: one"), at("b: one")), (at("a: two"), None));
    assert!(at("b: two") > at("a: two"));
}

#[test]
fn what_leaves_a_range_goes_along_its_edge() {
    let points = [(0.0, 0.0), (1.0, 4.0), (2.0, 4.0), (3.0, -4.0)];
    let wanted = [(0.0, 0.0), (0.5, 2.0), (1.0, 2.0), (2.0, 2.0), (2.25, 2.0), (2.75, -2.0), (3.0, -2.0)];
    assert_eq!(held(&points, (-2.0, 2.0)), wanted);
    assert_eq!(held(&points[..1], (-2.0, 2.0)), points[..1]);
}
