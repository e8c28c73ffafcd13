//! What must be said of gaps to a bisimulation that stand beside each other: they are estimates by a critic that is fitted anew, and depend on for how long.
//!
//! In: runs with their names. Out: sentences for those who read a table or a report of them.

use std::collections::BTreeSet;

use crate::input::Run;
use crate::metrics::{DYNAMICS_GAP, Metric, REWARD_GAP};
use crate::picture::number::{fixed, minus};

/// The gaps on the held-out grid.
pub(super) const GAPS: [&str; 2] = [DYNAMICS_GAP, REWARD_GAP];

/// After how many updates of the critic those of the runs' gaps that are shown were read, and what must be said of them; nothing where none is shown.
pub(super) fn notes(runs: &[(&str, &Run)], shown: &[&str]) -> Vec<String> {
    if !GAPS.iter().any(|gap| shown.contains(gap)) {
        return Vec::new();
    }
    let known: BTreeSet<u64> = runs.iter().filter_map(|(_, run)| run.gap_updates()).collect();
    let one = known.first().filter(|_| known.len() == 1);
    let of_one = one.map(|updates| format!("gaps are those after {updates} updates of the critic, where runs say so"));
    of_one.into_iter().chain(remarks(runs, shown)).collect()
}

/// What must be said of those of the runs' gaps that are shown.
pub(super) fn remarks(runs: &[(&str, &Run)], shown: &[&str]) -> Vec<String> {
    let gaps: Vec<&str> = GAPS.into_iter().filter(|gap| shown.contains(gap)).collect();
    let with_gaps: Vec<(&str, &Run)> =
        runs.iter().copied().filter(|(_, run)| gaps.iter().any(|gap| run.final_value(gap).is_some())).collect();
    let below = with_gaps.iter().flat_map(|(name, run)| gaps.iter().filter_map(move |gap| below_zero(name, run, gap)));
    different(&with_gaps).into_iter().chain(below).collect()
}

/// That the critics of several runs were fitted for different numbers of updates, or that of some nobody knows.
fn different(runs: &[(&str, &Run)]) -> Option<String> {
    let updates: Vec<Option<u64>> = runs.iter().map(|(_, run)| run.gap_updates()).collect();
    if updates.windows(2).all(|pair| pair[0] == pair[1]) {
        return None;
    }
    let of = |((name, _), updates): (&(&str, &Run), &Option<u64>)| match updates {
        Some(updates) => format!("{name} after {updates}"),
        None => format!("{name} after a number that its evaluations do not say"),
    };
    let each: Vec<String> = runs.iter().zip(&updates).map(of).collect();
    Some(format!(
        "the gaps are of different procedures and cannot be compared: updates of the critic that finds them differ ({}); `vibes-train evaluate --gap-updates` measures all alike",
        each.join(", ")
    ))
}

/// That a gap is below 0, which no model can be the reason of.
fn below_zero(name: &str, run: &Run, gap: &str) -> Option<String> {
    let value = run.final_value(gap).filter(|value| *value < 0.0)?;
    Some(format!(
        "{name}: {} is {}; below 0 the critic overfits few episodes: the number says nothing of the latents",
        Metric::named(gap).title,
        minus(&fixed(value, 3))
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run with an evaluation of this dynamics gap after so many updates of the critic, if the file says so.
    fn run(folder: &std::path::Path, gap: f64, updates: Option<u64>) -> Run {
        std::fs::create_dir_all(folder).expect("folder");
        std::fs::write(folder.join("metrics.jsonl"), "{\"update\":100,\"loss\":2.5}\n").expect("metrics");
        let updates = updates.map_or_else(String::new, |updates| format!("\"gap_updates\":{updates},"));
        let text = format!(
            "{{\"checkpoint\":\"checkpoints/000100/model.safetensors\",{updates}\"report\":{{}},\"gaps\":{{\"dynamics_gap\":{gap}}}}}"
        );
        std::fs::write(folder.join("evaluation.json"), text).expect("evaluation");
        Run::read(folder).expect("run")
    }

    #[test]
    fn gaps_of_different_procedures_and_those_below_zero_are_told() {
        let dir = tempfile::tempdir().expect("folder");
        let [a, b, c] = [("a", 1.5, Some(500)), ("b", -0.25, Some(200)), ("c", 2.0, None)]
            .map(|(name, gap, updates)| run(&dir.path().join(name), gap, updates));
        assert_eq!([a.gap_updates(), b.gap_updates(), c.gap_updates()], [Some(500), Some(200), None]);
        let said = remarks(&[("a", &a), ("b", &b), ("c", &c)], &GAPS);
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(said[0].contains("a after 500, b after 200, c after a number that"), "{said:?}");
        assert!(said[1].starts_with("b: held-out dynamics gap (nats) is −0.250; below 0 the critic"), "{said:?}");
        assert_eq!(remarks(&[("a", &a), ("b", &b)], &["objective"]), Vec::<String>::new(), "no gap is shown");
        assert_eq!(remarks(&[("a", &a), ("a", &a)], &GAPS), Vec::<String>::new(), "of one procedure");
        let one = "gaps are those after 500 updates of the critic, where runs say so";
        assert_eq!(notes(&[("a", &a), ("a", &a)], &GAPS), [one]);
        assert_eq!(notes(&[("a", &a), ("b", &b), ("c", &c)], &GAPS), said);
        assert_eq!(notes(&[("a", &a)], &["objective"]), Vec::<String>::new());
    }
}
