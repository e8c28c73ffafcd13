//! Makes a recording larger: more rows, more columns, more episodes.
//!
//! In: a recording and how large it is to be. Out: the recording that the larger size would have made from the start, byte for byte, since every
//! trajectory's seed depends on the recording's seed and its own number alone. What is there is kept: states of known rows are not simulated again,
//! pictures not drawn again.
//!
//! New rows and episodes are added where the recording lies, after a new manifest that asks for them. New columns change the numbers of the old
//! episodes, so the larger recording is made beside the old one and takes its place in one step when it is whole.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use rustix::fs::{CWD, RenameFlags, renameat_with};
use vibes_data::{FolderLock, Grid, Manifest, Recording};

use crate::keys::SUBSET;
use crate::paths::rebase;
use crate::plan::RecordOptions;
use crate::played::check_files;
use crate::recorder::{PolicyMaker, Progress, RecordRun, Source, record};
use crate::sound::{unplanned, unplanned_in_words};
use crate::stored::{has_logs, options_of};
use crate::trained::{acted_by, as_named};
use crate::{Error, Result};
use vibes_env::PolicySpec;

/// How large a recording is to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// Rows and columns of a grid.
    Grid(Grid),
    /// Independent episodes.
    Episodes(u32),
}

impl Size {
    fn of(options: &RecordOptions) -> Self {
        options.grid.map_or(Self::Episodes(options.episodes), Self::Grid)
    }

    /// Number of episodes.
    pub fn episodes(self) -> u32 {
        match self {
            Self::Grid(grid) => grid.states * grid.distractors,
            Self::Episodes(count) => count,
        }
    }

    /// Number of state trajectories.
    fn states(self) -> u32 {
        match self {
            Self::Grid(grid) => grid.states,
            Self::Episodes(count) => count,
        }
    }

    fn holds(self, other: Self) -> bool {
        match (self, other) {
            (Self::Grid(large), Self::Grid(small)) => {
                large.states >= small.states && large.distractors >= small.distractors
            }
            (Self::Episodes(large), Self::Episodes(small)) => large >= small,
            _ => false,
        }
    }

    fn named(self) -> String {
        match self {
            Self::Grid(grid) => format!("a grid of {}x{}", grid.states, grid.distractors),
            Self::Episodes(count) => format!("{count} episodes"),
        }
    }
}

/// How it is done.
#[derive(Clone, Copy, Debug)]
pub struct ExtendRun<'a> {
    /// Worker threads.
    pub threads: usize,
    /// Set from outside to stop after the episodes at hand.
    pub stop: &'a AtomicBool,
}

/// Makes the recording at `path` as large as `size`. Stopped or killed, the same call goes on; until then the recording is what it was, or that and
/// some of the new episodes.
///
/// # Errors
/// [`Error::Shrinks`] for a smaller size, [`Error::NotAsPlanned`] for a recording that was put together, [`Error::Malformed`] for new columns where the working directory is in the
/// recording, and whatever recording may fail of.
pub fn extend(path: &Path, size: Size, run: ExtendRun<'_>, report: &(dyn Fn(Progress) + Sync)) -> Result<Recording> {
    let places = Places::of(path)?;
    places.recover()?;
    // Before there is anything to own, whether there is anything at all.
    Recording::open(path)?;
    let lock = FolderLock::acquire(path)?;
    let recording = Recording::open(path)?;
    let old = options_of(&recording)?;
    check(&recording, &old, size)?;
    if size.states() > Size::of(&old).states() {
        check_actors(&recording, &old)?;
    }
    let options = match size {
        Size::Grid(grid) => RecordOptions { grid: Some(grid), episodes: size.episodes(), ..old.clone() },
        Size::Episodes(episodes) => RecordOptions { episodes, ..old.clone() },
    };
    let is_wider = options.grid.map(|grid| grid.distractors) != old.grid.map(|grid| grid.distractors);
    if is_wider {
        places.check_outside()?;
    }
    let source = if is_wider { Source::Grid(&recording) } else { Source::Itself(&recording) };
    let seed = recording.manifest().seed;
    let with_mcap = has_logs(&recording);
    let policies = as_named(&options.acting);
    let record_run = RecordRun {
        options: &options,
        seed,
        threads: run.threads,
        with_mcap,
        source,
        turn: 0.0,
        policies: PolicyMaker(&policies),
        stop: run.stop,
    };
    places.keep_what_is_beside()?;
    if !is_wider {
        places.clear()?;
        return grow_in_place(&recording, lock, &record_run, report);
    }
    places.forget_other_sizes(&options)?;
    let wider = record(&places.larger, &record_run, report)?;
    if wider.episodes().len() < options.episodes as usize {
        return Ok(wider);
    }
    places.exchange()?;
    places.keep_what_is_beside()?;
    places.clear()?;
    Ok(Recording::open(&places.recording)?)
}

