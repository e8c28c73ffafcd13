//! What stands beside the pictures of a sheet.

use super::{Heading, NeighbourSheet, SheetColumn, Thumb};
use crate::picture::Shape;

#[test]
fn rows_that_are_no_neighbours_are_named_by_what_they_are() {
    let thumb = |name: &str| Thumb { name: name.into(), pixels: None };
    let column = || SheetColumn {
        query: thumb("0:1"),
        remark: String::new(),
        neighbours: vec![(thumb("2:3"), 0.5), (thumb("4:5"), 1.5)],
    };
    let mut sheet = NeighbourSheet {
        heading: Heading::new("a test"),
        distance: "standardized L2 distance".into(),
        rows: Vec::new(),
        columns: (0..6).map(|_| column()).collect(),
    };
    let texts = |sheet: &NeighbourSheet| -> Vec<String> {
        let text = |shape: &Shape| if let Shape::Text { text, .. } = shape { Some(text.clone()) } else { None };
        sheet.draw().shapes.iter().filter_map(text).collect()
    };
    let has = |found: &[String], wanted: &str| found.iter().any(|text| text == wanted);
    let found = texts(&sheet);
    assert!(has(&found, "query") && has(&found, "1") && has(&found, "2"), "{found:?}");
    sheet.rows = ["row", "rotated", "looks as different"].map(String::from).to_vec();
    let found = texts(&sheet);
    assert!(["row", "rotated", "looks as", "different"].iter().all(|name| has(&found, name)), "{found:?}");
    assert!(!has(&found, "1") && !found.join(" ").contains("neighbours"), "{found:?}");
}
