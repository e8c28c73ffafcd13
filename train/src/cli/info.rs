//! `vibes-train info`: what a run holds and how far it got.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use vibes_data::{GivenFrom, Metrics};
use vibes_train::metrics::{Row, rows_of};
use vibes_train::online::model_free::folder::Folder;
use vibes_train::online::options::OnlineOptions;
use vibes_train::run::Run;
use vibes_train::summary::given_in_words;
use vibes_train::trained::TrainedRun;

use super::Context;
use super::online_progress::on_videos;

#[derive(Debug, Args)]
pub(crate) struct InfoArgs {
    /// A run folder.
    run: PathBuf,
}

pub(crate) fn run(context: &Context, args: &InfoArgs) -> Result<()> {
    match TrainedRun::open(&args.run)? {
        TrainedRun::World(run) => of_world_model(context, &run),
        TrainedRun::ModelFree(folder) => of_model_free(context, &folder),
    }
}

fn of_world_model(context: &Context, run: &Run) -> Result<()> {
    let metrics = Metrics::read(&run.metrics_path())?;
    let [control_steps, episodes, training_return] =
        ["control_steps", "episodes", "training_return"].map(|name| metrics.last(name));
    let rows = rows_of(metrics, &run.metrics_path())?;
    let evaluation = Metrics::read(&run.evaluations_path())?.lines.pop().map(serde_json::Value::Object);
    let (checkpoints, online) = (run.checkpoints(), OnlineOptions::read(run.path())?);
    if context.json {
        let last = rows.last();
        println!(
            "{}",
            serde_json::json!({ "run": run.path(), "info": run.info(), "online": online, "checkpoints": checkpoints, "last": last, "control_steps": control_steps, "episodes": episodes, "training_return": training_return, "evaluation": evaluation, "goes_on_from": goes_on_from(last, &checkpoints) })
        );
        return Ok(());
    }
    let (info, options) = (run.info(), &run.info().options);
    println!("{}", run.path().display());
    let shaped = options.objective.dynamics_shape_latents();
    let weight = if shaped { format!(" (dynamics weight {})", options.dynamics_weight) } else { String::new() };
    println!("  objective    {}{weight}", options.objective);
    println!(
        "  model        {}, {}, latent {} ({}), depth {}, hidden {}",
        info.model.task, info.model.observation, options.latent, info.model.latents, options.depth, options.hidden
    );
    let names = info.recording_names();
    if !names.is_empty() {
        println!("  recordings   {} ({} episodes, {} steps)", names.join(", "), info.episodes, info.steps);
    }
    println!("  checkpoints  {}", checkpoints.iter().map(u64::to_string).collect::<Vec<_>>().join(", "));
    if let Some(online) = &online {
        print_online(online);
    }
    if let Some(given) = began_with(run) {
        println!("  began with   {given}");
    }
    if let Some(last) = rows.last() {
        print_row(last, options.updates, control_steps);
    }
    if let Some(online) = &online {
        print_lived(online, [control_steps, episodes, training_return]);
    }
    if let Some(evaluation) = &evaluation {
        print_evaluation(evaluation);
    }
    if let Some(checkpoint) = goes_on_from(rows.last(), &checkpoints) {
        println!("  goes on      from checkpoint {checkpoint}: the updates after it are not saved");
    }
    Ok(())
}

/// The checkpoint that a run goes on from which has made more updates than it saved, as where it was killed or is at work; 0 is its beginning.
fn goes_on_from(last: Option<&Row>, checkpoints: &[u64]) -> Option<u64> {
    let newest = checkpoints.last().copied().unwrap_or(0);
    last.filter(|last| last.update > newest).map(|_beyond| newest)
}

/// How far an online run has come.
fn print_lived(options: &OnlineOptions, [control_steps, episodes, training_return]: [Option<f64>; 3]) {
    let (steps, episodes) = (control_steps.unwrap_or(0.0), episodes.unwrap_or(0.0));
    println!("  lived        {steps:.0} of {} control steps, {episodes:.0} episodes", options.control_steps);
    if let Some(last) = training_return {
        println!("  return       {last:.1} of its last own episode, exploration included");
    }
}

