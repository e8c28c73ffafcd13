//! The recording behind a table of latents: its pictures, its task state and its distractor parameters, by row.
//!
//! In: the recording and the latents' row keys, checked to belong together. Out: pictures one at a time (episodes are memory-mapped), and
//! columns of numbers for the whole table.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use vibes_data::{EpisodeView, Latents, Recording};

use super::InputError;
use crate::picture::Pixels;

/// A recording, opened and checked against a table of latents.
#[derive(Debug)]
pub struct Frames {
    recording: Recording,
    views: BTreeMap<u32, EpisodeView>,
}

impl Frames {
    /// Opens the recording and every episode that the latents name.
    ///
    /// # Errors
    /// [`InputError::Recording`] if it cannot be read, [`InputError::OtherRecording`] if it lacks an episode or row, has it in another
    /// cell of the grid, or with another reward: two recordings of one size are told apart by nothing else.
    pub fn open(path: &Path, latents: &Latents) -> Result<Self, InputError> {
        let recording = Recording::open(path)?;
        let mut views: BTreeMap<u32, EpisodeView> = BTreeMap::new();
        let other = |fact: String| InputError::OtherRecording { fact, path: path.into() };
        for row in 0..latents.len() {
            let (episode, step) = (latents.episode[row], latents.step[row]);
            if let std::collections::btree_map::Entry::Vacant(place) = views.entry(episode) {
                if !recording.episodes().iter().any(|e| e.index == episode) {
                    return Err(other(format!("it has no episode {episode}")));
                }
                place.insert(recording.episode(episode)?);
            }
            let view = &views[&episode];
            if step as usize >= view.rows() {
                return Err(other(format!("step {step} of episode {episode} is past its {} rows", view.rows())));
            }
            let cell = view.cell().map(|c| (c.state, c.distractor));
            let claimed = latents.state[row].zip(latents.distractor[row]);
            if let Some((state, distractor)) = claimed.filter(|_| claimed != cell) {
                let lies = cell.map_or("lies in no cell of a grid".to_owned(), |(state, distractor)| {
                    format!("lies in cell {state}, {distractor} of its grid")
                });
                return Err(other(format!(
                    "episode {episode} {lies}, the latents say {state}, {distractor}: where the grid has grown since, encode it again"
                )));
            }
            let earned = (step < view.steps() as u32).then(|| view.reward(step as usize));
            if let Some((here, claimed)) = earned.zip(latents.reward[row]).filter(|(a, b)| differ(*a, *b)) {
                return Err(other(format!(
                    "step {step} of episode {episode} earned {here} in it, the latents say {claimed} (leave their column reward out if it is not the \
                     recording's)"
                )));
            }
        }
        Ok(Self { recording, views })
    }

    /// The recording.
    #[must_use]
    pub fn recording(&self) -> &Recording {
        &self.recording
    }

    /// One episode of the latents, memory-mapped.
    #[must_use]
    pub fn view(&self, episode: u32) -> Option<&EpisodeView> {
        self.views.get(&episode)
    }

    /// The picture of a row; none if the recording has no pictures or this one is missing.
    #[must_use]
    pub fn picture(&self, episode: u32, step: u32) -> Option<Arc<Pixels>> {
        let size = self.recording.manifest().spec.pixels?;
        let rgb = self.views.get(&episode)?.pixels(step as usize);
        (rgb.len() == size.bytes())
            .then(|| Arc::new(Pixels { width: size.width, height: size.height, rgb: rgb.to_vec() }))
    }

    /// The task's state of every row, `[rows, quantities]`: the recording's task quantities, with angles as cosine and sine and without what a symmetry makes
    /// superfluous; the vector observation where the recording names none.
    #[must_use]
    pub fn task_state(&self, latents: &Latents) -> Vec<f64> {
        let all = self.recording.manifest().spec.readable();
        let state: Vec<_> = all.iter().filter(|readable| readable.is_state()).collect();
        let of = |view: &EpisodeView, step| state.iter().filter_map(|readable| readable.value(view, step)).collect();
        self.rows(latents, of)
    }

    fn rows(&self, latents: &Latents, of: impl Fn(&EpisodeView, usize) -> Vec<f64>) -> Vec<f64> {
        let at = |row: usize| self.views.get(&latents.episode[row]).map(|view| of(view, latents.step[row] as usize));
        (0..latents.len()).filter_map(at).flatten().collect()
    }
}

/// Whether two rewards are not the same but for rounding.
pub(crate) fn differ(a: f32, b: f32) -> bool {
    (a - b).abs() > 1e-3 * (1.0 + a.abs())
}
