//! One page about a run, `summary.md`: what was trained on what, how far it got, how good its latents are, how to go on. In: the run's options and its
//! numbers over time. Out: Markdown.

use std::fmt::Write;

use serde_json::Value as Json;
use vibes_data::{Metrics, RunFolder, write_atomically};
use vibes_measure::numbers::probe_family;
use vibes_measure::probes::{Fitting, Probe};
use vibes_model::gaussian::LatentForm;

use crate::error::Result;
use crate::evaluate::open_loop::AHEAD;
use crate::learners::auxiliary::REGISTRY;
use crate::learners::objective::Condition;
use crate::metrics::{Row, rows_of};
use crate::options::Options;
use crate::run::{Run, RunInfo};

/// Evaluations shown; of more, the first, the last and some between.
const SHOWN: usize = 12;

/// Writes the page of a run, from the numbers on disk.
///
/// # Errors
/// The numbers cannot be read or the page cannot be written.
pub fn write_summary(run: &Run) -> Result<()> {
    let metrics = Metrics::read(&run.metrics_path())?;
    let control_steps = metrics.last("control_steps");
    let rows = rows_of(metrics, &run.metrics_path())?;
    let evaluations = Metrics::read(&run.evaluations_path())?.lines.into_iter().map(Json::Object).collect::<Vec<_>>();
    // The page about a run stands below online training and reads of it what lies on disk.
    let online = std::fs::read(run.path().join("online.json")).unwrap_or_default();
    let online: Json = serde_json::from_slice(&online).unwrap_or_default();
    let lived = Lived { control_steps, protocol: online["protocol"].as_str(), given: given(&online, &evaluations) };
    let page = summary(&run.name(), run.info(), &lived, rows.last(), &evaluations);
    Ok(write_atomically(&run.path().join("summary.md"), page.as_bytes())?)
}

/// Writes the page of a run without a world model, from the numbers on disk.
///
/// # Errors
/// The numbers cannot be read or the page cannot be written.
pub fn write_model_free_summary(folder: &RunFolder) -> Result<()> {
    let info = folder.open_info()?;
    let metrics = Metrics::read(&folder.metrics_path())?;
    let evaluations =
        Metrics::read(&folder.evaluations_path())?.lines.into_iter().map(Json::Object).collect::<Vec<_>>();
    let page = model_free_summary(&folder.name(), &info, &metrics, &evaluations);
    Ok(write_atomically(&folder.path().join("summary.md"), page.as_bytes())?)
}

fn model_free_summary(name: &str, info: &vibes_data::RunInfo, metrics: &Metrics, evaluations: &[Json]) -> String {
    let mut page = format!("# {name}\n\n");
    let option = |name: &str| info.options.get(name).unwrap_or(&Json::Null);
    let online = option("online");
    let text = |name: &str| option(name).as_str().unwrap_or("").to_owned();
    push(&mut page, &format!("* System **{}** ({}) on {}", text("system"), text("size"), info.task().unwrap_or("")));
    push(&mut page, &format!("* {} updates an agent step; seed {}", option("updates_per_step"), option("seed")));
    if let Some(protocol) = online["protocol"].as_str() {
        push(&mut page, &under(protocol, evaluations));
    }
    let last = |name: &str| metrics.last(name);
    let counted = |name: &str| last(name).unwrap_or(0.0);
    push(
        &mut page,
        &format!(
            "\n## After {} of {} control steps\n\n{} agent steps, {} episodes, {} updates.\n",
            counted("control_steps"),
            online["control_steps"],
            counted("agent_steps"),
            counted("episodes"),
            counted("update")
        ),
    );
    push(&mut page, "| quantity, mean of the last round's updates | value |\n|---|---|");
    for name in
        ["training_return", "critic_loss", "auxiliary_loss", "target", "target_over_bound", "entropy", "temperature"]
    {
        if let Some(value) = last(name) {
            push(&mut page, &format!("| {} | {value:.3} |", name.replace('_', " ")));
        }
    }
    returns(&mut page, evaluations);
    page
}

/// The line that names a protocol, and says whether its last evaluation is among those below.
fn under(protocol: &str, evaluations: &[Json]) -> String {
    let is_over = evaluations.last().is_some_and(|last| last["is_final"] == true && last["protocol"] == protocol);
    let state = if is_over {
        "its last evaluation is the last one below"
    } else {
        "not over: none of the returns below is its result"
    };
    let videos = evaluations.iter().find_map(|line| line["videos"].as_str());
    let videos = videos.map_or_else(String::new, |videos| format!(", videos {videos}"));
    format!("* protocol {protocol}{videos}; {state}")
}

