//! How training is shown: a bar with rate and estimate on a terminal, plain lines otherwise.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use vibes_train::evaluate::Took;
use vibes_train::fit::{Evaluation, Event};
use vibes_train::metrics::Row;
use vibes_train::options::Options;
use vibes_train::run::Run;

use self::bar::{bar, begin_at};
use super::Context;
use super::evaluate::gap_note;

pub(super) mod bar;

/// Time between plain lines.
const PLAIN_EVERY: Duration = Duration::from_secs(15);

/// What is told of an evaluation on the way. Rewards ahead are left out where no episode has room for them.
const TOLD: [&str; 7] = [
    "retrieval_same_step@1",
    "state_share",
    "distractor_share",
    "interaction_share",
    "open_loop_reward_r2@10",
    "open_loop_reward_r2_shuffled@10",
    "open_loop_reward_r2_persistence@10",
];

/// That the recordings of a run that is gone on with are no longer what they were.
pub(crate) fn other_steps(run: &Run) -> Option<String> {
    let (info, (episodes, steps)) = (run.info(), run.held_before()?);
    Some(format!(
        "its recordings hold {} episodes of {} steps, and held {episodes} of {steps} when it was trained before: batches are drawn from what is there now",
        info.episodes, info.steps
    ))
}

pub(crate) struct Progress {
    quiet: bool,
    verbose: bool,
    minutes: f64,
    updates: u64,
    bar: Option<ProgressBar>,
    /// Whether the bar has been set to where training began.
    has_begun: bool,
    told: Option<Instant>,
}

impl Progress {
    pub(crate) fn new(context: &Context, options: &Options) -> Self {
        let terminal = std::io::stderr().is_terminal() && !context.quiet;
        let bar = terminal.then(|| bar_of(options));
        Self {
            quiet: context.quiet,
            verbose: context.verbose,
            minutes: options.minutes,
            updates: options.updates,
            bar,
            has_begun: false,
            told: None,
        }
    }

    /// What is about to be trained, on what.
    pub(crate) fn describe(&self, run: &Run) {
        let info = run.info();
        let (model, options) = (&info.model, &info.options);
        self.say(&format!(
            "{} on {} ({}), {} episodes, {} steps; batch {} × {}; into {}",
            options.objective,
            model.task,
            model.observation,
            info.episodes,
            info.steps,
            options.batch,
            options.length,
            run.path().display()
        ));
        if let Some(text) = other_steps(run) {
            self.say(&text);
        }
    }

    pub(crate) fn show(&mut self, event: &Event<'_>) {
        match event {
            Event::Start { update: 0 } | Event::Windows { .. } | Event::Judging => {}
            Event::Start { update } => self.say(&format!("going on after {update} updates")),
            Event::Update { update, seconds } => self.move_bar(*update, *seconds),
            Event::Metrics(row) => self.metrics(row),
            Event::Evaluating { grid } => self.say(&format!("evaluating on {}", grid.display())),
            Event::Evaluated { evaluation, took } => self.evaluated(evaluation, *took),
            Event::Saved { update } if self.verbose => self.say(&format!("saved checkpoint {update}")),
            Event::Saved { .. } => {}
        }
    }

    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    fn move_bar(&mut self, update: u64, seconds: f64) {
        let Some(bar) = &self.bar else { return };
        let position = if self.minutes > 0.0 { seconds as u64 } else { update };
        if self.has_begun {
            bar.set_position(position);
        } else {
            // The first update of this process, which may go on with another's.
            begin_at(bar, position);
            self.has_begun = true;
        }
    }

    fn evaluated(&self, evaluation: &Evaluation, took: Took) {
        self.say(&format!("{}; took {}", held_out(evaluation), took.in_words()));
        let note = evaluation.gaps.as_ref().and_then(|gaps| gap_note([gaps.dynamics_gap, gaps.reward_gap]));
        if let Some(note) = note {
            self.say(note);
        }
    }

    fn metrics(&mut self, row: &Row) {
        let line = summary(row);
        if let Some(bar) = &self.bar {
            bar.set_message(line);
            return;
        }
        let due = self.told.is_none_or(|told| told.elapsed() >= PLAIN_EVERY);
        if due || self.verbose || row.update == self.updates {
            self.told = Some(Instant::now());
            self.say(&format!("{} of {} updates, {:.1}/s: {line}", row.update, self.updates, row.updates_per_second));
        }
    }

    fn say(&self, line: &str) {
        match &self.bar {
            _ if self.quiet => {}
            Some(bar) => bar.println(line),
            None => eprintln!("{line}"),
        }
    }
}

fn summary(row: &Row) -> String {
    let ahead = row.stated("adversary_minus_dynamics");
    let ahead = ahead.map_or(String::new(), |nats| format!(", adversary ahead by {nats:.2}"));
    format!(
        "dynamics {:.2}{ahead}, reward {:.3}, rank {:.1}, variance {:.3}",
        row.dynamics_log_likelihood, row.reward_log_likelihood, row.batch_effective_rank, row.latent_variance
    )
}

fn held_out(evaluation: &Evaluation) -> String {
    let gaps = evaluation.gaps.map_or(String::new(), |gaps| {
        format!("; gaps reward {:+.2}, dynamics {:+.2} nats", gaps.reward_gap, gaps.dynamics_gap)
    });
    let numbers = &evaluation.report.numbers;
    let told = TOLD.iter().filter_map(|name| Some(format!("{name} {:.2}", numbers.get(name)?.value.estimate)));
    let grid = match (evaluation.is_held_out, evaluation.videos_are_held_out) {
        (Some(false), _) => "grid that was trained on",
        (_, Some(false)) => "held-out grid (its videos were trained under)",
        _ => "held-out grid",
    };
    format!("{grid}: {}{gaps}", told.collect::<Vec<_>>().join(", "))
}

fn bar_of(options: &Options) -> ProgressBar {
    let is_timed = options.minutes > 0.0;
    if is_timed { bar((options.minutes * 60.0) as u64, "s") } else { bar(options.updates, "updates") }
}
