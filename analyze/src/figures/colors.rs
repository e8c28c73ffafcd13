//! Which colour a group of runs, or a table of their latents, has: a method that is known by name the same one in every figure.

use crate::picture::color::KINDS;

/// Objectives and systems of `vibes-train`, in the order of their colours. Those behind the seventh have the colour of one before them where that is not in the figure.
const METHODS: [&str; 17] = [
    "vibes",
    "no-adversary",
    "reconstruction",
    "deepmdp",
    "kl-constraint",
    "multi-step-inverse",
    "self-prediction",
    "contrastive",
    "dbc",
    "mico",
    "simsr",
    "sac-rad",
    "sac-drq",
    "qt-opt-rad",
    "qt-opt-drq",
    "curl",
    "sar",
];

/// The number of each group's colour, as [`kind`](crate::picture::color::kind) takes it. Known methods first take theirs; of several groups of one method, as of single runs, the one with the
/// shortest name. All others take the lowest numbers that are left, in their order, so that no colour is shared before all are in use.
pub(super) fn numbers(groups: &[String]) -> Vec<usize> {
    let known = |(group, name): (usize, &String)| method(name).map(|method| (method, name.len(), group));
    let mut wanted: Vec<(usize, usize, usize)> = groups.iter().enumerate().filter_map(known).collect();
    wanted.sort_unstable();
    let mut of_group: Vec<Option<usize>> = vec![None; groups.len()];
    for (method, _, group) in wanted {
        let own = Some(method % KINDS.len());
        if !of_group.contains(&own) {
            of_group[group] = own;
        }
    }
    let left: Vec<usize> =
        (0..groups.len() + KINDS.len()).filter(|number| !of_group.contains(&Some(*number))).collect();
    let mut left = left.into_iter();
    of_group.into_iter().enumerate().map(|(group, own)| own.or_else(|| left.next()).unwrap_or(group)).collect()
}

/// The method that a group is named after, whatever stands around it: `VIBES, 832 episodes`, `reacher-no-adversary-1`.
fn method(group: &str) -> Option<usize> {
    let group = group.to_lowercase();
    let is_end = |sign: Option<char>| sign.is_none_or(|sign| !sign.is_alphanumeric());
    let is_of = |method: &str| {
        group
            .match_indices(method)
            .any(|(at, _)| is_end(group[..at].chars().next_back()) && is_end(group[at + method.len()..].chars().next()))
    };
    METHODS.iter().position(|method| is_of(method))
}

#[cfg(test)]
mod tests {
    use super::{KINDS, METHODS, numbers};

    fn of(groups: &[&str]) -> Vec<usize> {
        numbers(&groups.iter().map(|group| (*group).to_string()).collect::<Vec<_>>())
    }

    #[test]
    fn a_method_has_the_same_colour_in_every_figure() {
        assert_eq!(of(&["vibes", "no-adversary", "reconstruction"]), [0, 1, 2]);
        assert_eq!(of(&["no-adversary", "reconstruction", "vibes"]), [1, 2, 0]);
        assert_eq!(of(&["reconstruction", "my own"]), [2, 0]);
        assert_eq!(of(&["VIBES, 832 episodes", "reacher-no-adversary-1", "vibescape"]), [0, 1, 2]);
        assert_eq!(of(&["vibes-seed-2", "vibes", "seed-3"]), [1, 0, 2], "the shortest name is the method's own");
        assert_eq!(of(&["seed-1", "seed-2", "seed-3"]), [0, 1, 2], "names that are not known are in their order");
    }

    #[test]
    fn no_two_groups_share_a_colour_while_some_are_left() {
        for count in 1..=2 * METHODS.len() {
            let groups: Vec<String> = (0..count)
                .map(|group| METHODS.get(group * 5 % 34).map_or_else(|| format!("run-{group}"), |m| (*m).to_string()))
                .collect();
            let mut of_groups = numbers(&groups);
            let rounds = count.div_ceil(KINDS.len());
            assert!(of_groups.iter().all(|number| *number < rounds * KINDS.len()), "{of_groups:?}");
            of_groups.sort_unstable();
            of_groups.dedup();
            assert_eq!(of_groups.len(), count, "{groups:?}");
        }
        assert_eq!(of(&["vibes", "contrastive"]), [0, 1], "both would have the first");
    }
}