/// Mean returns of whole episodes over control steps.
fn returns(page: &mut String, evaluations: &[Json]) {
    if evaluations.is_empty() {
        return;
    }
    // Where nobody sees a video, both sets are the same episodes.
    let are_seen = evaluations.iter().any(|line| line["held_out"] != line["training_videos"]);
    let (columns, rule) = if are_seen {
        ("episodes of each set | held-out videos | training videos", "---|---|---|---|")
    } else {
        ("episodes | return", "---|---|---|")
    };
    push(page, &format!("\n## Mean return [95 % interval]\n\n| control steps | {columns} |\n|{rule}"));
    for index in shown(evaluations.len()) {
        let line = &evaluations[index];
        let cell = |set: &str| {
            let found = &line[set];
            let Some(mean) = found["mean_return"].as_f64() else { return "–".to_owned() };
            let ends = ["/interval/0", "/interval/1"].map(|end| found.pointer(end).and_then(Json::as_f64));
            match ends {
                [Some(low), Some(high)] => format!("{mean:.1} [{low:.1}, {high:.1}]"),
                _ => format!("{mean:.1}"),
            }
        };
        let sets: &[&str] = if are_seen { &["held_out", "training_videos"] } else { &["held_out"] };
        let cells: Vec<String> = sets.iter().map(|set| cell(set)).collect();
        let episodes =
            line["held_out"]["returns"].as_array().map_or("–".to_owned(), |returns| returns.len().to_string());
        // The last evaluation of a run, or of one that went on later, has starts of its own.
        let starts = if line["is_final"] == true { ", of other starts" } else { "" };
        push(page, &format!("| {} | {episodes}{starts} | {} |", line["control_steps"], cells.join(" | ")));
    }
    if evaluations.iter().any(|line| line["is_held_out"] == false) {
        push(
            page,
            "\nThe held-out videos are among those of the recordings it began with: these returns say nothing of new videos.",
        );
    }
}

/// What only online training has.
struct Lived<'a> {
    /// Control steps, those without an update beside them too.
    control_steps: Option<f64>,
    protocol: Option<&'a str>,
    /// What it began with and did not live through itself, in words.
    given: Option<String>,
}

/// The control steps of the recordings that an online run began with, in words.
pub fn given_in_words(steps: u64, is_from_run_file: bool) -> String {
    let counted = if is_from_run_file {
        " (of those that are gone as run.json has it, where every view of an episode counts)"
    } else {
        ""
    };
    format!("{steps} control steps of recordings and of runs before it{counted}")
}

/// The same from what lies on disk: of a run that was begun before it was kept, from its last evaluation.
fn given(online: &Json, evaluations: &[Json]) -> Option<String> {
    let known = [online].into_iter().chain(evaluations.last()).find(|line| line["given_control_steps"].is_u64())?;
    Some(given_in_words(known["given_control_steps"].as_u64()?, known["given_from"] == "run.json"))
}

/// The page.
fn summary(name: &str, info: &RunInfo, lived: &Lived<'_>, last: Option<&Row>, evaluations: &[Json]) -> String {
    let mut page = format!("# {name}\n\n");
    about(&mut page, info, lived);
    if let Some(protocol) = lived.protocol {
        push(&mut page, &under(protocol, evaluations));
    }
    if let Some(last) = last {
        progress(&mut page, info, last, lived.control_steps);
    }
    match evaluations.last() {
        // Online training evaluates whole episodes, offline training a grid.
        Some(last) if last.get("held_out").is_some() => returns(&mut page, evaluations),
        Some(last) => {
            held_out(&mut page, evaluations);
            probes(&mut page, last);
        }
        None => {}
    }
    page
}

