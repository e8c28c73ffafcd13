//! Where an episode's parts come from: made anew, or taken from a recording.
//!
//! In: a [`Source`], and the recording that is being gone on with. Out: per planned episode its stored states, its stored distractors, or the whole of
//! it, where there are any. Whatever is damaged is made anew if it can be, and is an error if it cannot.

use std::collections::BTreeMap;
use std::path::Path;

use vibes_data::{Episode, EpisodeEntry, EpisodeInfo, Recording, Video};

use crate::keys::SUBSET;
use crate::plan::{PlannedEpisode, RecordOptions};
use crate::sound::check_intact;
use crate::stored::{Acted, distractors_of, info_of, is_intact, states_of};
use crate::{Error, Result};
use vibes_env::distractors::DistractorTrajectory;

/// What is taken from another recording.
#[derive(Clone, Copy, Debug, Default)]
pub enum Source<'a> {
    /// Nothing: states are simulated, distractors drawn by lot.
    #[default]
    Simulation,
    /// Only the videos, by name: the recording grows where it lies, whatever else their folder holds by now.
    Itself(&'a Recording),
    /// Finished episodes of a smaller grid of the same options and seed, under their new numbers, and the states of its rows.
    Grid(&'a Recording),
    /// States and distractors: only size and look are new.
    Episodes(&'a Recording),
    /// States: the distractors are new.
    States(&'a Recording),
}

impl<'a> Source<'a> {
    /// The recording that something is taken from.
    pub(super) fn recording(self) -> Option<&'a Recording> {
        match self {
            Self::Simulation => None,
            Self::Itself(recording) | Self::Grid(recording) | Self::Episodes(recording) | Self::States(recording) => {
                Some(recording)
            }
        }
    }

    /// Whether policies act, in whatever is not there yet; of what is drawn again every state is.
    pub(super) fn acts(self) -> bool {
        matches!(self, Self::Simulation | Self::Itself(_) | Self::Grid(_))
    }

    /// What part of another recording is drawn again, where it is a part: still one, which growing must not fill in.
    pub(super) fn subset(self) -> Option<&'a serde_json::Value> {
        self.recording().and_then(|recording| recording.manifest().options.get(SUBSET))
    }

    /// The episodes to be made: what the options ask for, or what the recording to be drawn again holds.
    pub(super) fn episodes(self, options: &RecordOptions) -> Vec<PlannedEpisode> {
        match self {
            Self::Simulation | Self::Itself(_) | Self::Grid(_) => options.episodes().collect(),
            Self::Episodes(recording) | Self::States(recording) => {
                recording.episodes().iter().map(|entry| self.planned(entry)).collect()
            }
        }
    }

    /// An episode as it was planned; without a grid, state and distractor go by its number. When it is drawn again its states are its own, whatever
    /// its row: a recording that was put together may hold several rows of one number.
    fn planned(self, entry: &EpisodeEntry) -> PlannedEpisode {
        let EpisodeEntry { index, cell, .. } = *entry;
        let (state, distractor) = cell.map_or((index, index), |cell| (cell.state, cell.distractor));
        let is_redrawn = matches!(self, Self::Episodes(_) | Self::States(_));
        PlannedEpisode { index, cell, state: if is_redrawn { index } else { state }, distractor }
    }

    /// The recording whose videos stay, and their names: as its manifest has them, whatever else their folder holds by now.
    pub(super) fn videos(self) -> Option<(&'a Path, Vec<String>)> {
        match self {
            Self::Itself(recording) | Self::Grid(recording) | Self::Episodes(recording) => {
                let names = recording.manifest().videos.iter().map(|video| video.name.clone()).collect();
                Some((recording.path(), names))
            }
            Self::Simulation | Self::States(_) => None,
        }
    }

    /// What to do about videos that stay and are no longer what they were.
    fn videos_expected(self) -> &'static str {
        if self.acts() {
            "put those back"
        } else {
            "draw it with other videos (--videos, --distract), or put those back"
        }
    }

    /// That the videos which stay are where the options have them.
    ///
    /// # Errors
    /// [`Error::Malformed`] names the folder where they are not.
    pub(super) fn check_there(self, options: &RecordOptions) -> Result<()> {
        let Some((place, names)) = self.videos() else { return Ok(()) };
        let Some(folder) = options.absent_videos(place, &names)? else { return Ok(()) };
        let fact = format!("its background videos are no longer in {}", folder.display());
        Err(Error::malformed(place, fact, self.videos_expected()))
    }

    /// Stored distractors name videos by their place in the list, so the list must be the same.
    ///
    /// # Errors
    /// [`Error::Malformed`] when it is not.
    pub(super) fn check_videos(self, videos: &[Video]) -> Result<()> {
        match self.recording() {
            Some(recording) if self.videos().is_some() && recording.manifest().videos != videos => {
                let fact = "its background videos are no longer what they were";
                Err(Error::malformed(recording.path(), fact, self.videos_expected()))
            }
            _ => Ok(()),
        }
    }
}

/// What is there already.
#[derive(Debug)]
pub(super) struct Stored<'a> {
    source: Source<'a>,
    recording: &'a Recording,
    /// An episode of every state trajectory.
    states: BTreeMap<u32, &'a EpisodeEntry>,
    /// Of a grid, by row and column.
    cells: BTreeMap<(u32, u32), &'a EpisodeEntry>,
}

impl<'a> Stored<'a> {
    /// `resumed` is the recording that is being gone on with: without another source, its own rows need not be simulated twice.
    pub(super) fn new(source: Source<'a>, resumed: &'a Recording) -> Self {
        let recording = source.recording().unwrap_or(resumed);
        let planned = || recording.episodes().iter().map(|entry| (source.planned(entry), entry));
        let states = planned().rev().map(|(planned, entry)| (planned.state, entry)).collect();
        let cells = planned().map(|(planned, entry)| ((planned.state, planned.distractor), entry)).collect();
        Self { source, recording, states, cells }
    }

    /// The whole of a grid's episode, under its new number.
    pub(super) fn episode(&self, planned: PlannedEpisode) -> Option<(Episode, EpisodeInfo)> {
        let Source::Grid(recording) = self.source else { return None };
        let entry = self.cells.get(&(planned.state, planned.distractor)).filter(|entry| is_intact(recording, entry))?;
        let view = recording.episode(entry.index).ok()?;
        Some((Episode { index: planned.index, ..view.to_episode() }, info_of(entry)))
    }

    /// The states of an episode. Those that can be simulated again are, when their file is damaged.
    ///
    /// # Errors
    /// When a recording that is drawn again is damaged.
    pub(super) fn states(&self, planned: PlannedEpisode) -> Result<Option<Acted>> {
        let Some(entry) = self.states.get(&planned.state) else { return Ok(None) };
        if !self.source.acts() {
            check_intact(self.recording, entry)?;
        } else if !is_intact(self.recording, entry) {
            return Ok(None);
        }
        let view = self.recording.episode(entry.index)?;
        Ok(Some(Acted {
            trajectory: states_of(self.recording.path(), entry, &view)?,
            info: info_of(entry),
            acting_distractor: view.acting_distractor(),
        }))
    }

    /// The distractors of an episode whose size or look alone is new.
    ///
    /// # Errors
    /// When its file is damaged.
    pub(super) fn distractors(&self, planned: PlannedEpisode) -> Result<Option<DistractorTrajectory>> {
        let Source::Episodes(recording) = self.source else { return Ok(None) };
        Ok(Some(distractors_of(&recording.episode(planned.index)?)))
    }
}