/// Adds rows or episodes where the recording lies. When that fails before there is a new one, the recording asks for what it asked for before, so that the command
/// which made it still knows it.
fn grow_in_place(
    recording: &Recording,
    lock: FolderLock,
    run: &RecordRun<'_>,
    report: &(dyn Fn(Progress) + Sync),
) -> Result<Recording> {
    ask_for(recording, run.options)?;
    // The recorder takes it over.
    drop(lock);
    let larger = record(recording.path(), run, report);
    if larger.is_err() {
        // What went wrong first is what to say.
        let _ = take_back(recording);
    }
    larger
}

/// Writes the manifest as it was, unless there is a new episode by now.
fn take_back(before: &Recording) -> Result<()> {
    let _lock = FolderLock::acquire(before.path())?;
    if Recording::open(before.path())?.episodes().len() <= before.episodes().len() {
        before.manifest().write(&before.path().join("manifest.json"))?;
    }
    Ok(())
}

/// Whether the recording holds what its options make, and may grow to `size`.
fn check(recording: &Recording, options: &RecordOptions, size: Size) -> Result<()> {
    let path = recording.path();
    let found = Size::of(options);
    if !size.holds(found) {
        return Err(Error::Shrinks { found: found.named(), asked: size.named(), path: path.into() });
    }
    let fault = |fact: String| Err(Error::NotAsPlanned { fact, path: path.into() });
    if let Some(fact) = drawn_anew(options) {
        return fault(fact.to_owned());
    }
    let acted = &options.policy;
    if options.mix().is_err() {
        let by = if acted == "python" { "from Python" } else { "by an online run or another program" };
        return fault(format!("it was recorded {by}, whose policy ({acted}) does not act here"));
    }
    if recording.manifest().options.get(SUBSET).is_some() {
        return fault("it is a part of another, and growing would fill in what was left out".to_owned());
    }
    match unplanned(recording, options).first() {
        Some(entry) => fault(unplanned_in_words(entry, options)),
        None => Ok(()),
    }
}

/// What was done to states after they were simulated, which nobody can do to new ones.
fn drawn_anew(options: &RecordOptions) -> Option<&'static str> {
    if options.rotated.is_some() {
        return Some("its states were turned about the origin");
    }
    let fact = "a policy acted in it by pictures under other distractors than it is drawn with now, and would see these in what is new";
    options.redrawn.then_some(fact)
}

/// Whether the trained runs and the files of actions that act are still those that acted: a run that has learned on since, or a file that was edited, would act in the new rows alone.
fn check_actors(recording: &Recording, options: &RecordOptions) -> Result<()> {
    let mix = options.mix()?;
    check_files(&mix, &options.actions, recording.path())?;
    for (policy, _) in mix.shares() {
        let PolicySpec::Run { path } = policy else { continue };
        let now = acted_by(path, &options.task)?;
        if !options.acting.iter().any(|acting| acting.is_same(&now)) {
            let known: Vec<&str> = options.acting.iter().map(|acting| acting.checkpoint.as_str()).collect();
            let fact = format!("{} is at checkpoint {} now, not at {}", now.run, now.checkpoint, known.join(" or "));
            return Err(Error::NotAsPlanned { fact, path: recording.path().into() });
        }
    }
    Ok(())
}