fn about(page: &mut String, info: &RunInfo, lived: &Lived<'_>) {
    let (options, model) = (&info.options, &info.model);
    let recordings: Vec<String> = info.recording_names().iter().map(|name| format!("`{name}`")).collect();
    let from = info.from.as_ref().map_or(String::new(), |from| format!(", going on from `{from}`"));
    let versions: Vec<String> = info.versions.iter().map(|(name, version)| format!("{name} {version}")).collect();
    let lines = [
        format!("Objective **{}** on {} ({}){from}", options.objective, model.task, model.observation),
        match &lived.given {
            _ if !recordings.is_empty() => {
                format!("{} episodes, {} steps of {}", info.episodes, info.steps, recordings.join(", "))
            }
            Some(_) => "no recordings in its batches: its own episodes alone".to_owned(),
            None => "no recordings: its own episodes alone".to_owned(),
        },
        format!(
            "latent {} ({}), hidden {}, depth {}; batch {} × {} (burn-in {})",
            options.latent,
            model.latents,
            options.hidden,
            options.depth,
            options.batch,
            options.length,
            options.burn_in
        ),
        format!(
            "{}reward weight {}, step size {}{}{}, first scales {}",
            dynamics(options),
            options.reward_weight,
            options.lr,
            if model.adversary { format!(" and {} (adversary)", options.adversary_lr) } else { String::new() },
            if options.lr_decay > 0 { format!(", falling after {} updates", options.lr_decay) } else { String::new() },
            if options.calibrate { "set by data" } else { "as drawn" }
        ),
        format!("seed {}; {}", options.seed, versions.join(", ")),
    ];
    let began = lived.given.as_ref().map(|given| format!("began with {given}, which are not counted below"));
    lines.iter().chain(&began).for_each(|line| push(page, &format!("* {line}")));
}

/// How much of the dynamics term's gradient reaches the encoder and from when on, where any of it does.
fn dynamics(options: &Options) -> String {
    if !options.objective.dynamics_shape_latents() {
        return String::new();
    }
    let (weight, warmup) = (options.dynamics_weight, options.dynamics_warmup);
    match options.objective.gate(options) {
        Some(Condition { start, gain }) => format!(
            "dynamics weight {weight} (rising over {warmup} updates, from update {start} and a gain of {gain} nats on), "
        ),
        None => format!("dynamics weight {weight} (rising over {warmup} updates), "),
    }
}

fn progress(page: &mut String, info: &RunInfo, last: &Row, control_steps: Option<f64>) {
    // An online run goes by control steps.
    let made = match control_steps {
        Some(steps) => format!("{} updates, {steps} control steps", last.update),
        None => format!("{} of {} updates", last.update, info.options.updates),
    };
    push(page, &format!("\n## After {made}\n"));
    push(page, "| quantity, mean of the last updates | value |\n|---|---|");
    let mut row = |name: &str, value: Option<f64>| {
        if let Some(value) = value {
            push(page, &format!("| {name} | {value:.3} |"));
        }
    };
    row("log-likelihood of the next latent under the dynamics, nats", Some(last.dynamics_log_likelihood));
    row("… under the adversary, after its step", last.stated("adversary_log_likelihood"));
    row("adversary minus dynamics", last.stated("adversary_minus_dynamics"));
    row("share of clipped terms", last.stated("clipped_share"));
    row("log-likelihood of the reward, nats", Some(last.reward_log_likelihood));
    row("log-likelihood of the observation, up to a constant", last.stated("reconstruction_log_likelihood"));
    for term in REGISTRY {
        row(&term.metric().replace('_', " "), last.stated(term.metric()));
    }
    row("effective rank of a batch's latents", Some(last.batch_effective_rank));
    let most = if info.model.latents == LatentForm::UnitNorm { " (at most 1)" } else { "" };
    row(&format!("variance of the latents{most}"), Some(last.latent_variance));
    row("norm of the gradient", Some(last.gradient_norm));
    row("updates a second", Some(last.updates_per_second));
}

fn held_out(page: &mut String, evaluations: &[Json]) {
    const SHARES: [&str; 3] = ["state_share", "distractor_share", "interaction_share"];
    const RETRIEVALS: [&str; 2] = ["retrieval_same_step@1", "retrieval_any_step@1"];
    // As of the last one: its videos are those of the run all along.
    let are_known = evaluations.last().is_some_and(|last| last["videos_are_held_out"] == false);
    let videos = if are_known { " (its videos were trained under)" } else { "" };
    push(page, &format!("\n## On the held-out grid{videos}\n"));
    let names: Vec<&str> = RETRIEVALS.into_iter().chain(SHARES).collect();
    push(page, &format!("| updates | {} | reward gap, nats | dynamics gap, nats |", names.join(" | ")));
    push(page, &format!("|---|{}---|---|", "---|".repeat(names.len())));
    for index in shown(evaluations.len()) {
        let line = &evaluations[index];
        let cell = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.3}"));
        let numbers = names.iter().map(|name| cell(number(line, name, "/estimate")));
        let gaps = ["reward_gap", "dynamics_gap"].map(|gap| cell(line["gaps"][gap].as_f64()));
        let cells: Vec<String> = numbers.chain(gaps).collect();
        push(page, &format!("| {} | {} |", line["update"].as_u64().unwrap_or(0), cells.join(" | ")));
    }
    if shown(evaluations.len()).into_iter().any(|index| evaluations[index]["is_held_out"] == false) {
        push(page, "\nThe grid is among what the run was trained on: these numbers say nothing of new episodes.");
    }
    if are_known {
        push(
            page,
            "\nBackground videos of the grid are among those it was trained under: these numbers are of new states, not of new videos.",
        );
    }
    let last = evaluations.last().unwrap_or(&Json::Null);
    let of = |name: &str, what: &str| number(last, name, what).unwrap_or(f64::NAN);
    let beside = RETRIEVALS.map(|name| {
        format!(
            "{name} of past actions alone {:.3}, by chance {:.3}",
            of(name, "/past_actions/estimate"),
            of(name, "/chance")
        )
    });
    open_loop(page, last);
    push(
        page,
        &format!("\nState, distractor and interaction are shares of the latents' variance. {}.", beside.join("; ")),
    );
}

