//! What an error lists where a name is not there. In: the name, and those that are. Out: all of them where one can read them, else the most alike and how many more there are.
//! A number of a held-out grid is listed under its own name, and the ends of its interval are not.

use crate::metrics::{ESTIMATE, NUMBERS};

/// Names that are listed whole.
const READABLE: usize = 30;
/// Names that are listed of more.
const NEAREST: usize = 12;

/// The names that somebody may have meant by `asked`.
pub fn choices<'n>(asked: &str, there: impl IntoIterator<Item = &'n str>) -> String {
    let sayable = |name: &'n str| match name.strip_prefix(NUMBERS) {
        Some(number) => number.strip_suffix(ESTIMATE).filter(|number| !number.ends_with(".past_actions")),
        None => Some(name),
    };
    let mut names: Vec<&str> = there.into_iter().filter_map(sayable).collect();
    names.sort_unstable();
    names.dedup();
    let all = names.len();
    if all > READABLE {
        names.sort_by_key(|name| (std::cmp::Reverse(in_common(asked, name)), name.len()));
        names.truncate(NEAREST);
    }
    let listed = names.join(", ");
    if names.len() < all { format!("{listed} and {} others", all - names.len()) } else { listed }
}

/// The length of the longest run of bytes that both have.
fn in_common(a: &str, b: &str) -> usize {
    let mut longest = 0;
    let mut before = vec![0; b.len() + 1];
    for left in a.bytes() {
        let mut row = vec![0; b.len() + 1];
        for (at, _) in b.bytes().enumerate().filter(|(_, right)| left.eq_ignore_ascii_case(right)) {
            row[at + 1] = before[at] + 1;
            longest = longest.max(row[at + 1]);
        }
        before = row;
    }
    longest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_names_are_listed_in_order_and_of_many_the_most_alike_first() {
        assert_eq!(choices("c", ["b", "a", "b"]), "a, b");
        let many: Vec<String> = (0..600).map(|n| format!("probe/color {n}/s")).collect();
        let there = many.iter().map(String::as_str).chain(["retrieval_same_step@1", "retrieval_any_step@1"]);
        let listed = choices("retrieval_same_step", there);
        assert!(listed.starts_with("retrieval_same_step@1, retrieval_any_step@1, probe/"), "{listed}");
        assert!(listed.ends_with(" and 590 others") && listed.len() < 400, "{listed}");
        assert_eq!(choices("", ["ä", "b"]), "b, ä");
        let parts =
            ["estimate", "low", "past_actions.estimate"].map(|part| format!("held_out.numbers.state_share.{part}"));
        assert_eq!(choices("state", parts.iter().map(String::as_str).chain(["gap"])), "gap, state_share");
    }
}
