//! The rows that `symmetry` compares, and which of them are rotations of each other where rotations were made.
//!
//! In: latents with their recording, and those of the same rows turned. Out: one table of both, and the pairs.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use rand::Rng;
use rand::seq::index::sample;
use vibes_data::Latents;

use super::super::wrong;
use super::states;
use crate::actions::action_features;
use crate::input::{Asked, Frames, Origin, ReadLatents, find_recording, read_beside};
use vibes_measure::Table;
use vibes_measure::symmetry::{ReacherState, SymmetryOptions};

/// Rows that show one state, once as it is and once turned or reflected.
pub(super) type Pairs = Vec<(usize, usize)>;

/// The rows that are compared: the table's own, and after them rotated ones of another recording, under episode numbers of their own.
pub(super) struct Rows {
    latents: Latents,
    /// The recording of the own rows, and that of the rotated ones.
    frames: Vec<Frames>,
    own: usize,
    /// The episode of each row in its own recording: that of a rotated row is the one that it was made of.
    origin: Vec<u32>,
}

/// Latents of rotated rows, with their recording and the state that each shows.
struct Turned {
    latents: Latents,
    frames: Frames,
    states: Vec<ReacherState>,
}

impl Rows {
    /// Own rows alone.
    pub(super) fn new(latents: Latents, frames: Frames) -> Self {
        Self { own: latents.len(), origin: latents.episode.clone(), latents, frames: vec![frames] }
    }

    pub(super) fn table(&self) -> Result<Table<'_>, vibes_measure::Error> {
        self.table_of(self.latents.dims, &self.latents.latent)
    }

    /// Other features of the same rows.
    pub(super) fn table_of<'a>(&'a self, dims: usize, values: &'a [f32]) -> Result<Table<'a>, vibes_measure::Error> {
        let l = &self.latents;
        Table::new(dims, values, &l.episode, &l.step)?.with_grid(&l.state, &l.distractor)?.with_origin(&self.origin)
    }

    /// Features of past actions of all rows, with their dimensions.
    pub(super) fn past_actions(&self) -> (usize, Vec<f32>) {
        let part = |rows: std::ops::Range<usize>| Latents {
            episode: rows.clone().map(|row| self.key(row)[0]).collect(),
            step: self.latents.step[rows].to_vec(),
            ..Latents::default()
        };
        let (dims, mut values) = action_features(&part(0..self.own), &self.frames[0]);
        if let Some(frames) = self.frames.get(1) {
            values.extend(action_features(&part(self.own..self.latents.len()), frames).1);
        }
        (dims, values)
    }

    /// Whether a row is one of those of the other recording.
    pub(super) fn is_rotated(&self, row: usize) -> bool {
        row >= self.own
    }

    /// The row key in its own recording.
    pub(super) fn key(&self, row: usize) -> [u32; 2] {
        [self.origin[row], self.latents.step[row]]
    }

    pub(super) fn frames(&self, row: usize) -> &Frames {
        &self.frames[usize::from(self.is_rotated(row)).min(self.frames.len() - 1)]
    }

    /// Root mean square difference of two rows' pictures, of 255.
    pub(super) fn image_distance(&self, a: usize, b: usize) -> f64 {
        let pixels = |row: usize| {
            let [episode, step] = self.key(row);
            self.frames(row).view(episode).map_or(&[][..], |view| view.pixels(step as usize))
        };
        let (a, b) = (pixels(a), pixels(b));
        let sum: u64 = a.iter().zip(b).map(|(&x, &y)| u64::from(x.abs_diff(y)).pow(2)).sum();
        (sum as f64 / a.len().max(1) as f64).sqrt()
    }

    /// Adds the rotated latents and pairs every row, or as many as are asked for, with its own rotation.
    pub(super) fn append_rotated(
        &mut self,
        (path, recording): (&Path, Option<&Path>),
        origin: &Origin,
        all_states: &mut Vec<ReacherState>,
        options: SymmetryOptions,
        rng: &mut impl Rng,
    ) -> anyhow::Result<(Pairs, Vec<String>)> {
        // Distances between the two tables are measured, which must be about one origin.
        let asked = Asked { recording: recording.map(Path::to_path_buf), ..Asked::default() };
        let ReadLatents { latents, remarks, .. } = read_beside(path, &asked, origin)?;
        if latents.dims != self.latents.dims {
            return Err(wrong(format!(
                "the rotated latents have {} dimensions, the others {}: {}",
                latents.dims,
                self.latents.dims,
                path.display()
            )));
        }
        let frames = Frames::open(&recording_of(&latents, path, recording)?, &latents)?;
        let turned = Turned { states: states(&latents, &frames)?, latents, frames };
        let pairs = self.rotations(&turned, all_states, options)?;
        let drawn = sample(rng, pairs.len(), pairs.len().min(options.pairs)).into_iter().map(|at| pairs[at]);
        let pairs = drawn.map(|(row, turned)| (row, self.own + turned)).collect();
        all_states.extend(&turned.states);
        self.append(&turned.latents, path)?;
        self.frames.push(turned.frames);
        Ok((pairs, remarks))
    }

    /// Every row with the row of the same key among the turned ones.
    fn rotations(&self, turned: &Turned, own: &[ReacherState], options: SymmetryOptions) -> anyhow::Result<Pairs> {
        let (l, rotated) = (&self.latents, &turned.latents);
        let at: HashMap<(u32, u32), usize> =
            (0..rotated.len()).map(|row| ((rotated.episode[row], rotated.step[row]), row)).collect();
        let partner = |row: usize| Some((row, *at.get(&(l.episode[row], l.step[row]))?));
        let pairs: Pairs = (0..self.own).filter_map(partner).collect();
        let is_rotation = |&(a, b): &(usize, usize)| own[a].is_rotation_of(turned.states[b], options);
        if pairs.is_empty() || !pairs.iter().all(is_rotation) {
            return Err(wrong(format!(
                "the rows of these latents are not rotations of the others' (by at least 45 degrees, within {} m); make them with `vibes-collect render --rotate`: {}",
                options.tolerance,
                turned.frames.recording().path().display()
            )));
        }
        Ok(pairs)
    }

    /// Adds rows under episode numbers of their own, as views of the episodes of the same numbers.
    fn append(&mut self, more: &Latents, path: &Path) -> anyhow::Result<()> {
        let l = &mut self.latents;
        let shift = shift(&l.episode, &more.episode).ok_or_else(|| {
            wrong(format!(
                "episodes of rotated latents are counted on from the last of the others, which goes beyond {} here; give both smaller episode numbers: {}",
                u32::MAX,
                path.display()
            ))
        })?;
        l.episode.extend(more.episode.iter().map(|episode| episode + shift));
        l.step.extend(&more.step);
        l.state.extend(&more.state);
        l.distractor.extend(&more.distractor);
        l.latent.extend(&more.latent);
        self.origin.extend(&more.episode);
        Ok(())
    }
}

