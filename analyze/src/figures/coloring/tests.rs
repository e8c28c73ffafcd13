//! Which colour points have, and what a legend says of them.

use super::{Coloring, TEN};
use crate::picture::color::blindness::{difference, nearest};
use crate::picture::color::{CONTEXT, Color, FAINT};

fn states(kinds: &[Option<u32>]) -> Coloring {
    Coloring::Kind { name: "state".into(), kinds: kinds.to_vec(), names: Vec::new() }
}

/// Kinds with names, one point each, in the order of their numbers.
fn called(name: &str, names: &[&str]) -> Coloring {
    let kinds = (0..names.len() as u32).map(Some).collect();
    Coloring::Kind { name: name.into(), kinds, names: names.iter().map(ToString::to_string).collect() }
}

fn levels(coloring: &Coloring, points: usize) -> Vec<i64> {
    let scale = coloring.scale();
    (0..points).map(|i| coloring.level(i, &scale)).collect()
}

#[test]
fn two_kinds_have_two_colours_whatever_their_numbers() {
    let two = states(&[Some(13), Some(3), Some(13)]);
    assert_eq!(levels(&two, 3), [1, 0, 1]);
    assert_eq!(two.of_points(), [Some(TEN[1]), Some(TEN[0]), Some(TEN[1])]);
    assert_eq!(two.entries(0..3, CONTEXT), (vec!["state 3".to_owned(), "13".to_owned()], TEN[..2].to_vec()));
    let called = Coloring::Kind {
        name: "weather".into(),
        kinds: vec![Some(12), Some(2)],
        names: (0..13).map(|kind| format!("kind {kind}")).collect(),
    };
    assert_eq!((levels(&called, 2), called.names()), (vec![1, 0], vec!["kind 2".to_owned(), "kind 12".to_owned()]));
}

#[test]
fn kinds_that_are_not_shown_take_no_colour_from_those_that_are() {
    let many: Vec<Option<u32>> = (0..12).map(Some).collect();
    let two = states(&many).of_shown([0, 10].into_iter());
    let levels = levels(&two, 12);
    assert_eq!((levels[0], levels[10], two.entries([0, 10].into_iter(), FAINT).0.len()), (0, 1, 2));
    let few = states(&many[..4]);
    assert_eq!(few.of_shown([1, 3].into_iter()), few, "colours as in the other figures");
}

#[test]
fn kinds_beyond_the_colours_repeat_them_and_the_legend_says_how_many() {
    let many: Vec<Option<u32>> = (0..12).map(|kind| Some(kind * 5)).collect();
    let many = states(&many);
    assert_eq!(levels(&many, 12)[9..], [9, 0, 1]);
    assert_eq!((many.entries(0..12, CONTEXT).1.len(), many.names().len()), (10, 10));
    assert_eq!(many.names()[9], "45 (and 2 more: colours repeat)");
}

#[test]
fn grey_points_are_in_the_legend() {
    let two = states(&[Some(1), None]);
    assert_eq!(two.entries(0..2, FAINT), (vec!["state 1".to_owned(), "no state".to_owned()], vec![TEN[0], FAINT]));
    assert_eq!(two.entries(0..1, FAINT).0, ["state 1"], "of those that are shown");
    let clusters = Coloring::Kind { name: "cluster".into(), kinds: vec![Some(0), None], names: Vec::new() };
    assert_eq!(clusters.entries(0..2, CONTEXT).0, ["cluster 0", "in no group"]);
    let reward = Coloring::Quantity { name: "reward".into(), values: vec![0.5, f64::NAN] };
    assert_eq!(reward.lacking(0..2, "grey").as_deref(), Some("grey: no reward"));
    assert_eq!((reward.lacking(0..1, "grey"), two.lacking(0..2, "grey")), (None, None));
}

#[test]
fn kinds_with_numbers_are_in_the_order_of_these() {
    let kinds = called("kind", &["kind1", "kind10", "kind2", "no number", "007", "8"]);
    assert_eq!(kinds.names(), ["007", "8", "kind1", "kind2", "kind10", "no number"]);
    assert_eq!(levels(&kinds, 6), [2, 4, 3, 5, 0, 1]);
}

#[test]
fn names_that_differ_at_their_ends_stay_different() {
    let long = "a background video of a street in the rain, seen from a moving car, part";
    let names: Vec<String> = (1..5).map(|part| format!("{long} {part}")).collect();
    let kinds = called("video", &names.iter().map(String::as_str).collect::<Vec<_>>());
    assert_eq!(kinds.names(), names);
}

#[test]
fn kinds_are_told_apart_from_each_other_and_from_points_without_one() {
    assert!(nearest(&TEN) > 16.0, "{}", nearest(&TEN));
    // The greys of maps, of Rerun's maps and of panels.
    for grey in [CONTEXT, Color::new(150, 150, 150), FAINT] {
        for color in TEN {
            assert!(difference(color, grey) > 15.0, "{} is nearly {}", color.hex(), grey.hex());
        }
    }
}

#[test]
fn a_point_far_away_has_the_last_colour_and_the_others_theirs() {
    let mut values: Vec<f64> = (0..1000).map(f64::from).collect();
    values[0] = 1e9;
    values[1] = f64::NAN;
    let levels = levels(&Coloring::Quantity { name: "height".into(), values }, 1000);
    assert_eq!((levels[0], levels[1], levels[999]), (63, -1, 63));
    assert!((30..34).contains(&levels[500]), "{}", levels[500]);
}
