//! The verdict's numbers: out of the documents of the verbs, and of what the runs were measured on.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::input::Run;
use crate::metrics::{HELD_OUT_RETURN, RETURNS};
use crate::picture::number::{fixed, minus};
use crate::report::{Answer, Measure, Verdict};
use vibes_measure::numbers::probe_family;
use vibes_measure::probes::{Fitting, Probe, over_chance};

/// What is known about one run: the documents of the verbs by name, and the run folder.
pub(super) struct Known {
    pub(super) name: String,
    pub(super) documents: BTreeMap<&'static str, Value>,
    pub(super) run: Option<Run>,
}

pub(super) fn verdict(known: &[Known]) -> Verdict {
    let groups = vec![
        ("What do the latents hold?".to_string(), hold(known)),
        ("What do they ignore?".to_string(), ignore(known)),
        ("How well do they predict?".to_string(), predict(known)),
        ("How well does the policy do?".to_string(), act(known)),
    ];
    Verdict { runs: known.iter().map(|k| k.name.clone()).collect(), groups }
}

/// A measure of every run; none if no run has it.
fn measure(known: &[Known], name: &str, reading: &str, of: impl Fn(&Known) -> Option<Answer>) -> Option<Measure> {
    let answers: Vec<Option<Answer>> = known.iter().map(of).collect();
    answers.iter().any(Option::is_some).then(|| Measure {
        name: name.into(),
        reading: reading.into(),
        answers: answers.into_iter().map(Option::unwrap_or_default).collect(),
    })
}

fn hold(known: &[Known]) -> Vec<Measure> {
    let mut all = vec![
        measure(
            known,
            "Task quantities, read by a linear probe",
            &format!("mean R², where one below 0 counts as 0, {}; 1 is everything", fitting_of(known)),
            |k| probes(k, "task"),
        ),
        measure(
            known,
            "Same state found under another distractor",
            "share of rows whose nearest latent among all other cells at that step shows the same state",
            |k| number(k, "invariance", "retrieval_same_step@1"),
        ),
        measure(known, "Variance that the state explains", "share of the latents' variance; 1 is all of it", |k| {
            number(k, "invariance", "state_share")
        }),
    ];
    all.insert(1, hardest(known));
    all.into_iter().flatten().collect()
}

fn ignore(known: &[Known]) -> Vec<Measure> {
    let mut all = vec![
        measure(known, "Variance that the distractor explains", "share of the latents' variance; 0 is none", |k| {
            number(k, "invariance", "distractor_share")
        }),
        measure(
            known,
            "Distractors, read by a linear probe",
            &format!(
                "mean R², where one below 0 counts as 0, {} (which video: accuracy over chance, cross-validated); 0 is nothing",
                fitting_of(known)
            ),
            |k| probes(k, "distractor"),
        ),
        measure(known, "Which video is shown", "accuracy of a linear probe, cross-validated; chance is good", |k| {
            number(k, "probe", &probe_name(k, "video")?)
        }),
    ];
    all.insert(2, easiest(known));
    all.into_iter().flatten().collect()
}

fn predict(known: &[Known]) -> Vec<Measure> {
    let of = |name: &'static str| move |k: &Known| gap(k, name);
    let all = [
        measure(
            known,
            "Held-out dynamics gap",
            "nats a row by which a critic that sees the whole history predicts the next latent better than heads refitted on (h, s, a); 0 for a bisimulation",
            of("dynamics"),
        ),
        measure(
            known,
            "Held-out reward gap",
            "nats a row by which the same critic predicts the reward better than heads refitted on (h, s, a); 0 for a bisimulation",
            of("reward"),
        ),
        measure(known, "Reward log-likelihood", "nats a row, at the end of training", |k| {
            series(k, "reward_log_likelihood")
        }),
    ];
    all.into_iter().flatten().collect()
}

