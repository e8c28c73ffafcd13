//! The metrics of runs that are known by name: what they are called in figures, and whether a higher number is a better one. Any other metric is shown
//! under its own name.

/// What the dynamics gap of a held-out grid is called: the log-likelihood of a critic that sees the whole history, minus that of heads refitted on (h, s, a).
pub const DYNAMICS_GAP: &str = "held_out.gaps.dynamics_gap";

/// What stands before and behind the name of a number of a held-out grid, as in `held_out.numbers.state_share.estimate`.
pub const NUMBERS: &str = "held_out.numbers.";
/// See [`NUMBERS`].
pub const ESTIMATE: &str = ".estimate";

/// What the mean return of evaluations on held-out videos is called.
pub const HELD_OUT_RETURN: &str = "held_out.held_out.mean_return";

/// Returns, the most telling first.
pub const RETURNS: [&str; 6] =
    [HELD_OUT_RETURN, "eval_return", "mean_return", "return", "training_return", "episode_return"];

/// Name, title, whether higher is better; in the order in which they are shown.
const KNOWN: [(&str, &str, bool); 21] = [
    (HELD_OUT_RETURN, "return, held-out videos", true),
    ("held_out.training_videos.mean_return", "return, training videos", true),
    ("training_return", "return while training", true),
    ("episode_return", "episode return", true),
    ("objective", "objective (nats a row)", true),
    ("dynamics_log_likelihood", "dynamics log-likelihood (nats)", true),
    ("adversary_log_likelihood", "adversary log-likelihood (nats)", true),
    ("adversary_minus_dynamics", "adversary − dynamics, training batches (nats)", false),
    ("reward_log_likelihood", "reward log-likelihood (nats)", true),
    ("clipped_share", "share of clipped terms", false),
    ("batch_effective_rank", "effective rank of a batch's latents", true),
    ("frames_per_second", "frames a second", true),
    (DYNAMICS_GAP, "held-out dynamics gap (nats)", false),
    ("held_out.gaps.reward_gap", "held-out reward gap (nats)", false),
    ("held_out.numbers.retrieval_same_step@1.estimate", "held-out retrieval_same_step@1", true),
    ("held_out.numbers.state_share.estimate", "held-out state_share", true),
    ("held_out.numbers.distractor_share.estimate", "held-out distractor_share", false),
    ("held_out.numbers.open_loop_reward_r2@10.estimate", "held-out open_loop_reward_r2@10", true),
    ("held_out.numbers.probe/reward/hs.estimate", "held-out probe/reward/hs", true),
    ("held_out.gap.mean", "return, training less held-out videos", false),
    ("inverse_log_likelihood", "log-likelihood of the action taken (nats)", true),
];

/// What is in the names of metrics of which a lower number is better.
const LOW: [&str; 15] = [
    "gap",
    "loss",
    "error",
    "distractor_share",
    "interaction_share",
    "within_state_share",
    "symmetry_ratio",
    "shuffled",
    "persistence",
    // What is read of a distractor.
    "/video/",
    "/video frame/",
    "/camera ",
    " red/",
    " green/",
    " blue/",
];

/// A metric to show.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Metric {
    /// As the run calls it.
    pub name: String,
    /// As figures call it.
    pub title: String,
    /// Whether a higher number is a better one.
    pub higher_is_better: bool,
}

impl Metric {
    /// A metric by its name. Of an unknown one a higher number is better, unless its name says that it is a gap, a loss or an error, or what a latent should
    /// not hold or do: the distractors' share, a state's spread over them, rewards foreseen whatever the actions are, the video that is shown.
    #[must_use]
    pub fn named(name: &str) -> Self {
        let known = KNOWN.iter().find(|known| known.0 == name);
        let of_grid = name.strip_prefix(NUMBERS).and_then(|number| number.strip_suffix(ESTIMATE));
        known.map_or_else(
            || Self {
                name: name.into(),
                title: of_grid.map_or_else(|| name.replace('_', " "), |number| format!("held-out {number}")),
                higher_is_better: !LOW.iter().any(|low| name.contains(low)),
            },
            |known| Self { name: known.0.into(), title: known.1.into(), higher_is_better: known.2 },
        )
    }

    /// The known metrics' names.
    pub fn known() -> impl Iterator<Item = &'static str> {
        KNOWN.iter().map(|known| known.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lower_number_is_better_where_latents_should_not_hold_something() {
        let better = |name: &str| Metric::named(name).higher_is_better;
        assert!(better("retrieval_same_step@1") && better("open_loop_reward_r2@5") && better(KNOWN[14].0));
        assert!(!better("interaction_share") && !better("probe/video/hs") && !better("probe_knn/pole red/s"));
        assert!(!better("distractor_share") && !better("open_loop_reward_r2_shuffled@5") && !better(DYNAMICS_GAP));
        assert!(!better("open_loop_reward_r2_persistence@5"));
        let full = Metric::named("held_out.numbers.distractor_share.estimate");
        assert_eq!((full.title.as_str(), full.higher_is_better), ("held-out distractor_share", false));
    }
}