/// How well rewards are predicted from (h, s) some steps ahead without pictures.
fn open_loop(page: &mut String, last: &Json) {
    let row = |name: &str| {
        let cell = |ahead: &usize| number(last, &format!("{name}@{ahead}"), "/estimate");
        AHEAD
            .iter()
            .map(cell)
            .map(|value| value.map_or("–".to_owned(), |value| format!("{value:.3}")))
            .collect::<Vec<_>>()
    };
    let rows = [
        ("under the recorded actions", row("open_loop_reward_r2")),
        ("under shuffled actions", row("open_loop_reward_r2_shuffled")),
        ("as the reward of now (persistence)", row("open_loop_reward_r2_persistence")),
    ];
    let heads = AHEAD.map(|ahead| format!("{ahead} steps")).join(" | ");
    push(page, &format!("\n| reward predicted open loop (R²) | {heads} |"));
    push(page, &format!("|---|{}", "---|".repeat(AHEAD.len())));
    for (name, values) in rows {
        push(page, &format!("| {name} | {} |", values.join(" | ")));
    }
}

/// A part of a number of an evaluation, as in `/estimate` of `state_share`.
fn number(line: &Json, name: &str, part: &str) -> Option<f64> {
    line["numbers"].get(name)?.pointer(part)?.as_f64()
}

fn probes(page: &mut String, last: &Json) {
    let numbers = last["numbers"].as_object();
    let families = [Fitting::OtherRecordings, Fitting::CrossValidation].map(|fit| probe_family(Probe::Linear, fit));
    let of_s = |name: &&String| {
        name.split('/').next().is_some_and(|family| families.contains(&family)) && name.ends_with("/s")
    };
    let names: Vec<String> = numbers.into_iter().flat_map(|numbers| numbers.keys()).filter(of_s).cloned().collect();
    push(
        page,
        "\n| read from the latent by a linear probe (R²; accuracy of classes) | latents | past actions | chance |",
    );
    push(page, "|---|---|---|---|");
    let (colors, single): (Vec<String>, Vec<String>) = names.into_iter().partition(|name| is_color(name));
    for name in &single {
        let kind = last["quantities"][quantity(name)].as_str().unwrap_or("");
        push(page, &format!("| {kind}: `{name}` | {} |", values(last, std::slice::from_ref(name))));
    }
    if !colors.is_empty() {
        push(page, &format!("| distractor: colours, mean of {} | {} |", colors.len(), values(last, &colors)));
    }
}

/// The quantity that a probe's number is of, as in `probe/QUANTITY/s`.
fn quantity(name: &str) -> &str {
    let behind = name.split_once('/').map_or(name, |(_, behind)| behind);
    behind.rsplit_once('/').map_or(behind, |(quantity, _)| quantity)
}

/// Whether the number is of one of the many quantities of the materials' colours.
fn is_color(name: &str) -> bool {
    [" red", " green", " blue"].iter().any(|channel| quantity(name).ends_with(channel))
}

/// Means over quantities, as cells of a table.
fn values(last: &Json, names: &[String]) -> String {
    let mean = |part: &str| {
        let of = |name: &String| number(last, name, part);
        names.iter().filter_map(of).sum::<f64>() / names.len().max(1) as f64
    };
    ["/estimate", "/past_actions/estimate", "/chance"].map(|part| format!("{:.3}", mean(part))).join(" | ")
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