fn act(known: &[Known]) -> Vec<Measure> {
    let of = |k: &Known| {
        let name = RETURNS.into_iter().find(|name| k.run.as_ref().is_some_and(|run| run.series.contains_key(*name)))?;
        let mut answer = series(k, name)?;
        if name == HELD_OUT_RETURN {
            let run = k.run.as_ref()?;
            let end = |part: &str| run.final_value(&format!("held_out.{part}"));
            // A mean over evaluations has no interval of its own; only a last evaluation's does.
            let last = |part: &str| run.last_evaluation(&format!("held_out.{part}"));
            if let Some((low, high)) = last("held_out.interval.low").zip(last("held_out.interval.high")) {
                answer.interval = format!("{} to {}", text(low), text(high));
            }
            // Where nobody sees a video, both sets are the same episodes.
            let training = end("training_videos.mean_return").filter(|_| run.sees_videos());
            answer.beside = training.map_or_else(String::new, |mean| format!("on training videos: {}", text(mean)));
        }
        Some(answer)
    };
    let sees_videos = known.iter().filter_map(|k| k.run.as_ref()).any(Run::sees_videos);
    let on = if sees_videos { " on held-out videos" } else { "" };
    let reading = &format!("sum of rewards; of evaluations{on} where there are some, else while training");
    measure(known, "Return of an episode", reading, of).into_iter().collect()
}

/// One number of a verb's document, with its interval, chance and control.
fn number(known: &Known, verb: &str, name: &str) -> Option<Answer> {
    let number = known.documents.get(verb)?.get("numbers")?.get(name)?;
    let mut beside = Vec::new();
    if let Some(actions) = number["past_actions"]["estimate"].as_f64() {
        beside.push(format!("past actions alone: {}", text(actions)));
    }
    if let Some(chance) = number["chance"].as_f64() {
        beside.push(format!("chance: {}", text(chance)));
    }
    Some(Answer { number: text(number["estimate"].as_f64()?), interval: interval(number), beside: beside.join("; ") })
}

/// The mean of the linear probes of a section, and of the control's, with the range of the single quantities. What is read worse than by its mean counts as not
/// read: an R² has no lower bound, and one far below 0 would hide what is read of the others. A mean over quantities has no interval.
fn probes(known: &Known, section: &str) -> Option<Answer> {
    let scores = scores(known, section);
    let mean = |of: &dyn Fn(&Score) -> Option<f64>| {
        let values: Vec<f64> = scores.iter().filter_map(of).map(|score| score.max(0.0)).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    let latent = mean(&|s| Some(s.latent))?;
    let actions = mean(&|s| s.actions).map(|actions| format!("past actions alone: {}", text(actions)));
    let (least, most) =
        scores.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), s| (a.min(s.latent), b.max(s.latent)));
    let range = (scores.len() > 1).then(|| format!("single quantities: {} to {}", text(least), text(most)));
    let beside = actions.into_iter().chain(range).collect::<Vec<_>>().join("; ");
    Some(Answer { number: text(latent), interval: String::new(), beside })
}

/// The task quantity that is read worst of the first run that has one, over all runs.
fn hardest(known: &[Known]) -> Option<Measure> {
    let worst =
        known.iter().find_map(|k| scores(k, "task").into_iter().min_by(|a, b| a.latent.total_cmp(&b.latent)))?;
    let reading = format!("R² of a linear probe, {}", fitting_of(known));
    measure(known, &format!("The hardest of them: {}", worst.quantity), &reading, |k| {
        number(k, "probe", &probe_name(k, &worst.quantity)?)
    })
}

/// The distractor that is read best of the first run that has one, over all runs: what the mean over all may hide.
fn easiest(known: &[Known]) -> Option<Measure> {
    let best =
        known.iter().find_map(|k| scores(k, "distractor").into_iter().max_by(|a, b| a.latent.total_cmp(&b.latent)))?;
    let reading = "R² of a linear probe, or accuracy over chance of which video is shown; 0 is nothing";
    measure(known, &format!("The easiest of them: {}", best.quantity), reading, |k| {
        let score = scores(k, "distractor").into_iter().find(|score| score.quantity == best.quantity)?;
        let actions = score.actions.map(|actions| format!("past actions alone: {}", text(actions)));
        let interval = score.ends.map(|(low, high)| format!("{} to {}", text(low), text(high)));
        let (interval, beside) = (interval.unwrap_or_default(), actions.unwrap_or_default());
        Some(Answer { number: text(score.latent), interval, beside })
    })
}

/// How the linear probe of a quantity is called in a run's document, which says what it was fitted on.
fn probe_name(known: &Known, quantity: &str) -> Option<String> {
    let numbers = known.documents.get("probe")?.get("numbers")?;
    let families = [Fitting::OtherRecordings, Fitting::CrossValidation].map(|fit| probe_family(Probe::Linear, fit));
    let mut names = families.into_iter().map(|family| format!("{family}/{quantity}/s"));
    names.find(|name| numbers.get(name).is_some())
}

