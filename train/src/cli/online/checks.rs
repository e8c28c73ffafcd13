//! What was typed and has no effect is an error: options of the other kind of agent, of distractors that are off, of a run that has them settled.

use std::path::Path;

use anyhow::Result;
use vibes_command::options_of;
use vibes_env::distractors::Axes;
use vibes_train::TrainError;
use vibes_train::online::options::OnlineOptions;
use vibes_train::options::Options;

use super::OnlineArgs;
use super::args::BehaviourArgs;
use crate::cli::flags::{OptionArgs, refuse};
use crate::cli::model_free::ModelFreeArgs;

impl OnlineArgs {
    /// That nothing was given that does not concern how this run begins.
    pub(super) fn check_beginning(&self, beginning: Beginning<'_>) -> Result<()> {
        match beginning {
            Beginning::Nothing => self.refuse(["given_share"], "without recordings (name a RUN that has some)")?,
            Beginning::Offline | Beginning::Again(_) => self.refuse(["preset"], "where a run is gone on from")?,
        }
        match (&self.output, beginning) {
            (Some(output), Beginning::Again(run)) if !vibes_data::is_same_place(output, run) => {
                self.refuse(["output"], "on an online run that is there: it goes on in its own folder")
            }
            _ => Ok(()),
        }
    }

    /// That what was given can be, as far as that is known without a world or a run: for a sweep, before anything of it is begun.
    pub(crate) fn check_typed(&self) -> Result<()> {
        if self.from.task.is_none() {
            // It lies over the options of a run, which may have yet to be made.
            return Ok(());
        }
        let model_free = self.model_free.named(self.system())?;
        if model_free.is_asked() {
            return model_free.picture_size().map(|_pixels| ());
        }
        self.check_beginning(Beginning::Nothing)?;
        check_same(&self.options.resolve()?, &Options::preset(self.options.preset())?, false)
    }

    /// That none of these options was given.
    pub(super) fn refuse<'a>(&self, options: impl IntoIterator<Item = &'a str>, why: &str) -> Result<()> {
        refuse(&self.given, options, why)
    }

    /// That nothing was given that this agent, or a world like this, does not look at.
    pub(super) fn check_given(&self, is_model_free: bool, options: &OnlineOptions) -> Result<()> {
        let of_other: Vec<String> = if is_model_free {
            let work = [
                "rows_per_step",
                "given_share",
                "first_updates",
                "critic_first",
                "short_horizon",
                "short_for",
                "reset_at",
                "reset_updates",
                "exploration",
            ];
            let work = work.into_iter().map(str::to_owned);
            let settled = |option: &String| option == "seed" || (option == "preset" && self.system().is_some());
            let model = options_of::<OptionArgs>().into_iter().filter(|option| !settled(option));
            model.chain(options_of::<BehaviourArgs>()).chain(work).collect()
        } else {
            options_of::<ModelFreeArgs>().into_iter().filter(|option| option != "agent").collect()
        };
        let agent = if is_model_free { "without a world model" } else { "with a world model (--agent dreamer)" };
        let axes = options.world.distractors.axes;
        let background: &[&str] = if axes.background { &[] } else { &["videos", "video_count"] };
        let any: &[&str] = if axes == Axes::NONE { &["difficulty", "static"] } else { &[] };
        self.refuse(of_other.iter().map(String::as_str), &format!("for an agent {agent}"))?;
        let unguarded: &[&str] = if options.behaviour.guard > 0.0 { &[] } else { &["guard_members"] };
        self.refuse(unguarded.iter().copied(), "without a guard (--guard)")?;
        let is_unseen = options.world.size.is_none();
        let unseen: &[&str] =
            if is_unseen { &["videos", "video_count", "difficulty", "static", "render"] } else { &[] };
        self.refuse(unseen.iter().copied(), "where nothing is drawn (--no-pixels)")?;
        let asked: &[&str] = if is_unseen && axes != Axes::NONE { &["distract"] } else { &[] };
        self.refuse(asked.iter().copied(), "where nothing is drawn (--no-pixels), but for --distract none")?;
        let never: &[&str] = if options.evaluate_every == 0 { &["evaluation_episodes"] } else { &[] };
        self.refuse(never.iter().copied(), "without evaluations on the way (--evaluate-every 0)")?;
        self.refuse([background, any].concat(), "without such distractors (--distract)")
    }
}

/// That the options differ from those that they were laid over in nothing that is not looked at. What merely says the same again may stand, and where a run begins from nothing what a
/// preset has: a config.toml that a preset wrote says all of its own, and not which preset that was. Of a run that was given its own `--updates` this is refused.
pub(super) fn check_same(asked: &Options, base: &Options, is_gone_on_from: bool) -> Result<()> {
    let online = "online, where control steps count and a line is a round";
    let settled = "where a run is gone on from: it has that settled";
    let is_other =
        |key: &str, differs: bool| differs && (is_gone_on_from || asked.first_changed(base, &[key]).is_some());
    let changed = [
        ("updates", is_other("updates", asked.updates != base.updates), online),
        ("log-every", is_other("log_every", asked.log_every != base.log_every), online),
        ("calibrate", is_gone_on_from && asked.calibrate != base.calibrate, settled),
        ("reward-scale", is_gone_on_from && asked.reward_scale != base.reward_scale, settled),
        ("reward-floor", is_gone_on_from && asked.reward_floor != base.reward_floor, settled),
    ];
    match changed.into_iter().find(|(_, is_changed, _)| *is_changed) {
        Some((option, _, why)) => {
            anyhow::bail!(TrainError::Options(format!("--{option} has no effect {why}; leave it out")))
        }
        None => Ok(()),
    }
}

/// How a run begins.
#[derive(Clone, Copy)]
pub(super) enum Beginning<'a> {
    /// From nothing.
    Nothing,
    /// On from an offline run, into a folder of its own.
    Offline,
    /// On with the run that is there.
    Again(&'a Path),
}
