//! Draws until a time is over, on all cores, in both looks, with another video frame uploaded for every picture: what once crashed inside Mesa.
//!
//! `make stress DURATION=30m`, or `stress SECONDS`. Every round of about 20 seconds is a process of its own, since a crash was as likely while
//! contexts open and close as in between. A round that does not end by itself with success ends the whole with exit code 1 and says which it was.

#![allow(clippy::print_stdout, reason = "a program for the command line")]

use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use vibes_env::distractors::DistractorSettings;
use vibes_env::render::{Look, RenderSettings, SpeedTrial};
use vibes_env::videos::{VideoLibrary, VideoSet, VideoSource};
use vibes_env::{Environment, EnvironmentOptions, example_tasks};

/// Seconds of a round.
const ROUND: f64 = 20.0;
/// Pictures a thread draws with one context before it opens the next.
const PICTURES: usize = 200;
const SIZE: usize = 64;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    let outcome = match arguments.as_slice() {
        [_, seconds] => {
            seconds.parse().map_err(|_error| usage()).and_then(|seconds| stress(Duration::from_secs(seconds)))
        }
        [_, round, look, first] if round == "round" => draw_for_a_round(look, first),
        _ => Err(usage()),
    };
    match outcome {
        Ok(said) => {
            println!("{said}");
            ExitCode::SUCCESS
        }
        Err(fault) => {
            println!("stress: {fault}");
            ExitCode::FAILURE
        }
    }
}

fn usage() -> String {
    "usage: stress SECONDS".to_owned()
}

/// Rounds in processes of their own, until the time is over.
fn stress(duration: Duration) -> Result<String, String> {
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    let (begin, mut rounds, mut pictures) = (Instant::now(), 0_usize, 0_u64);
    while begin.elapsed() < duration {
        let look = if rounds % 2 == 0 { "fast" } else { "suite" };
        let output =
            Command::new(&own).args(["round", look, &rounds.to_string()]).output().map_err(|e| e.to_string())?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            return Err(format!("round {rounds} ({look}) ended with {}: {said}", output.status));
        }
        let drawn = String::from_utf8_lossy(&output.stdout);
        pictures += drawn.trim().parse::<u64>().map_err(|_error| format!("round {rounds} said {drawn}"))?;
        rounds += 1;
        if rounds.is_multiple_of(30) {
            println!(
                "{:.0} minutes, {rounds} rounds, {pictures} pictures, no crash",
                begin.elapsed().as_secs_f64() / 60.0
            );
        }
    }
    let hours = begin.elapsed().as_secs_f64() / 3600.0;
    Ok(format!("no crash in {hours:.2} hours: {rounds} rounds, {pictures} pictures with an upload each"))
}

/// Draws one task after the other with all cores; answers with the number of pictures.
fn draw_for_a_round(look: &str, first: &str) -> Result<String, String> {
    let look: Look = look.parse().map_err(|error: vibes_env::Error| error.to_string())?;
    let first: usize = first.parse().map_err(|_error| usage())?;
    let tasks = example_tasks();
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    let source = VideoSource::Procedural;
    let said = |error: vibes_env::Error| error.to_string();
    let names = source.list(VideoSet::Train, Some(4)).map_err(said)?;
    let videos = VideoLibrary::open(&source, VideoSet::Train, &names, look.sky_side(SIZE)).map_err(said)?;
    let (begin, mut pictures) = (Instant::now(), 0);
    for place in first.. {
        if begin.elapsed().as_secs_f64() > ROUND {
            break;
        }
        let task = tasks[place % tasks.len()];
        let environment = Environment::new(task, EnvironmentOptions::default()).map_err(said)?;
        let trial = SpeedTrial {
            scenery: environment.scenery(),
            model: environment.physics().model(),
            settings: RenderSettings { size: SIZE, look },
            distractors: Some(DistractorSettings::default()),
            videos: &videos,
            action_repeat: 1,
            physics_steps: 1,
            pictures: PICTURES,
            threads,
            separate_stages: false,
            is_empty: false,
        };
        pictures += trial.run().map_err(said)?.pictures;
    }
    Ok(pictures.to_string())
}
