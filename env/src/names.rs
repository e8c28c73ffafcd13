//! Files in folders that people made: their order, and which of them are no data at all. In: file names. Out: an order, and yes or no.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// The order in which people count: runs of digits by their value, everything else byte by byte, so that `2.png` comes before `10.png`. Names that are
/// padded with zeros come in the same order as by bytes.
pub fn by_number(one: &str, other: &str) -> Ordering {
    let (mut left, mut right) = (one.as_bytes(), other.as_bytes());
    loop {
        let order = match (left.first(), right.first()) {
            (None, _) | (_, None) => left.len().cmp(&right.len()),
            (Some(a), Some(b)) if a.is_ascii_digit() && b.is_ascii_digit() => {
                let (a, rest_a) = digits(left);
                let (b, rest_b) = digits(right);
                (left, right) = (rest_a, rest_b);
                // Without leading zeros the longer number is the larger.
                a.len().cmp(&b.len()).then_with(|| a.cmp(b))
            }
            (Some(a), Some(b)) => {
                (left, right) = (&left[1..], &right[1..]);
                a.cmp(b)
            }
        };
        if order != Ordering::Equal || left.is_empty() || right.is_empty() {
            // Equal but for zeros, such as 1 and 01: bytes decide, so that the order is one.
            let rest = || left.len().cmp(&right.len()).then_with(|| one.cmp(other));
            return order.then_with(rest);
        }
    }
}

/// The digits at the head without leading zeros, and what follows them.
fn digits(text: &[u8]) -> (&[u8], &[u8]) {
    let count = text.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let (number, rest) = text.split_at(count);
    let zeros = number.iter().take_while(|&&byte| byte == b'0').count();
    (&number[zeros..], rest)
}

/// Whether a file or folder is a helper of an operating system, a file server or an editor, and never data: anything hidden (`._00000.png`, `.DS_Store`),
/// `__MACOSX`, `Thumbs.db`, `desktop.ini`, `@eaDir`, backups that end in `~`.
pub fn is_helper(name: &str) -> bool {
    const NAMES: [&str; 6] = ["__macosx", "thumbs.db", "desktop.ini", "@eadir", "$recycle.bin", "lost+found"];
    name.starts_with('.') || name.ends_with('~') || NAMES.contains(&name.to_ascii_lowercase().as_str())
}

/// What lies in a folder, helpers left out, in the order of [`by_number`].
///
/// # Errors
/// When the folder cannot be read.
pub fn listed(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(Error::io("list", folder))? {
        let name = entry.map_err(Error::io("list", folder))?.file_name();
        if !is_helper(&name.to_string_lossy()) {
            names.push(name);
        }
    }
    names.sort_by(|one, other| by_number(&one.to_string_lossy(), &other.to_string_lossy()));
    Ok(names.into_iter().map(|name| folder.join(name)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_counted_and_padded_names_stay_where_they_were() {
        let mut names: Vec<String> = (1..=12).rev().map(|frame| format!("{frame}.png")).collect();
        names.sort_by(|one, other| by_number(one, other));
        assert_eq!(names, (1..=12).map(|frame| format!("{frame}.png")).collect::<Vec<_>>());
        let padded: Vec<String> = (0..200).map(|frame| format!("{frame:05}.jpg")).collect();
        let mut sorted = padded.clone();
        sorted.sort_by(|one, other| by_number(one, other));
        assert_eq!(sorted, padded);
        let mut mixed = ["v2-10", "v10-1", "v2-9", "v02-9", "a", "", "v", "v2"];
        mixed.sort_by(|one, other| by_number(one, other));
        assert_eq!(mixed, ["", "a", "v", "v2", "v02-9", "v2-9", "v2-10", "v10-1"]);
        // Longer than any integer of ours.
        let (long, longer) = (format!("f{}", "9".repeat(40)), format!("f1{}", "0".repeat(40)));
        assert_eq!(by_number(&long, &longer), Ordering::Less);
    }

    #[test]
    fn the_order_is_total() {
        let names = ["1", "01", "001", "1a", "01b", "a1", "a01", "a1b2", "a01b02", "a1b02", "b", "", "0", "00"];
        for one in names {
            for other in names {
                assert_eq!(by_number(one, other), by_number(other, one).reverse(), "{one} {other}");
                assert_eq!(by_number(one, other) == Ordering::Equal, one == other);
                for third in names {
                    let rising = by_number(one, other).is_le() && by_number(other, third).is_le();
                    assert!(!rising || by_number(one, third).is_le(), "{one} {other} {third}");
                }
            }
        }
    }

    #[test]
    fn helpers_are_no_data() {
        for name in ["._00000.png", ".DS_Store", "__MACOSX", "Thumbs.db", "desktop.ini", "00001.png~", "@eaDir"] {
            assert!(is_helper(name), "{name}");
        }
        for name in ["00000.png", "bear", "_mask.png", "a.b.npz"] {
            assert!(!is_helper(name), "{name}");
        }
    }
}
