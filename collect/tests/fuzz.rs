//! The readers of this program's files under seeded damage ([`damage`]).

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "../../fuzz/readers/collect.rs"]
mod collect;
#[path = "../../fuzz/damage.rs"]
mod damage;
#[path = "../../fuzz/readers.rs"]
mod readers;

#[test]
fn no_reader_panics_or_allocates_without_measure() {
    damage::check(collect::PART);
}
