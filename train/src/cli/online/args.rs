//! The options of online training as they are typed, laid over those that were there.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use vibes_data::{MOST_ACTION_REPEAT, MOST_STEPS};
use vibes_env::distractors::{Axes, Difficulty};
use vibes_env::render::Look;
use vibes_env::videos::{MOST_VIDEOS, VideoSource};
use vibes_train::learners::behaviour::{BehaviourOptions, Gradient};
use vibes_train::online::options::OnlineOptions;

/// How much is lived through and learned.
#[derive(Debug, Args)]
#[command(next_help_heading = "Work")]
pub(super) struct WorkArgs {
    /// Control steps to act for in all, every step of an action repeat counted [default: 500000].
    #[arg(long, value_name = "N")]
    control_steps: Option<u64>,
    /// Replayed rows that the world model learns from for every agent step: the one number that sets how much is computed [default: 128].
    #[arg(long, value_name = "X")]
    rows_per_step: Option<f64>,
    /// Random episodes at the beginning [default: 5, or 0 with recordings].
    #[arg(long, value_name = "N")]
    prefill: Option<u32>,
    /// Share of every batch from the recordings of RUN [default: 0.5].
    #[arg(long, value_name = "X")]
    given_share: Option<f64>,
    /// Updates before the first episode with the actor [default: 200, or 1000 with recordings].
    #[arg(long, value_name = "N")]
    first_updates: Option<u64>,
    /// Updates at the beginning in which the critic learns and the actor does not move [default: 100, or 500 with recordings].
    #[arg(long, value_name = "N")]
    critic_first: Option<u64>,
    /// Imagined steps of the first updates [default: --horizon].
    #[arg(long, value_name = "N", requires = "short_for")]
    short_horizon: Option<usize>,
    /// Updates that imagine --short-horizon steps.
    #[arg(long, value_name = "N", requires = "short_horizon")]
    short_for: Option<u64>,
    /// Control steps, with commas between them, after each of which world model, actor and critic begin anew with new weights on all that was lived through: against a model
    /// that has learned its first episodes by heart, as happens where a run begins from nothing. It comes at the end of the episode in which they are reached [default: never].
    #[arg(long, value_name = "N,…", value_delimiter = ',')]
    reset_at: Option<Vec<u64>>,
    /// Updates after each of these before the next episode [default: 4000].
    #[arg(long, value_name = "N", requires = "reset_at")]
    reset_updates: Option<u64>,
    /// Standard deviation of noise on executed actions, in units of −1..1 [default: 0.3].
    #[arg(long, value_name = "X")]
    exploration: Option<f64>,
    /// Control steps between evaluations [default: 10000].
    #[arg(long, value_name = "N")]
    evaluate_every: Option<u64>,
    /// Episodes of an evaluation, on held-out and on training videos each [default: 5].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    evaluation_episodes: Option<u32>,
    /// Episodes of the last evaluation [default: 20].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    final_episodes: Option<u32>,
    /// Evaluate samples of the actor rather than its mode.
    #[arg(long)]
    evaluate_samples: bool,
}

/// The world.
#[derive(Debug, Args)]
#[command(next_help_heading = "World")]
pub(super) struct WorldArgs {
    /// Which distractors: background, camera, color, or all, or none [default: all].
    #[arg(long, value_name = "LIST")]
    distract: Option<Axes>,
    /// How far the distractors go: easy, medium or hard [default: easy].
    #[arg(long)]
    difficulty: Option<Difficulty>,
    /// Distractors keep what they are at the start of the episode.
    #[arg(long = "static")]
    r#static: bool,
    /// Background videos, DIR/VIDEO/FRAME.jpg as in DAVIS, whose lists say what is held out; of other folders the first half is trained under and the second held out, of
    /// each the first --video-count [default: the built-in procedural videos].
    #[arg(long, value_name = "DIR")]
    videos: Option<PathBuf>,
    /// Number of videos [default: the suite's for the difficulty].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST_VIDEOS)))]
    video_count: Option<u16>,
    /// Side of the pictures, pixels [default: 64].
    #[arg(long, conflicts_with = "no_pixels", value_parser = clap::value_parser!(u32).range(10..=512))]
    size: Option<u32>,
    /// Act on vector observations; nothing is drawn.
    #[arg(long)]
    no_pixels: bool,
    /// The look of the pictures: fast, or suite, which agrees with the Distracting Control Suite to half a level of 255 on average [default: fast].
    #[arg(long, conflicts_with = "no_pixels")]
    render: Option<Look>,
    /// Control steps an action is held [default: the task's].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_ACTION_REPEAT)))]
    action_repeat: Option<u32>,
    /// Agent steps of an episode [default: 1000 control steps].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_STEPS)))]
    steps: Option<u32>,
}

