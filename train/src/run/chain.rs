//! A run and those that it goes on from. In: a run. Out: these runs, the nearest first, as far back as they are there, with what is left of what each has learned from.

use vibes_data::Recording;

use super::Run;

/// A run and those that it goes on from, the nearest first.
#[derive(Debug, Clone)]
pub struct Chain {
    /// As far back as they are there.
    pub links: Vec<Link>,
    /// Whether that is to the first, which began anew.
    pub is_to_the_first: bool,
}

/// One of them, with what is left of what it has learned from.
#[derive(Debug, Clone)]
pub struct Link {
    /// The run.
    pub run: Run,
    /// Those of its recordings that are there.
    pub recordings: Vec<Recording>,
    /// What it lived through itself, if that is there.
    pub replay: Option<Recording>,
}

/// Recordings that a run's weights have learned from, as far as they are still there.
#[derive(Debug, Clone)]
pub struct Seen {
    /// Those that are there.
    pub recordings: Vec<Recording>,
    /// Whether none is gone.
    pub is_whole: bool,
}

impl Link {
    fn of(run: Run) -> Self {
        let (recordings, replay) = (run.recordings_left(), Recording::open(&run.path().join("replay")).ok());
        Self { run, recordings, replay }
    }

    /// Whether all of its recordings are there.
    pub fn has_its_recordings(&self) -> bool {
        self.recordings.len() == self.run.info().recordings.len()
    }

    /// All that is left of what it has learned from.
    pub fn left(&self) -> impl Iterator<Item = &Recording> {
        self.recordings.iter().chain(&self.replay)
    }

    fn is_whole(&self) -> bool {
        // A kept copy of an online run has no replay.
        let has_its_replay = self.replay.is_some() || !self.run.path().join("online.json").exists();
        self.has_its_recordings() && has_its_replay
    }
}

impl Chain {
    /// What the weights have learned from.
    pub fn seen(&self) -> Seen {
        Seen {
            recordings: self.links.iter().flat_map(Link::left).cloned().collect(),
            is_whole: self.is_to_the_first && self.links.iter().all(Link::is_whole),
        }
    }
}

impl Run {
    /// This run and those that it goes on from.
    pub fn chain(&self) -> Chain {
        let (before, is_to_the_first) = self.before();
        let links = std::iter::once(self.clone()).chain(before).map(Link::of).collect();
        Chain { links, is_to_the_first }
    }
}