/// What the probes of numbers were fitted on, in words.
fn fitting_of(known: &[Known]) -> &'static str {
    let family = probe_family(Probe::Linear, Fitting::OtherRecordings);
    let of = |k: &Known| {
        let names = k.documents.get("probe")?.get("numbers")?.as_object()?;
        Some(names.keys().any(|name| name.split('/').next() == Some(family)))
    };
    if known.iter().any(|k| of(k) == Some(true)) {
        "fitted on other recordings"
    } else {
        "cross-validated over the trajectories of these latents"
    }
}

/// How well a quantity is read: R², or accuracy over chance.
struct Score {
    quantity: String,
    latent: f64,
    /// The ends of its interval.
    ends: Option<(f64, f64)>,
    actions: Option<f64>,
}

fn scores(known: &Known, section: &str) -> Vec<Score> {
    let Some(document) = known.documents.get("probe") else { return Vec::new() };
    let quantities = document["quantities"].as_array().into_iter().flatten();
    let of = |quantity: &Value| {
        let name = quantity["quantity"].as_str().filter(|_| quantity["section"] == section)?;
        let number = &document["numbers"][probe_name(known, name)?];
        let over = |value: f64| over_chance(value, number["chance"].as_f64().unwrap_or(0.0));
        let latent = over(number["estimate"].as_f64()?);
        let ends = number["low"].as_f64().zip(number["high"].as_f64()).map(|(low, high)| (over(low), over(high)));
        let actions = number["past_actions"]["estimate"].as_f64().map(over);
        Some(Score { quantity: name.into(), latent, ends, actions })
    };
    quantities.filter_map(of).collect()
}

/// A gap to a bisimulation on the held-out recording, beside that on training recordings, and after how many updates of the critic both are.
fn gap(known: &Known, of: &str) -> Option<Answer> {
    let run = known.run.as_ref()?;
    let end = |part: &str| run.final_value(&format!("held_out.gaps.{part}"));
    let value = end(&format!("{of}_gap"))?;
    let ends = end(&format!("held_out.{of}.gap.low")).zip(end(&format!("held_out.{of}.gap.high")));
    let interval = ends.map_or_else(String::new, |(low, high)| format!("{} to {}", text(low), text(high)));
    let training = end(&format!("training.{of}.gap.estimate"));
    let training = training.map(|gap| format!("on training recordings: {}", text(gap)));
    let updates = run.gap_updates().map(|updates| format!("after {updates} updates of the critic"));
    let beside = training.into_iter().chain(updates).collect::<Vec<_>>().join("; ");
    Some(Answer { number: text(value), interval, beside })
}

/// Where a metric of the run ended; its interval where one was measured.
fn series(known: &Known, name: &str) -> Option<Answer> {
    let run = known.run.as_ref()?;
    let end = |part: &str| run.final_value(&format!("{name}{part}"));
    let value = end("").or_else(|| end(".estimate"))?;
    let interval = end(".low")
        .zip(end(".high"))
        .map_or_else(String::new, |(low, high)| format!("{} to {}", text(low), text(high)));
    Some(Answer { number: text(value), interval, beside: String::new() })
}

fn interval(number: &Value) -> String {
    match number["low"].as_f64().zip(number["high"].as_f64()) {
        Some((low, high)) => format!("{} to {}", text(low), text(high)),
        None => String::new(),
    }
}

