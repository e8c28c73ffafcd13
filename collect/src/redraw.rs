//! Draws a recording again: other distractors, another size, another look, or turned about the origin, from the stored states and parameters.
//!
//! In: a recording and a [`Redraw`]: what is to be different. Out: another recording of the same states. It is the one that would have been recorded with those options in the first
//! place, but for policies that saw pictures: under other distractors they would have acted otherwise, and the options then say that it was drawn again (`redrawn`).

use std::path::Path;
use std::sync::atomic::AtomicBool;

use vibes_data::Recording;

use crate::plan::{ChosenSeeds, RecordOptions};
use crate::recorder::{PolicyMaker, Progress, RecordRun, Source, record};
use crate::stored::{has_logs, options_of};
use crate::{Error, Result};
use vibes_env::distractors::{Axes, Difficulty};
use vibes_env::render::Look;
use vibes_env::symmetric_tasks;
use vibes_env::videos::{VideoSet, VideoSource};

/// Side of the pictures of a recording that had none.
const DEFAULT_SIZE: u32 = 64;

/// What is to be different; what is none stays.
#[derive(Clone, Debug, Default)]
pub struct Redraw {
    /// The distractors. When all of these stay, so do the stored parameters.
    pub distractors: NewDistractors,
    /// Side of the pictures, pixels.
    pub size: Option<u32>,
    /// How they are drawn.
    pub look: Option<Look>,
    /// Degrees by which states are turned about the origin.
    pub rotate: Option<f64>,
    /// Whether to write MCAP logs; as the recording has them when none is given.
    pub with_mcap: Option<bool>,
}

/// What is to be different about the distractors.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NewDistractors {
    /// Which axes.
    pub axes: Option<Axes>,
    /// How far they go.
    pub difficulty: Option<Difficulty>,
    /// Whether they move.
    pub dynamic: Option<bool>,
    /// Where videos come from.
    pub videos: Option<VideoSource>,
    /// Training or held-out videos.
    pub video_set: Option<VideoSet>,
    /// How many videos.
    pub video_count: Option<usize>,
    /// The seed of all axes.
    pub seed: Option<u64>,
    /// Seeds of single axes.
    pub axis_seeds: ChosenSeeds,
}

impl Redraw {
    /// The options of the new recording.
    fn applied(&self, old: &RecordOptions) -> RecordOptions {
        let RecordOptions { mut distractors, axis_seeds: seeds, .. } = *old;
        let new = &self.distractors;
        distractors.axes = new.axes.unwrap_or(distractors.axes);
        distractors.difficulty = new.difficulty.unwrap_or(distractors.difficulty);
        distractors.dynamic = new.dynamic.unwrap_or(distractors.dynamic);
        let seed = |own: Option<u64>, old: Option<u64>| own.or(new.seed).or(old);
        let turned = old.rotated.unwrap_or(0.0) + self.rotate.unwrap_or(0.0);
        RecordOptions {
            distractors,
            videos: new.videos.clone().unwrap_or_else(|| old.videos.clone()),
            video_set: new.video_set.unwrap_or(old.video_set),
            // A number of videos belongs to a difficulty.
            video_count: new.video_count.or(old.video_count.filter(|_| new.difficulty.is_none())),
            size: Some(self.size.or(old.size).unwrap_or(DEFAULT_SIZE)),
            look: self.look.unwrap_or(old.look),
            axis_seeds: ChosenSeeds {
                background: seed(new.axis_seeds.background, seeds.background),
                camera: seed(new.axis_seeds.camera, seeds.camera),
                color: seed(new.axis_seeds.color, seeds.color),
            },
            // Drawn under other distractors than those that its returns were earned under.
            protocol: None,
            rotated: Some(turned).filter(|&turned| turned != 0.0),
            ..old.clone()
        }
    }

    /// That a task can be turned, where it is to be, by however many degrees.
    fn check_turn(&self, options: &RecordOptions, recording: &Recording) -> Result<()> {
        if self.rotate.is_none() {
            return Ok(());
        }
        let environment = options.environment().map_err(|error| error.in_file(recording.path()))?;
        let (task, known) = (environment.name().to_owned(), symmetric_tasks());
        if known.contains(&task.as_str()) {
            return Ok(());
        }
        Err(vibes_env::Error::NoRotation { task, known: known.join(", ") }.into())
    }

    /// Draws `recording` again into the folder `output`, going on with what is there of it.
    ///
    /// # Errors
    /// [`Error::Malformed`] when the output is the recording itself, or the recording was not made by this program; whatever recording may fail of.
    pub fn draw(
        &self,
        recording: &Recording,
        output: &Path,
        (threads, stop): (usize, &AtomicBool),
        report: &(dyn Fn(Progress) + Sync),
    ) -> Result<Recording> {
        if vibes_data::is_same_place(output, recording.path()) {
            return Err(Error::malformed(output, "this is the recording itself", "name another folder with -o"));
        }
        let old = options_of(recording)?;
        self.check_turn(&old, recording)?;
        let mut options = self.applied(&old);
        options.redrawn = old.redrawn || (sees_others(&old, &options) && was_seen(recording, &old));
        // A recording without pictures has no videos, so its backgrounds were never drawn by lot.
        let keeps_distractors = self.distractors == NewDistractors::default() && old.size.is_some();
        let run = RecordRun {
            options: &options,
            seed: recording.manifest().seed,
            threads,
            with_mcap: self.with_mcap.unwrap_or_else(|| has_logs(recording)),
            source: if keeps_distractors { Source::Episodes(recording) } else { Source::States(recording) },
            turn: self.rotate.unwrap_or(0.0),
            policies: PolicyMaker::default(),
            stop,
        };
        record(output, &run, report)
    }
}

/// Whether two recordings differ in what is seen of their distractors.
fn sees_others(one: &RecordOptions, other: &RecordOptions) -> bool {
    one.distractors != other.distractors
        || one.videos != other.videos
        || one.video_set != other.video_set
        || one.video_count != other.video_count
        || one.axis_seeds != other.axis_seeds
}

/// Whether somebody acted by pictures. Where the policies are a mix the options name those who did; what an online run or Python recorded says it row by row.
fn was_seen(recording: &Recording, options: &RecordOptions) -> bool {
    if options.mix().is_ok() {
        return options.acting.iter().any(|acting| acting.pictures.is_some());
    }
    let mut views = recording.episodes().iter().filter_map(|entry| recording.episode(entry.index).ok());
    views.any(|view| view.acting_distractor().is_some())
}
