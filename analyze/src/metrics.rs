//! The metrics of runs that are known by name: what they are called in figures, whether a higher number is a better one, and which interval lies beside
//! one on the disk. Any other metric is shown under its own name.

/// What the dynamics gap of a held-out grid is called: the log-likelihood of a critic that sees the whole history, minus that of heads refitted on (h, s, a).
pub const DYNAMICS_GAP: &str = "held_out.gaps.dynamics_gap";

/// The same of the reward.
pub const REWARD_GAP: &str = "held_out.gaps.reward_gap";

/// After how many updates of the critic both were read.
pub const GAP_UPDATES: &str = "held_out.gaps.critic_updates";

/// What stands before and behind the name of a number of a held-out grid, as in `held_out.numbers.state_share.estimate`.
pub const NUMBERS: &str = "held_out.numbers.";
/// See [`NUMBERS`].
pub const ESTIMATE: &str = ".estimate";

/// What the mean return of evaluations on held-out videos is called.
pub const HELD_OUT_RETURN: &str = "held_out.held_out.mean_return";

/// The same on training videos: of the same episodes where nobody sees a video.
pub const TRAINING_VIDEOS_RETURN: &str = "held_out.training_videos.mean_return";

/// What the mean difference of the two is called; only evaluations under videos have it.
pub const RETURN_GAP: &str = "held_out.gap.mean";

/// Returns, the most telling first.
pub const RETURNS: [&str; 6] =
    [HELD_OUT_RETURN, "eval_return", "mean_return", "return", "training_return", "episode_return"];

/// Name, title, whether higher is better; in the order in which they are shown.
const KNOWN: [(&str, &str, bool); 21] = [
    (HELD_OUT_RETURN, "return, held-out videos", true),
    (TRAINING_VIDEOS_RETURN, "return, training videos", true),
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
    (REWARD_GAP, "held-out reward gap (nats)", false),
    ("held_out.numbers.retrieval_same_step@1.estimate", "held-out retrieval_same_step@1", true),
    ("held_out.numbers.state_share.estimate", "held-out state_share", true),
    ("held_out.numbers.distractor_share.estimate", "held-out distractor_share", false),
    ("held_out.numbers.open_loop_reward_r2@10.estimate", "held-out open_loop_reward_r2@10", true),
    ("held_out.numbers.probe/reward/hs.estimate", "held-out probe/reward/hs", true),
    (RETURN_GAP, "return, training less held-out videos", false),
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

/// What a 95% interval is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Over {
    /// The runs of a group.
    Runs,
    /// The episodes of one evaluation of one run.
    Episodes,
    /// The trajectories of the grid that one run was evaluated on.
    Trajectories,
}

impl Over {
    /// As files and figures say it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Runs => "runs",
            Self::Episodes => "episodes",
            Self::Trajectories => "trajectories",
        }
    }
}

/// The interval that an evaluation holds of a number: what stands before the `.low` and `.high` of its ends, and what it is over. None for metrics of training batches.
#[must_use]
pub fn own_interval(metric: &str) -> Option<(String, Over)> {
    if metric == RETURN_GAP {
        return Some(("held_out.gap.interval".into(), Over::Episodes));
    }
    if let Some(set) = metric.strip_suffix(".mean_return") {
        return Some((format!("{set}.interval"), Over::Episodes));
    }
    let quantity = metric.strip_prefix("held_out.gaps.").and_then(|rest| rest.strip_suffix("_gap"));
    if let Some(quantity) = quantity {
        return Some((format!("held_out.gaps.held_out.{quantity}.gap"), Over::Trajectories));
    }
    metric.strip_suffix(ESTIMATE).map(|number| (number.to_owned(), Over::Trajectories))
}

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

    /// The same as it is called where nobody sees a video, as an agent that looks at numbers: nothing is held out there, and both sets are the same episodes.
    #[must_use]
    pub fn without_videos(self) -> Self {
        let title = match self.name.as_str() {
            HELD_OUT_RETURN => "return at evaluations".into(),
            TRAINING_VIDEOS_RETURN => "return at evaluations, the same episodes".into(),
            _ => self.title.clone(),
        };
        Self { title, ..self }
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
    #[test]
    fn every_number_of_an_evaluation_has_its_interval_beside_it() {
        let of = |metric: &str| own_interval(metric).map(|(name, over)| format!("{name} over {}", over.name()));
        assert_eq!(of(HELD_OUT_RETURN).as_deref(), Some("held_out.held_out.interval over episodes"));
        assert_eq!(of(RETURN_GAP).as_deref(), Some("held_out.gap.interval over episodes"));
        assert_eq!(of(DYNAMICS_GAP).as_deref(), Some("held_out.gaps.held_out.dynamics.gap over trajectories"));
        let share = "held_out.numbers.state_share.estimate";
        assert_eq!(of(share).as_deref(), Some("held_out.numbers.state_share over trajectories"));
        assert_eq!(of("objective"), None, "of training batches");
    }

    #[test]
    fn nothing_is_called_held_out_where_nobody_sees_a_video() {
        let called = |name: &str| Metric::named(name).without_videos().title;
        assert_eq!(called(HELD_OUT_RETURN), "return at evaluations");
        assert!(!called(TRAINING_VIDEOS_RETURN).contains("video"));
        assert_eq!(called("objective"), Metric::named("objective").title);
    }
}
