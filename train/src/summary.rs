//! One page about a run, `summary.md`: what was trained on what, how far it got, how good its latents are, how to go on. In: the run's options and its
//! numbers over time. Out: Markdown.

use std::fmt::Write;

use serde_json::Value as Json;

use crate::metrics::Row;
use crate::run::RunInfo;

/// Evaluations shown; of more, the first, the last and some between.
const SHOWN: usize = 12;

/// The page.
pub fn summary(name: &str, info: &RunInfo, rows: &[Row], evaluations: &[Json]) -> String {
    let mut page = format!("# {name}\n\n");
    about(&mut page, info);
    if let Some(last) = rows.last() {
        progress(&mut page, info, last);
    }
    if let Some(last) = evaluations.last() {
        held_out(&mut page, evaluations);
        probes(&mut page, last);
    }
    page
}

fn about(page: &mut String, info: &RunInfo) {
    let (options, model) = (&info.options, &info.model);
    let recordings: Vec<String> = info.recordings.iter().map(|path| format!("`{}`", path.display())).collect();
    let from = info.from.as_ref().map_or(String::new(), |from| format!(", from the weights of `{}`", from.display()));
    let versions: Vec<String> = info.versions.iter().map(|(name, version)| format!("{name} {version}")).collect();
    let lines = [
        format!("Objective **{}** on {} ({}){from}", options.objective, model.task, model.observation),
        format!("{} episodes, {} steps of {}", info.episodes, info.steps, recordings.join(", ")),
        format!(
            "latent {}, hidden {}, depth {}; batch {} × {} (burn-in {})",
            options.latent, options.hidden, options.depth, options.batch, options.length, options.burn_in
        ),
        format!(
            "dynamics weight {} (rising over {} updates, from update {} and a gain of {} nats on), reward weight {}, step sizes {} and {} (adversary){}, first scales {}",
            options.dynamics_weight,
            options.dynamics_warmup,
            options.dynamics_start,
            options.dynamics_after,
            options.reward_weight,
            options.lr,
            options.adversary_lr,
            if options.lr_decay > 0 { format!(", falling after {} updates", options.lr_decay) } else { String::new() },
            if options.calibrate { "set by data" } else { "as drawn" }
        ),
        format!("seed {}; {}", options.seed, versions.join(", ")),
    ];
    lines.iter().for_each(|line| push(page, &format!("* {line}")));
}

fn progress(page: &mut String, info: &RunInfo, last: &Row) {
    push(page, &format!("\n## After {} of {} updates\n", last.update, info.options.updates));
    push(page, "| quantity, mean of the last updates | value |\n|---|---|");
    let mut row = |name: &str, value: Option<f64>| {
        if let Some(value) = value {
            push(page, &format!("| {name} | {value:.3} |"));
        }
    };
    row("log-likelihood of the next latent under the dynamics, nats", Some(last.dynamics_log_likelihood));
    row("… under the adversary", last.adversary_log_likelihood);
    row("adversary minus dynamics", last.gap);
    row("share of clipped terms", last.clipped_share);
    row("log-likelihood of the reward, nats", Some(last.reward_log_likelihood));
    row("log-likelihood of the observation, up to a constant", last.reconstruction_log_likelihood);
    row("effective rank of the latents", Some(last.effective_rank));
    row("variance of the latents (at most 1)", Some(last.latent_variance));
    row("norm of the gradient", Some(last.gradient_norm));
    row("updates a second", Some(last.updates_per_second));
}

fn held_out(page: &mut String, evaluations: &[Json]) {
    push(page, "\n## On the held-out grid\n");
    push(
        page,
        "| updates | same-state retrieval@1 | state | distractor | interaction | reward gap, nats | dynamics gap, nats |",
    );
    push(page, "|---|---|---|---|---|---|---|");
    for index in shown(evaluations.len()) {
        let line = &evaluations[index];
        let number = |path: &str| line.pointer(path).and_then(Json::as_f64);
        let cell = |path: &str| number(path).map_or("–".to_owned(), |value| format!("{value:.3}"));
        let update = line["update"].as_u64().unwrap_or(0);
        push(
            page,
            &format!(
                "| {update} | {} | {} | {} | {} | {} | {} |",
                cell("/retrieval_at_1"),
                cell("/shares/state"),
                cell("/shares/distractor"),
                cell("/shares/interaction"),
                cell("/gaps/reward_gap"),
                cell("/gaps/dynamics_gap")
            ),
        );
    }
    let last = evaluations.last().unwrap_or(&Json::Null);
    let of = |name: &str| last[name].as_f64().unwrap_or(f64::NAN);
    push(
        page,
        &format!(
            "\nState, distractor and interaction are shares of the latents' variance. Retrieval by past actions alone: {:.3}; by chance: {:.3}.",
            of("retrieval_at_1_actions"),
            of("retrieval_at_1_chance")
        ),
    );
}

fn probes(page: &mut String, last: &Json) {
    let probes: &[Json] = last["probes"].as_array().map_or(&[], Vec::as_slice);
    push(
        page,
        "\n| read by ridge on held-out states or distractors (R²; accuracy for video) | latents | past actions | chance |",
    );
    push(page, "|---|---|---|---|");
    for probe in probes.iter().filter(|probe| !is_color(probe)) {
        push(page, &format!("| {} {} | {} |", text(probe, "kind"), text(probe, "name"), values(&[probe])));
    }
    let colors: Vec<&Json> = probes.iter().filter(|probe| is_color(probe)).collect();
    if !colors.is_empty() {
        push(page, &format!("| distractor colours, mean of {} | {} |", colors.len(), values(&colors)));
    }
}

fn text<'a>(probe: &'a Json, key: &str) -> &'a str {
    probe[key].as_str().unwrap_or("")
}

/// Whether a probe is one of the many of the materials' colours.
fn is_color(probe: &Json) -> bool {
    text(probe, "kind") == "distractor"
        && [" red", " green", " blue"].iter().any(|channel| text(probe, "name").ends_with(channel))
}

/// Means over probes, as cells of a table.
fn values(probes: &[&Json]) -> String {
    let mean =
        |key: &str| probes.iter().filter_map(|probe| probe[key].as_f64()).sum::<f64>() / probes.len().max(1) as f64;
    ["latents", "actions", "chance"].map(|key| format!("{:.3}", mean(key))).join(" | ")
}

/// At most [`SHOWN`] of `count` indices, evenly spaced, the first and the last among them.
fn shown(count: usize) -> Vec<usize> {
    let mut indices: Vec<usize> = match count {
        0..=SHOWN => (0..count).collect(),
        _ => (0..SHOWN).map(|i| i * (count - 1) / (SHOWN - 1)).collect(),
    };
    indices.dedup();
    indices
}

fn push(page: &mut String, line: &str) {
    // Writing to a String cannot fail.
    let _ = writeln!(page, "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_many_evaluations_the_first_and_the_last_are_shown() {
        assert_eq!(shown(3), [0, 1, 2]);
        let many = shown(100);
        assert_eq!((many.len(), many[0], many[SHOWN - 1]), (SHOWN, 0, 99));
    }
}
