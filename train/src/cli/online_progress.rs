//! How online training is shown: a bar over control steps on a terminal, plain lines otherwise.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use vibes_train::online::evaluate::Evaluation;
use vibes_train::online::options::OnlineOptions;
use vibes_train::online::prepare::Prepared;
use vibes_train::online::{Event, Line};

use self::first::First;
use super::Context;
use super::progress::bar::{bar, begin_at};
use super::progress::other_steps;

mod first;

/// Time between plain lines.
const PLAIN_EVERY: Duration = Duration::from_secs(15);

pub(crate) struct OnlineProgress {
    is_quiet: bool,
    is_verbose: bool,
    control_steps: u64,
    /// The updates before the next episode, of which the clock of control steps knows nothing.
    first: First,
    bar: Option<ProgressBar>,
    said: Option<Instant>,
}

impl OnlineProgress {
    pub(crate) fn new(context: &Context, options: &OnlineOptions) -> Self {
        let is_terminal = std::io::stderr().is_terminal() && !context.quiet;
        let bar = is_terminal.then(|| bar(options.control_steps, "control steps"));
        let (is_quiet, is_verbose) = (context.quiet, context.verbose);
        let first = First::of(options);
        Self { is_quiet, is_verbose, control_steps: options.control_steps, first, bar, said: None }
    }

    /// What is about to be trained, in what.
    pub(crate) fn describe(&mut self, prepared: &Prepared) {
        self.first.go_on(&prepared.run);
        let (info, options) = (prepared.run.info(), &prepared.options);
        let given = match prepared.given.len() {
            0 => String::new(),
            count => format!(
                ", {:.0} % of every batch from {count} recordings of {} steps",
                options.given_share * 100.0,
                info.steps
            ),
        };
        self.say(&format!(
            "{} online on {} ({}), distractors {}{}, {} rows per agent step{given}; into {}",
            info.options.objective,
            info.model.task,
            info.model.observation,
            options.world.distractors.axes,
            under(options),
            options.rows_per_step,
            prepared.run.path().display()
        ));
        prepared.notes().iter().for_each(|note| self.say(note));
        if let Some(text) = other_steps(&prepared.run) {
            self.say(&text);
        }
        let (critic, updates) = (
            options.critic_first,
            options.fewest_updates(info.options.length * info.options.batch, !prepared.given.is_empty()),
        );
        if critic >= updates {
            self.say(&format!(
                "the actor will not move for {critic} updates (--critic-first), and about {updates} are made {}",
                options.where_fewest()
            ));
        }
    }

    pub(crate) fn show(&mut self, event: &Event<'_>) {
        match event {
            Event::Start { control_steps: 0 } | Event::Update | Event::Judged => {}
            Event::Start { control_steps } => {
                self.begin_bar(*control_steps);
                self.say(&format!("going on after {control_steps} control steps"));
            }
            Event::Lived { control_steps, .. } => {
                if let Some(bar) = &self.bar {
                    bar.set_position(*control_steps);
                }
            }
            Event::Reset { control_steps, updates } => {
                self.first.reset(*updates);
                self.say(&format!(
                    "world model, actor and critic begin anew after {control_steps} control steps, with {updates} updates before the next episode"
                ));
            }
            Event::Metrics(line) => self.metrics(line),
            Event::Evaluated(evaluation) => self.say(&evaluated(evaluation)),
            Event::Saved { update } if self.is_verbose => self.say(&format!("saved checkpoint {update}")),
            Event::Saved { .. } => {}
        }
    }

    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    fn metrics(&mut self, line: &Line) {
        let first = self.first.after(line);
        if first.is_some() {
            // Random episodes, and these updates, say nothing of how long the actor's take.
            self.begin_bar(line.control_steps);
        }
        let text = first.map_or_else(|| summary(line), |first| first + &learned(line));
        if let Some(bar) = &self.bar {
            bar.set_message(text);
        } else if self.is_verbose || self.said.is_none_or(|said| said.elapsed() >= PLAIN_EVERY) {
            self.said = Some(Instant::now());
            self.say(&format!("{} of {} control steps: {text}", line.control_steps, self.control_steps));
        }
    }

    fn begin_bar(&self, control_steps: u64) {
        if let Some(bar) = &self.bar {
            begin_at(bar, control_steps);
        }
    }

    fn say(&self, line: &str) {
        match &self.bar {
            _ if self.is_quiet => {}
            Some(bar) => bar.println(line),
            None => eprintln!("{line}"),
        }
    }
}

/// `, under PROTOCOL (videos procedural)` where a run is under one.
pub(crate) fn under(options: &OnlineOptions) -> String {
    let videos = options.world.videos.name();
    options.protocol.map_or_else(String::new, |protocol| format!(", under {protocol} (videos {videos})"))
}