/// The last evaluation: of whole episodes online, of a grid offline.
fn print_evaluation(line: &serde_json::Value) {
    if let Some(mean) = line["held_out"]["mean_return"].as_f64() {
        let after =
            line["control_steps"].as_u64().map_or_else(String::new, |steps| format!(", after {steps} control steps"));
        println!("  evaluation   mean return{} {mean:.1}{after}", on_videos(line));
    } else if let Some(update) = line["update"].as_u64() {
        let number = |name: &str| Some(format!("{name} {:.2}", line["numbers"][name]["estimate"].as_f64()?));
        let told: Vec<String> =
            ["retrieval_same_step@1", "state_share", "distractor_share"].into_iter().filter_map(number).collect();
        println!("  evaluation   after {update} updates: {}", told.join(", "));
    }
}

/// What a kept copy says of its beginning in `run.json`, in words.
fn began_with(run: &Run) -> Option<String> {
    let start = run.info().began_with?;
    Some(given_in_words(start.given_control_steps?, start.given_from == GivenFrom::RunFile))
}

fn print_online(options: &OnlineOptions) {
    if let Some(protocol) = options.protocol {
        println!("  protocol     {protocol}, videos {}", options.world.videos.name());
    }
    if let Some(given) = options.given_in_words() {
        println!("  began with   {given}, which are not counted");
    }
    if !options.held_out_seen.is_empty() {
        println!("  not held out {}, seen in its recordings", options.held_out_seen.join(", "));
    }
}

fn of_model_free(context: &Context, folder: &Folder) -> Result<()> {
    let (places, options) = (folder.places(), folder.options());
    let metrics = Metrics::read(&places.metrics_path())?;
    let evaluations = Metrics::read(&places.evaluations_path())?;
    let (checkpoints, last, evaluation) = (places.checkpoints(), metrics.lines.last(), evaluations.lines.last());
    if context.json {
        println!(
            "{}",
            serde_json::json!({ "run": folder.path(), "info": options, "checkpoints": checkpoints, "last": last, "evaluation": evaluation })
        );
        return Ok(());
    }
    let world = &options.online.world;
    println!("{}", folder.path().display());
    println!("  system       {}, {}", options.system, options.size);
    println!("  world        {}, distractors {}, seed {}", world.task, world.distractors.axes, options.seed);
    print_online(&options.online);
    println!("  latents      {}", options.agent.latents());
    println!("  checkpoints  {}", checkpoints.iter().map(u64::to_string).collect::<Vec<_>>().join(", "));
    let number = |name: &str| metrics.last(name).unwrap_or(0.0);
    println!(
        "  lived        {:.0} of {} control steps, {:.0} episodes, {:.0} updates",
        number("control_steps"),
        options.online.control_steps,
        number("episodes"),
        number("update")
    );
    let line = evaluation.cloned().map(serde_json::Value::Object).unwrap_or_default();
    if let Some(mean) = line["held_out"]["mean_return"].as_f64() {
        println!("  return       {mean:.1} in the last evaluation{}", on_videos(&line));
    }
    Ok(())
}

fn print_row(row: &Row, updates: u64, control_steps: Option<f64>) {
    // An online run goes by control steps, some of them without an update beside them.
    let made = match control_steps {
        Some(steps) => format!("{} in {steps} control steps", row.update),
        None => format!("{} of {updates}", row.update),
    };
    println!(
        "  updates      {made}, {:.1} a second, {:.0} frames a second",
        row.updates_per_second, row.frames_per_second
    );
    let ahead = row.stated("adversary_minus_dynamics");
    let ahead = ahead.map_or(String::new(), |nats| format!(", adversary ahead by {nats:.3}"));
    println!(
        "  latents      log-likelihood under the dynamics {:.3} nats{ahead}; effective rank {:.1}",
        row.dynamics_log_likelihood, row.batch_effective_rank
    );
    println!("  reward       log-likelihood {:.3} nats", row.reward_log_likelihood);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_that_made_more_updates_than_it_saved_goes_on_from_its_checkpoint() {
        let row = |update: u64| Row { update, ..Row::default() };
        assert_eq!(goes_on_from(Some(&row(340)), &[100, 200]), Some(200));
        assert_eq!(goes_on_from(Some(&row(200)), &[100, 200]), None);
        assert_eq!(goes_on_from(Some(&row(20)), &[]), Some(0));
        assert_eq!(goes_on_from(None, &[]), None);
    }
}
