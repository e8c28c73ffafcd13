//! The report's words for the task at hand: those in which the task itself names its numbers in the recording.

use vibes_data::{About, Spec};

/// How many of the task's numbers stand for its state.
const NAMED: usize = 3;

/// What a good neighbour has in common with its query: the task's state, by the first of its numbers where the recording names them.
fn subject(spec: Option<&Spec>) -> String {
    let of_the_task = |spec: &&Spec| spec.quantities.iter().any(|quantity| quantity.about == About::Task);
    let Some(spec) = spec.filter(of_the_task) else { return "state of the task".into() };
    let names = spec.quantities.iter().filter(|quantity| quantity.about == About::Task);
    let mut names: Vec<&str> = names.map(|quantity| quantity.name.as_str()).collect();
    if names.len() > NAMED {
        names.truncate(NAMED);
        names.push("…");
    }
    format!("state of the task ({})", names.join("; "))
}

/// A verb that answers about one table of latents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verb {
    Nn,
    Umap,
    Grid,
    Clusters,
    Invariance,
    Probe,
    Symmetry,
}

impl Verb {
    /// As it is typed.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Nn => "nn",
            Self::Umap => "umap",
            Self::Grid => "grid",
            Self::Clusters => "clusters",
            Self::Invariance => "invariance",
            Self::Probe => "probe",
            Self::Symmetry => "symmetry",
        }
    }
}

/// A verb of the report: what it asks, and how its answer is read.
pub(super) struct Question {
    pub(super) verb: Verb,
    pub(super) title: &'static str,
    pub(super) reading: String,
}

/// The questions about one table of latents, of a recording of this shape where one is at hand.
pub(super) fn questions(spec: Option<&Spec>) -> Vec<Question> {
    let subject = subject(spec);
    let question = |verb, title, reading: String| Question { verb, title, reading };
    vec![
        question(
            Verb::Nn,
            "What is near what?",
            format!("Each column: a row of the recording on top, the rows of other episodes with the nearest latents beneath it. Good: the same {subject}, before another background."),
        ),
        question(
            Verb::Umap,
            "What does the latent space look like?",
            "Every point is a row of the recording. Good: states lie apart, distractors are mixed.".into(),
        ),
        question(
            Verb::Grid,
            "Does a trajectory keep its place under other distractors?",
            "Panels of one row share the state trajectory, panels of one column the distractor trajectory. Good: equal along rows, different along columns.".into(),
        ),
        question(
            Verb::Clusters,
            "Which groups do the latents form?",
            format!("Groups by k-means. Good: a group is of one kind of {subject}, seen under many distractors."),
        ),
        question(
            Verb::Invariance,
            "How invariant is it?",
            "Good: the share of the state near 1, that of the distractor near 0, the same state found far more often than by chance and than from past actions alone.".into(),
        ),
        question(
            Verb::Probe,
            "What can be read from it?",
            "Probes are fitted on some trajectories and judged on others. Good: task quantities high and above past actions alone, distractors at chance.".into(),
        ),
        question(
            Verb::Symmetry,
            "Is it symmetric under rotation?",
            "The scene turned as a whole changes nothing that matters. Good: a ratio near 0; it is 1 if the latent knows nothing of the symmetry.".into(),
        ),
    ]
}

#[cfg(test)]
mod tests {
    use vibes_data::{ActionSpec, Formula, Quantity};

    use super::*;

    fn spec(names: &[(&str, About)]) -> Spec {
        let quantity =
            |&(name, about): &(&str, About)| Quantity { name: name.into(), about, formula: Formula::Qpos(0) };
        Spec {
            task: "anything".into(),
            action: ActionSpec { min: vec![-1.0], max: vec![1.0] },
            observation: Vec::new(),
            qpos: 1,
            qvel: 1,
            pixels: None,
            materials: Vec::new(),
            control_timestep: 0.02,
            action_repeat: 1,
            quantities: names.iter().map(quantity).collect(),
        }
    }

    #[test]
    fn the_words_are_those_of_the_task_itself() {
        let near = |spec: Option<&Spec>| questions(spec)[0].reading.clone();
        let task = |name| (name, About::Task);
        let few = spec(&[task("cart position"), ("heading", About::Symmetry), task("cart velocity")]);
        assert!(near(Some(&few)).contains("the same state of the task (cart position; cart velocity), before"));
        let many = spec(&["a", "b", "c", "d"].map(task));
        assert!(near(Some(&many)).contains("(a; b; c; …)"));
        for nameless in [None, Some(&spec(&[])), Some(&spec(&[("heading", About::Symmetry)]))] {
            assert!(near(nameless).contains("the same state of the task, before"));
        }
    }
}