/// Writes a manifest that asks for more; the episodes that are there stay in it.
fn ask_for(recording: &Recording, options: &RecordOptions) -> Result<()> {
    let mut asked = serde_json::to_value(options).unwrap_or_default();
    rebase(&mut asked, None, Some(recording.path()));
    let asked = Manifest { grid: options.grid, options: asked, ..recording.manifest().clone() };
    Ok(asked.write(&recording.path().join("manifest.json"))?)
}

/// What a recording itself has in its folder.
const OURS: [&str; 3] = ["manifest.json", "episodes", ".lock"];

/// The recording and what lies beside it while it grows, all in one folder.
#[derive(Debug)]
struct Places {
    recording: PathBuf,
    /// The larger recording until it is whole; the old one after the exchange.
    larger: PathBuf,
    /// The old one, on file systems that cannot exchange two folders in one step.
    before: PathBuf,
}

impl Places {
    fn of(path: &Path) -> Result<Self> {
        // Behind a link the recording itself grows, on the disk that it lies on.
        let found = if path.exists() { path.canonicalize() } else { std::path::absolute(path) };
        let recording = found.map_err(Error::io("find", path))?;
        let beside = |ending: &str| {
            let mut name = OsString::from(".");
            name.push(recording.file_name().unwrap_or_default());
            name.push(ending);
            recording.with_file_name(name)
        };
        Ok(Self { larger: beside(".extending"), before: beside(".before-extending"), recording })
    }

    /// That whoever extends it does not stand in the recording: its folder gives its place to another, and what is done in a folder that is gone fails.
    fn check_outside(&self) -> Result<()> {
        let here = std::env::current_dir().and_then(std::fs::canonicalize);
        if here.is_ok_and(|here| here.starts_with(&self.recording)) {
            let fact = "the working directory is in this recording, and new columns put another folder in its place";
            return Err(Error::malformed(&self.recording, fact, "run it from outside"));
        }
        Ok(())
    }

    /// Finishes an exchange that was cut off between its two steps.
    fn recover(&self) -> Result<()> {
        if !self.recording.exists() && self.before.is_dir() {
            std::fs::rename(&self.before, &self.recording).map_err(Error::io("put back", &self.before))?;
        }
        Ok(())
    }

    /// Puts the larger recording in the place of the old one.
    fn exchange(&self) -> Result<()> {
        if renameat_with(CWD, &self.larger, CWD, &self.recording, RenameFlags::EXCHANGE).is_ok() {
            return Ok(());
        }
        let rename = |from: &Path, to: &Path| std::fs::rename(from, to).map_err(Error::io("rename", from));
        rename(&self.recording, &self.before)?;
        rename(&self.larger, &self.recording)
    }

    /// Moves files of others, such as latents and notes, from the old folder into the recording that has taken its place.
    fn keep_what_is_beside(&self) -> Result<()> {
        for folder in [&self.larger, &self.before].into_iter().filter(|folder| folder.is_dir()) {
            for entry in std::fs::read_dir(folder).map_err(Error::io("list", folder))? {
                let entry = entry.map_err(Error::io("list", folder))?;
                let kept = self.recording.join(entry.file_name());
                let is_ours = OURS.iter().any(|name| entry.file_name() == *name);
                if !is_ours && !kept.exists() {
                    std::fs::rename(entry.path(), &kept).map_err(Error::io("move", entry.path()))?;
                }
            }
        }
        Ok(())
    }

    /// Removes the beginnings of a recording of another size: the recording itself is whole, and goes on to the size that is asked for now.
    fn forget_other_sizes(&self, asked: &RecordOptions) -> Result<()> {
        let is_other = Manifest::read(&self.larger.join("manifest.json")).is_ok_and(|begun| begun.grid != asked.grid);
        if is_other { self.clear() } else { Ok(()) }
    }

    /// Removes what an extension left beside the recording, which holds all of it by now.
    fn clear(&self) -> Result<()> {
        for folder in [&self.larger, &self.before] {
            if folder.is_dir() {
                std::fs::remove_dir_all(folder).map_err(Error::io("remove", folder))?;
            }
        }
        Ok(())
    }
}
