//! Care of recordings: taking parts of them, joining them, and carrying them to and from the formats of others.
//!
//! In: recordings, or other people's datasets. Out: a new folder, which appears whole or not at all. A recording is never changed in place, and
//! a file whose bytes need not change is not written again but linked.

pub mod export;
mod folder;
pub mod import;
pub mod merge;
pub mod select;
pub mod split;

pub(crate) use folder::NewFolder;
