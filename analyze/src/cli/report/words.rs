//! The report's words for the task at hand.

/// What a good neighbour has in common with its query: the task's state in everyday words.
pub(super) fn subject(task: Option<&str>) -> &'static str {
    let domain = task.unwrap_or_default().split('-').next().unwrap_or_default();
    match domain {
        "reacher" => "arm and target",
        "cartpole" => "cart and pole",
        "cheetah" | "walker" | "hopper" | "humanoid" => "pose of the body",
        "finger" => "finger and spinner",
        "ball_in_cup" => "ball and cup",
        "swimmer" => "shape of the body and target",
        _ => "state of the task",
    }
}

/// A verb of the report: what it asks, and how its answer is read.
pub(super) struct Question {
    pub(super) verb: &'static str,
    pub(super) title: &'static str,
    pub(super) reading: String,
}

/// The questions about one table of latents of a task.
pub(super) fn questions(task: Option<&str>) -> Vec<Question> {
    let subject = subject(task);
    let question = |verb, title, reading: String| Question { verb, title, reading };
    vec![
        question(
            "nn",
            "What is near what?",
            format!("Each column: a row of the recording on top, the rows of other episodes with the nearest latents beneath it. Good: the same {subject}, before another background."),
        ),
        question(
            "umap",
            "What does the latent space look like?",
            "Every point is a row of the recording. Good: states lie apart, distractors are mixed.".into(),
        ),
        question(
            "grid",
            "Does a trajectory keep its place under other distractors?",
            "Panels of one row share the state trajectory, panels of one column the distractor trajectory. Good: equal along rows, different along columns.".into(),
        ),
        question(
            "clusters",
            "Which groups do the latents form?",
            format!("Groups by k-means. Good: a group is of one kind of {subject}, seen under many distractors."),
        ),
        question(
            "invariance",
            "How invariant is it?",
            "Good: the share of the state near 1, that of the distractor near 0, the same state found far more often than by chance and than from past actions alone.".into(),
        ),
        question(
            "probe",
            "What can be read from it?",
            "Probes are fitted on some trajectories and judged on others. Good: task quantities high and above past actions alone, distractors at chance.".into(),
        ),
        question(
            "symmetry",
            "Is it symmetric under rotation?",
            "Arm and target turned together change nothing that matters. Good: a ratio near 0; it is 1 if the latent knows nothing of the symmetry.".into(),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_reachers_words_speak_of_an_arm() {
        for (task, arm) in [
            (Some("reacher-easy"), true),
            (Some("cartpole-swingup"), false),
            (Some("walker-walk"), false),
            (None, false),
        ] {
            let near = &questions(task)[0].reading;
            assert_eq!(near.contains("arm"), arm, "{task:?}: {near}");
        }
        assert!(questions(Some("cartpole-swingup"))[0].reading.contains("cart and pole"));
    }
}