/// The recording of the rotated latents: the one that is asked for, or that they name.
fn recording_of(turned: &Latents, path: &Path, asked: Option<&Path>) -> anyhow::Result<PathBuf> {
    let named = turned.source.recording.as_deref().and_then(|named| find_recording(named, path));
    asked.map(Path::to_path_buf).or(named).ok_or_else(|| {
        wrong(format!(
            "the recording of the rotated latents is not there; name it with --rotated-recording: {}",
            path.display()
        ))
    })
}

/// What is added to the episode numbers of rotated rows so that they follow the own ones; none if they have no room there.
fn shift(own: &[u32], rotated: &[u32]) -> Option<u32> {
    let shift = own.iter().max().map_or(Some(0), |last| last.checked_add(1))?;
    let last = rotated.iter().max().copied().unwrap_or_default();
    last.checked_add(shift).map(|_| shift)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotated_episodes_follow_the_own_ones_or_have_no_room() {
        assert_eq!(shift(&[0, 3, 1], &[0, 3, 1]), Some(4));
        assert_eq!(shift(&[], &[7]), Some(0));
        assert_eq!(shift(&[u32::MAX - 1], &[0]), Some(u32::MAX));
        assert_eq!(shift(&[u32::MAX - 1], &[1]), None);
        assert_eq!(shift(&[0], &[u32::MAX]), None);
        assert_eq!(shift(&[u32::MAX], &[0]), None);
    }

    /// Without cells an episode is a trajectory, and its twin is the same one turned.
    #[test]
    fn twins_are_no_trajectories_of_their_own() {
        let none = vec![None; 4];
        let latents = Latents {
            episode: vec![3, 3, 5, 8],
            step: vec![0, 1, 0, 0],
            state: none.clone(),
            distractor: none,
            latent: vec![0.0, 1.0, 2.0, 3.0],
            dims: 1,
            ..Latents::default()
        };
        let (own, origin) = (latents.len(), latents.episode.clone());
        let mut rows = Rows { latents: latents.clone(), frames: Vec::new(), own, origin };
        rows.append(&latents, Path::new("turned.arrow")).expect("room");
        assert_eq!(rows.latents.episode, [3, 3, 5, 8, 12, 12, 14, 17]);
        assert_eq!((rows.key(1), rows.key(5)), ([3, 1], [3, 1]));
        assert_eq!(rows.table().expect("table").trajectories().counts(), [3, 0]);
    }
}
