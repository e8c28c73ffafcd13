//! How wide tables are, what their feet say, and with how many decimals their numbers stand.

use super::*;
use crate::picture::{PAGE, Shape};

fn entry(mean: f64, half: Option<f64>) -> Option<Entry> {
    Some(Entry { mean, half, best: false, tied: false })
}

/// A table of so many rows and columns, whose names are as long as those of runs and metrics.
fn table(rows: usize, columns: usize) -> Table {
    let row = |row: usize| {
        let entries = (0..columns).map(|column| entry((row * columns + column) as f64, Some(7.5))).collect();
        (format!("held-out quantity {row} (nats a row)"), entries)
    };
    Table {
        heading: Heading::new("Where training ended"),
        corner: "metric".into(),
        columns: (0..columns).map(|column| format!("vibes-seed-{column}")).collect(),
        rows: (0..rows).map(row).collect(),
        by_row: true,
        foot: "vibes-train evaluate, else last evaluation, else mean of the last tenth".into(),
    }
}

fn texts(picture: &Picture) -> Vec<String> {
    let text = |shape: &Shape| match shape {
        Shape::Text { text, .. } => Some(text.clone()),
        _ => None,
    };
    picture.shapes.iter().filter_map(text).collect()
}

#[test]
fn a_table_of_any_size_is_no_wider_than_a_page_and_loses_nothing() {
    for (rows, columns) in [(1, 1), (3, 12), (12, 3), (40, 1), (2, 90)] {
        let wide = table(rows, columns);
        let picture = wide.draw();
        assert!(picture.width <= PAGE, "{rows} x {columns}: {}", picture.width);
        let found = texts(&picture);
        let count = |wanted: &str| found.iter().filter(|text| *text == wanted).count();
        for name in &wide.columns {
            assert_eq!(count(name), 1, "{name} of {rows} x {columns}");
        }
        let numbers = found.iter().filter(|text| text.contains('±')).count();
        assert_eq!(numbers, rows * columns);
    }
    let mut long = table(2, 2);
    long.rows[0].0 = "/somewhere/runs/of/many/words".repeat(8);
    long.columns[0] = "a-folder-of-many-words".repeat(8);
    long.corner = "objective, ".repeat(30);
    assert!(long.draw().width <= PAGE);
    assert!(table(3, 0).draw().width <= PAGE && table(0, 3).draw().width <= PAGE);
}

#[test]
fn heads_and_foot_are_broken_into_lines() {
    let turned = table(3, 2).transposed("group");
    assert_eq!((turned.columns.len(), turned.rows.len(), turned.by_row), (3, 2, false));
    let picture = turned.draw();
    let found = texts(&picture);
    assert!(found.iter().any(|text| text == "held-out") && !found.contains(&turned.columns[0]), "{found:?}");
    let told = Table { foot: "a word more ".repeat(60), ..turned.clone() };
    assert_eq!(told.draw().width, picture.width, "a foot sets no width");
    assert_eq!(turned.transposed("metric"), table(3, 2));
}

#[test]
fn a_foot_speaks_of_the_marks_that_are_there() {
    let plain = table(2, 2);
    assert_eq!(plain.foot_text(), plain.foot);
    let mut marked = plain.clone();
    marked.rows[0].1[1] = Some(Entry { mean: 1.0, half: None, best: true, tied: false });
    assert_eq!(marked.foot_text(), format!("{}; bold: best of its row", plain.foot));
    marked.rows[0].1[0] = Some(Entry { mean: 1.0, half: None, best: false, tied: true });
    marked.foot.clear();
    let words = "bold: best of its column; underlined: its 95% interval overlaps with the best's";
    assert_eq!(marked.transposed("group").foot_text(), words);
}

#[test]
fn numbers_of_one_kind_have_one_number_of_decimals() {
    let mut mixed = table(2, 2);
    mixed.rows[0].1 = vec![entry(930.0, Some(12.0)), entry(412.0, Some(2.5))];
    mixed.rows[1].1 = vec![entry(0.5, None), None];
    let text = |text: &str| Some(text.to_string());
    let wanted = [vec![text("930.0 ± 12.0"), text("412.0 ± 2.5")], vec![text("0.50"), None]];
    assert_eq!(mixed.texts(), wanted);
    let turned = mixed.transposed("group").texts();
    assert_eq!(turned, [vec![text("930.0 ± 12.0"), text("0.50")], vec![text("412.0 ± 2.5"), None]]);
}
