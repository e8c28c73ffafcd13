//! The order that people would give names in: by the numbers in them, so that `kind2` comes before `kind10`. Columns number their kinds in it, and legends list them in it.

/// A piece of a name: its digits as the number that they are, or what stands between them.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Piece<'n> {
    /// How many digits, without zeros in front, and which.
    Number(usize, &'n [u8]),
    Text(&'n [u8]),
}

/// A name as its pieces, by which `kind2` comes before `kind10`.
pub(crate) fn pieces(name: &str) -> Vec<Piece<'_>> {
    name.as_bytes().chunk_by(|a, b| a.is_ascii_digit() == b.is_ascii_digit()).map(piece).collect()
}

fn piece(run: &[u8]) -> Piece<'_> {
    if !run.iter().all(u8::is_ascii_digit) {
        return Piece::Text(run);
    }
    let zeros = run.iter().take_while(|digit| **digit == b'0').count();
    Piece::Number(run.len() - zeros, &run[zeros..])
}

#[cfg(test)]
mod tests {
    use super::pieces;

    #[test]
    fn numbers_in_names_count_as_numbers() {
        let mut names = ["kind10", "kind2", "kind", "b 3 of 12", "b 3 of 7", "kind002x", "9", "a"];
        names.sort_by_cached_key(|&name| pieces(name));
        assert_eq!(names, ["9", "a", "b 3 of 7", "b 3 of 12", "kind", "kind2", "kind002x", "kind10"]);
    }
}
