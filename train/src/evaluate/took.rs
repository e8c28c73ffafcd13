//! How long an evaluation took, and what of it: most of the time is the critic's that measures the gaps, which can be left out.

use std::time::Duration;

/// How long an evaluation took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Took {
    /// All of it.
    pub all: Duration,
    /// The part of the gaps' critic.
    pub critic: Duration,
}

impl Took {
    /// `37 s, of which the critic of the gaps 33; --gap-updates 0 leaves it out`, or as much of that as is so.
    pub fn in_words(&self) -> String {
        let [all, critic] = [self.all, self.critic].map(|time| time.as_secs_f64());
        // What takes no time need not be left out.
        let is_slow = critic >= 1.0 && critic > all / 2.0;
        let hint = if is_slow { "; --gap-updates 0 leaves it out" } else { "" };
        let of_critic =
            if critic >= 0.5 { format!(", of which the critic of the gaps {critic:.0}") } else { String::new() };
        format!("{all:.0} s{of_critic}{hint}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_takes_long_is_named_with_the_way_to_leave_it_out() {
        let of = |all: u64, critic: u64| {
            let [all, critic] = [all, critic].map(Duration::from_secs);
            Took { all, critic }.in_words()
        };
        assert_eq!(of(37, 33), "37 s, of which the critic of the gaps 33; --gap-updates 0 leaves it out");
        assert_eq!(of(37, 3), "37 s, of which the critic of the gaps 3");
        assert_eq!(of(4, 0), "4 s");
    }
}
