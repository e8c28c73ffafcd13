//! What is printed of numbers that are made up.

use std::collections::BTreeMap;

use vibes_measure::invariance::Dropped;

use super::*;

fn number(name: &str, estimate: f64) -> Number {
    let value = Interval { estimate, low: f64::NAN, high: f64::NAN };
    Number { name: name.to_owned(), value, chance: 0.0, past_actions: Some(value) }
}

#[test]
fn every_quantity_is_one_line_with_a_column_for_each_table() {
    let names = ["coin/s", "leaf red/s", "leaf blue/s", "coin/h", "leaf red/h", "leaf blue/h", "coin/hs"];
    let numbers = names.iter().zip(1..).map(|(name, value)| number(&format!("probe/{name}"), f64::from(value)));
    let report = Report {
        numbers: numbers.chain([number("probe_knn/coin/s", 9.0)]).collect(),
        quantities: BTreeMap::from([("coin".to_owned(), "task")]),
        fitted_on: Some(3),
        left_out: Vec::new(),
        grid: GridSize { states: 3, distractors: 3, steps: 5, dropped: Dropped::default() },
    };
    let lines = probe_lines(&report, Fitting::OtherRecordings);
    let words: Vec<Vec<&str>> = lines.iter().skip(1).map(|line| line.split_whitespace().collect()).collect();
    assert!(lines[0].contains("fitted on 3 episodes"), "{lines:?}");
    assert_eq!((words[0][1], words[0][4], words[0][7]), ("s", "h", "hs"));
    assert_eq!(words[1], ["task:", "coin", "1.000", "4.000", "7.000", "1.000", "0.000"]);
    assert_eq!(words[2][4..], ["2", "2.500", "5.500", "–", "2.500", "0.000"]);
    assert!(probe_lines(&report, Fitting::CrossValidation).is_empty());
}

#[test]
fn rewards_that_do_not_vary_are_told() {
    let of = |estimate| reward_note(&Numbers::from_iter([number("open_loop_reward_r2@1", estimate)]));
    assert!(of(f64::NAN).unwrap().contains("do not vary"));
    assert!(of(-99.5).unwrap().contains("hardly vary"));
    assert_eq!((of(-0.9), of(0.5)), (None, None));
    assert_eq!(bounded(number("any", f64::NAN).value), "–");
}

#[test]
fn a_gap_that_cannot_be_is_told() {
    assert!(gap_note([0.2, -0.1]).unwrap().contains("overfits"));
    assert_eq!((gap_note([0.2, 0.0]), gap_note([f64::NAN, 0.1])), (None, None));
}
