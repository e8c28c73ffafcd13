//! The readers of this program's files under seeded damage ([`damage`]).

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "../../fuzz/damage.rs"]
mod damage;
#[path = "../../fuzz/readers.rs"]
mod readers;
#[path = "../../fuzz/readers/train.rs"]
mod train;

#[test]
fn no_reader_panics_or_allocates_without_measure() {
    damage::check(train::PART);
}