fn text(value: f64) -> String {
    let decimals = match value.abs() {
        a if a >= 100.0 => 0,
        a if a >= 10.0 => 1,
        _ => 2,
    };
    minus(&fixed(value, decimals))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_verdict_says_what_the_documents_say() {
        let number = |estimate: f64| json!({ "estimate": estimate, "low": estimate - 0.1, "high": estimate + 0.1, "chance": 0.0, "past_actions": { "estimate": 0.25 } });
        let probe = json!({
            "quantities": [{ "quantity": "angle", "section": "task" }, { "quantity": "speed", "section": "task" }, { "quantity": "video", "section": "distractor" }],
            "numbers": { "probe/angle/s": number(0.9), "probe/speed/s": number(0.5), "probe_cross_validated/video/s": { "estimate": 0.6, "low": 0.5, "high": 0.7, "chance": 0.5 } },
        });
        let known = Known { name: "a".into(), documents: BTreeMap::from([("probe", probe)]), run: None };
        let verdict = verdict(&[known]);
        let task = &verdict.groups[0].1[0].answers[0];
        assert_eq!(
            (task.number.as_str(), task.interval.as_str(), task.beside.as_str()),
            ("0.70", "", "past actions alone: 0.25; single quantities: 0.50 to 0.90"),
            "a range of quantities is no interval"
        );
        let hardest = &verdict.groups[0].1[1];
        assert!(hardest.name.contains("speed") && hardest.answers[0].interval == "0.40 to 0.60", "{hardest:?}");
        let video: Vec<&str> = verdict.groups[1].1.iter().map(|m| m.answers[0].number.as_str()).collect();
        assert_eq!(video, ["0.20", "0.20", "0.60"], "over chance twice, and as it is");
        let easiest = &verdict.groups[1].1[1];
        assert!(easiest.name == "The easiest of them: video" && easiest.answers[0].interval == "0.00 to 0.40");
        let reading = |group: usize| verdict.groups[group].1[0].reading.as_str();
        assert!([0, 1].iter().all(|&group| reading(group).contains("fitted on other recordings")), "{}", reading(0));
        assert!(verdict.groups[2].1.is_empty() && verdict.groups[3].1.is_empty());
    }
    /// An R² has no lower bound: a camera at −2 beside a video at 0.94 is no reason to say that nothing is read.
    #[test]
    fn what_is_read_of_no_distractor_does_not_hide_what_is_read_of_another() {
        let number = |estimate: f64, chance: f64| json!({ "estimate": estimate, "chance": chance });
        let probe = json!({
            "quantities": [{ "quantity": "camera r", "section": "distractor" }, { "quantity": "video", "section": "distractor" }],
            "numbers": {
                "probe_cross_validated/camera r/s": number(-2.0, 0.0), "probe_cross_validated/video/s": number(0.95, 0.5),
            },
        });
        let known = Known { name: "a".into(), documents: BTreeMap::from([("probe", probe)]), run: None };
        let verdict = verdict(&[known]);
        let [mean, easiest, _] = &verdict.groups[1].1[..] else { panic!("{verdict:?}") };
        assert_eq!(
            (mean.answers[0].number.as_str(), mean.answers[0].beside.as_str()),
            ("0.45", "single quantities: −2.00 to 0.90")
        );
        assert!(mean.reading.contains("below 0 counts as 0"), "{}", mean.reading);
        assert_eq!((easiest.name.as_str(), easiest.answers[0].number.as_str()), ("The easiest of them: video", "0.90"));
        assert_eq!(text(-0.001), "0.00", "nothing has no sign");
    }

    #[test]
    fn a_gap_says_after_how_many_updates_of_the_critic_and_returns_name_no_videos_that_nobody_sees() {
        let dir = tempfile::tempdir().expect("folder");
        let line = "{\"update\":100,\"is_final\":true,\"held_out\":{\"mean_return\":70.5},\"training_videos\":{\"mean_return\":70.5}}\n";
        let evaluation = "{\"checkpoint\":\"checkpoints/000100/model.safetensors\",\"gap_updates\":500,\"report\":{},\"gaps\":{\"dynamics_gap\":1.5}}";
        let files = [
            ("metrics.jsonl", "{\"update\":100,\"loss\":2.5}\n"),
            ("evaluations.jsonl", line),
            ("evaluation.json", evaluation),
        ];
        files.iter().for_each(|(name, text)| std::fs::write(dir.path().join(name), text).expect("file"));
        let run = Run::read(dir.path()).expect("run");
        let verdict = verdict(&[Known { name: "a".into(), documents: BTreeMap::new(), run: Some(run) }]);
        assert_eq!(verdict.groups[2].1[0].answers[0].beside, "after 500 updates of the critic");
        let returns = &verdict.groups[3].1[0];
        assert_eq!(returns.answers[0].number, "70.5");
        assert!(!returns.reading.contains("video") && returns.answers[0].beside.is_empty(), "{returns:?}");
    }

    #[test]
    fn cross_validated_probes_are_called_so() {
        let number = json!({ "estimate": 0.5, "low": 0.4, "high": 0.6, "chance": 0.0 });
        let probe = json!({
            "quantities": [{ "quantity": "angle", "section": "task" }],
            "numbers": { "probe_cross_validated/angle/s": number },
        });
        let known = Known { name: "a".into(), documents: BTreeMap::from([("probe", probe)]), run: None };
        let verdict = verdict(&[known]);
        for measure in &verdict.groups[0].1 {
            assert!(measure.answers[0].number == "0.50" && measure.reading.contains("cross-validated"), "{measure:?}");
        }
        assert_eq!(verdict.groups[0].1.len(), 2);
    }
}