/// The same of a run that has come to an end or to a stop: whether its last evaluation is the protocol's.
pub(crate) fn ended_under(options: &OnlineOptions, last: Option<&serde_json::Value>) -> String {
    let Some(protocol) = options.protocol else { return String::new() };
    if protocol_of(last) == Some(protocol.to_string().as_str()) {
        return under(options);
    }
    format!(", with no result under {protocol} yet")
}

/// ` on held-out videos` where an evaluation is: where nobody sees a video, the returns of the two sets are those of the same episodes.
pub(crate) fn on_videos(evaluation: &serde_json::Value) -> &'static str {
    // Lines of older runs have no gap.
    let has_videos = !evaluation["gap"].is_null() || evaluation["held_out"] != evaluation["training_videos"];
    on(has_videos, evaluation["is_held_out"] != false)
}

/// The same where it is known whether videos are seen, and whether those held out are new to the run.
pub(crate) fn on(has_videos: bool, is_held_out: bool) -> &'static str {
    match (has_videos, is_held_out) {
        (false, _) => "",
        (true, true) => " on held-out videos",
        (true, false) => " on videos that are in its recordings",
    }
}

/// The protocol that the last evaluation of a run is one of; none of one that was made on the way, or before its control steps were lived through.
pub(crate) fn protocol_of(last: Option<&serde_json::Value>) -> Option<&str> {
    last.filter(|line| line["is_final"] == true)?["protocol"].as_str()
}

fn summary(line: &Line) -> String {
    let returned = line.training_return.map_or(String::new(), |returned| format!(", return {returned:.1}"));
    let pace =
        line.pace.map_or(String::new(), |pace| format!(", {:.0} control steps/s", pace.control_steps_per_second));
    format!("{} agent steps{pace}{returned}{}", line.agent_steps, learned(line))
}

/// What was learned, behind what else is said of a line.
fn learned(line: &Line) -> String {
    line.learned.as_ref().map_or(String::new(), |learned| {
        format!(
            ", imagined {:.1}, value/bound {:.2}, entropy {:.2}, dynamics {:.1}, reward {:.2}, rank {:.1}",
            learned.imagined_return,
            learned.value_over_bound,
            learned.entropy,
            learned.world.dynamics_log_likelihood,
            learned.world.reward_log_likelihood,
            learned.world.batch_effective_rank,
        )
    })
}

fn evaluated(evaluation: &Evaluation) -> String {
    let interval =
        |interval: Option<[f64; 2]>| interval.map_or(String::new(), |[low, high]| format!(" [{low:.1}, {high:.1}]"));
    let held_out = &evaluation.held_out;
    let training = &evaluation.training_videos;
    let gap =
        evaluation.gap.as_ref().map_or(String::new(), |gap| format!(", gap {:.1}{}", gap.mean, interval(gap.interval)));
    // Without a gap nobody sees a video, and the two sets are one.
    let has_videos = evaluation.gap.is_some();
    let on = on(has_videos, evaluation.is_held_out != Some(false));
    let training = format!(", training videos {:.1}{}{gap}", training.mean_return, interval(training.interval));
    let training = if has_videos { training } else { String::new() };
    format!(
        "after {} control steps ({} agent steps): mean return{on} {:.1}{} of {} episodes{training}",
        evaluation.counters.control_steps,
        evaluation.counters.agent_steps,
        held_out.mean_return,
        interval(held_out.interval),
        held_out.returns.len()
    )
}

#[cfg(test)]
mod tests {
    use vibes_train::online::prepare::{default_options, default_world};
    use vibes_train::online::protocol::Protocol;

    use super::*;

    #[test]
    fn a_protocol_is_named_at_the_start_and_as_a_result_once_there_is_one() {
        let mut options = default_options(default_world("cartpole-swingup").unwrap(), false);
        assert_eq!((under(&options), ended_under(&options, None)), (String::new(), String::new()));
        options.settle(Protocol::DcsEasyDynamic500k);
        let named = ", under dcs-easy-dynamic-500k (videos procedural)";
        assert_eq!(under(&options), named);
        let line = |is_final: bool| serde_json::json!({ "is_final": is_final, "protocol": "dcs-easy-dynamic-500k" });
        assert_eq!(ended_under(&options, Some(&line(true))), named);
        for last in [None, Some(line(false))] {
            let said = ended_under(&options, last.as_ref());
            assert_eq!(said, ", with no result under dcs-easy-dynamic-500k yet");
        }
    }

    #[test]
    fn videos_that_were_seen_are_not_called_held_out() {
        let line = |told: serde_json::Value| serde_json::json!({ "held_out": 1, "training_videos": 1, "gap": {}, "is_held_out": told });
        assert_eq!(on_videos(&line(().into())), " on held-out videos");
        assert_eq!(on_videos(&line(false.into())), " on videos that are in its recordings");
    }
}
