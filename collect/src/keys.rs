//! Entries of a manifest's options that no command line has: they say how a recording came to be. In and out: their names.

/// Under it a part says what it is a part of.
pub(crate) const SUBSET: &str = "subset";
/// In what a part says: how many episodes the whole has.
pub(crate) const WHOLE: &str = "whole";
/// Under it a merged recording says what it was made of.
pub(crate) const MERGED: &str = "merged";