/// Actor and critic.
#[derive(Debug, Args)]
#[command(next_help_heading = "Actor and critic")]
pub(super) struct BehaviourArgs {
    /// Values that the options below begin with: gaussian (tanh-normal actor, squared error), dreamer-v3 (bounded normal, two-hot critic) or mixed (bounded normal, squared
    /// error) [default: mixed].
    #[arg(long)]
    recipe: Option<String>,
    /// How the actor learns: dynamics or reinforce.
    #[arg(long, value_parser = parse_gradient)]
    gradient: Option<Gradient>,
    /// Imagined steps.
    #[arg(long, value_name = "N")]
    horizon: Option<usize>,
    /// Discount of an agent step.
    #[arg(long, value_name = "X")]
    discount: Option<f64>,
    /// Share of the longer return in a λ-return.
    #[arg(long, value_name = "X")]
    lambda: Option<f64>,
    /// Weight of the actor's entropy.
    #[arg(long, value_name = "X")]
    entropy: Option<f64>,
    /// Step size of the actor.
    #[arg(long, value_name = "X")]
    actor_lr: Option<f64>,
    /// Step size of the critic.
    #[arg(long, value_name = "X")]
    critic_lr: Option<f64>,
    /// Imagination starts from every Nth row of a window.
    #[arg(long, value_name = "N")]
    every_start: Option<usize>,
    /// Take from imagined rewards so many standard deviations over a few small reward heads, each of which learns from half the episodes: against an actor that goes where
    /// the reward model is too high because it has seen little there [default: 0, no guard].
    #[arg(long, value_name = "X")]
    guard: Option<f64>,
    /// Reward heads of the guard [default: 5].
    #[arg(long, value_name = "N")]
    guard_members: Option<usize>,
}

fn parse_gradient(text: &str) -> std::result::Result<Gradient, String> {
    match text {
        "dynamics" => Ok(Gradient::Dynamics),
        "reinforce" => Ok(Gradient::Reinforce),
        _ => Err("the gradients are dynamics and reinforce".to_owned()),
    }
}

/// Puts what was typed in the place of what was there.
fn put<T>(place: &mut T, typed: Option<T>) {
    if let Some(typed) = typed {
        *place = typed;
    }
}

impl WorkArgs {
    /// Whether the recordings of a run that is gone on from are learned from.
    pub(super) fn takes_recordings(&self) -> bool {
        self.given_share.is_none_or(|share| share > 0.0)
    }

    pub(super) fn lay_over(&self, options: &mut OnlineOptions) {
        put(&mut options.control_steps, self.control_steps);
        put(&mut options.rows_per_step, self.rows_per_step);
        put(&mut options.prefill, self.prefill);
        put(&mut options.given_share, self.given_share);
        put(&mut options.first_updates, self.first_updates);
        put(&mut options.critic_first, self.critic_first);
        put(&mut options.short_horizon, self.short_horizon);
        put(&mut options.short_for, self.short_for);
        if let Some(reset_at) = &self.reset_at {
            if options.reset_at.is_empty() {
                options.reset_updates = OnlineOptions::DEFAULT_RESET_UPDATES;
            }
            options.reset_at.clone_from(reset_at);
        }
        put(&mut options.reset_updates, self.reset_updates);
        put(&mut options.exploration, self.exploration);
        put(&mut options.evaluate_every, self.evaluate_every);
        put(&mut options.evaluation_episodes, self.evaluation_episodes);
        put(&mut options.final_episodes, self.final_episodes);
        put(&mut options.evaluate_mode, self.evaluate_samples.then_some(false));
    }
}

impl WorldArgs {
    pub(super) fn lay_over(&self, options: &mut OnlineOptions) {
        let world = &mut options.world;
        if self.no_pixels {
            world.draw_nothing();
        }
        put(&mut world.distractors.axes, self.distract);
        put(&mut world.distractors.difficulty, self.difficulty);
        put(&mut world.distractors.dynamic, self.r#static.then_some(false));
        put(&mut world.videos, self.videos.clone().map(VideoSource::Folder));
        put(&mut world.video_count, self.video_count.map(|count| Some(usize::from(count))));
        put(&mut world.size, self.size.map(Some));
        put(&mut world.look, self.render);
        if let Some(repeat) = self.action_repeat {
            world.action_repeat = repeat;
            world.steps = vibes_env::EPISODE_CONTROL_STEPS.div_ceil(repeat);
        }
        put(&mut world.steps, self.steps);
    }
}

impl BehaviourArgs {
    pub(super) fn lay_over(&self, options: &mut BehaviourOptions) -> Result<()> {
        if let Some(recipe) = &self.recipe {
            *options = BehaviourOptions::recipe(recipe)?;
        }
        put(&mut options.gradient, self.gradient);
        put(&mut options.horizon, self.horizon);
        put(&mut options.discount, self.discount);
        put(&mut options.lambda, self.lambda);
        put(&mut options.entropy, self.entropy);
        put(&mut options.actor_lr, self.actor_lr);
        put(&mut options.critic_lr, self.critic_lr);
        put(&mut options.every_start, self.every_start);
        put(&mut options.guard, self.guard);
        put(&mut options.guard_members, self.guard_members);
        Ok(())
    }
}
