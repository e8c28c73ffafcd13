//! Checks a recording against the world: after what `vibes-data` checks of the files, every episode's physics is simulated again from its first row
//! and its actions, and a few of its pictures are drawn again. What is stored of every row is compared with what the simulation is at: states, observations and rewards.
//!
//! In: a recording. Out: a [`Verdict`]: what is wrong, and the largest errors seen. Where background videos did not travel along with the recording, no pictures are
//! drawn; the physics needs none.

mod pictures;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use vibes_data::{EpisodeEntry, EpisodeView, Finding, Recording, verify_episode};

use crate::Result;
use crate::care::merge::{MergedPart, merged_parts};
use crate::largest::largest;
use crate::plan::RecordOptions;
use crate::replay::EpisodeErrors;
use crate::sound::{planned_options, unplanned, unplanned_in_words};
use crate::stored::{missing, read_options};
use pictures::{Drawing, Drawn};
use vibes_env::render::Renderer;
use vibes_env::videos::VideoLibrary;
use vibes_env::{Environment, ModelOverrides, Start};

/// Physics on one machine is exact; another processor may round differently.
const QPOS_TOLERANCE: f64 = 1e-6;
/// What follows from positions follows steeply, and single precision is coarser: velocities, observations and rewards may be off by this much more.
const OTHER_TOLERANCE: f64 = 1e-4;

/// What a check found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// What is wrong, one file a finding.
    pub findings: Vec<Finding>,
    /// Episodes simulated again.
    pub simulated: usize,
    /// Largest difference of a position simulated again.
    pub largest_qpos_error: f64,
    /// Largest mean difference of a picture drawn again, of 255.
    pub largest_picture_error: f64,
    /// Pictures drawn again.
    pub pictures: usize,
    /// Episodes that were not simulated again because this program did not record them.
    pub foreign: usize,
    /// Episodes whose pictures were not drawn again because their background videos are not there.
    pub undrawn: usize,
    /// The folders where those videos should be.
    pub absent_videos: BTreeSet<PathBuf>,
}

impl Verdict {
    /// One line for people.
    pub fn summary(&self, recording: &Recording) -> String {
        let (episodes, missing) = (recording.episodes().len(), missing(recording));
        let foreign = match self.foreign {
            0 => String::new(),
            count => format!("; {count} episodes were recorded elsewhere and are not simulated"),
        };
        let state = if self.findings.is_empty() { "sound" } else { "damaged" };
        let simulated = match self.qpos_error() {
            Some(error) => format!("; {} simulated again: largest position error {error:.1e}", self.simulated),
            None => "; nothing was simulated again".to_owned(),
        };
        let drawn = self.picture_error().map_or_else(String::new, |error| {
            format!("; {} pictures drawn again: largest mean error {error:.2} of 255", self.pictures)
        });
        let undrawn = self.undrawn_text();
        let findings = self.findings.len();
        format!("{state}: {episodes} episodes{missing}, {findings} findings{simulated}{drawn}{undrawn}{foreign}")
    }

    /// How to mend what is wrong with a recording that can be simulated again; none where nothing is, or no command makes its episodes.
    pub fn mend(&self, recording: &Recording) -> Option<&'static str> {
        let can_be_mended = !self.findings.is_empty() && planned_options(recording).is_some();
        can_be_mended
            .then_some("to mend it, remove these files and repeat the recording's command, which makes them again")
    }

    /// What could not be drawn, and why.
    fn undrawn_text(&self) -> String {
        if self.undrawn == 0 {
            return String::new();
        }
        let folders: Vec<String> = self.absent_videos.iter().map(|folder| folder.display().to_string()).collect();
        let (count, folders) = (self.undrawn, folders.join(", "));
        format!("; pictures of {count} episodes not drawn again: their videos are not there ({folders})")
    }

    /// Largest difference of a position; none where nothing was simulated.
    pub fn qpos_error(&self) -> Option<f64> {
        (self.simulated > 0).then_some(self.largest_qpos_error)
    }

    /// Largest mean difference of a picture; none where none was drawn.
    pub fn picture_error(&self) -> Option<f64> {
        (self.pictures > 0).then_some(self.largest_picture_error)
    }
}

/// Checks a recording; with `simulate` its physics and a sample of its pictures too.
///
/// # Errors
/// When the simulation or the render context cannot be set up, or the options ask for what cannot be; damage of an episode is a finding, not an error.
pub fn verify(recording: &Recording, simulate: bool) -> Result<Verdict> {
    let mut verdict = Verdict::default();
    let mut simulators = Simulators::new(recording, simulate)?;
    for entry in recording.episodes() {
        let findings = verify_episode(recording, entry);
        let again = if findings.is_empty() { simulators.of(entry.index)? } else { None };
        if simulate && again.is_none() && findings.is_empty() {
            verdict.foreign += 1;
        }
        if let Some(again) = again {
            verdict.simulated += 1;
            let path = recording.path().join(&entry.arrow.path);
            let fault = recording
                .episode(entry.index)
                .map_err(Into::into)
                .and_then(|view| again.compare(entry, &view, &mut verdict));
            verdict.findings.extend(fault.err().map(|error| Finding { path, fault: error.to_string() }));
        }
        verdict.findings.extend(findings);
    }
    verdict.findings.extend(recording.strays().iter().cloned());
    // The log of an episode that is yet to be made is what a killed program left.
    verdict.findings.extend(recording.unlisted_logs(missing(recording).is_empty()));
    verdict.findings.extend(not_asked_for(recording));
    Ok(verdict)
}

/// The episodes of a recorded recording that its own options do not make.
fn not_asked_for(recording: &Recording) -> Vec<Finding> {
    let Some(options) = planned_options(recording) else { return Vec::new() };
    let finding = |entry: &EpisodeEntry| Finding {
        path: recording.path().join(&entry.arrow.path),
        fault: unplanned_in_words(entry, &options),
    };
    unplanned(recording, &options).into_iter().map(finding).collect()
}

/// What it takes to simulate each episode again: of a merged recording, that of the part it came from. One is open at a time, since
/// episodes of a part follow each other.
struct Simulators {
    /// The recording.
    place: PathBuf,
    parts: Vec<Part>,
    open: Option<(usize, Again)>,
}

/// The options under which some episodes were recorded, the names of their videos, and where those are in the recording's list.
struct Part {
    options: Option<RecordOptions>,
    holds: Box<dyn Fn(u32) -> bool>,
    names: Vec<String>,
    videos: Option<Vec<u32>>,
}

impl Simulators {
    fn new(recording: &Recording, simulate: bool) -> Result<Self> {
        let read = |options: &serde_json::Value| -> Result<Option<RecordOptions>> {
            // Options of another shape are another program's, and its episodes are foreign; those of this one that cannot be are damage.
            let options = read_options(options, recording.path()).ok();
            if let Some(options) = &options {
                options.check(recording.path())?;
            }
            Ok(options)
        };
        let listed = &recording.manifest().videos;
        let parts = match merged_parts(recording.manifest()) {
            _ if !simulate => Vec::new(),
            None => {
                let names = listed.iter().map(|video| video.name.clone()).collect();
                let options = read(&recording.manifest().options)?;
                vec![Part { options, holds: Box::new(|_| true), names, videos: None }]
            }
            Some(parts) => {
                // A place that the list does not have is of a video without a name, which is refused.
                let name =
                    |place: &u32| listed.get(*place as usize).map_or_else(String::new, |video| video.name.clone());
                let part = |part: MergedPart| -> Result<Part> {
                    Ok(Part {
                        options: read(&part.options)?,
                        names: part.videos.iter().map(name).collect(),
                        videos: Some(part.videos.clone()),
                        holds: Box::new(move |index| part.holds(index)),
                    })
                };
                parts.into_iter().map(part).collect::<Result<Vec<_>>>()?
            }
        };
        Ok(Self { place: recording.path().to_owned(), parts, open: None })
    }

    /// None for an episode that this program did not record.
    fn of(&mut self, index: u32) -> Result<Option<&mut Again>> {
        let Some(place) = self.parts.iter().position(|part| (part.holds)(index)) else { return Ok(None) };
        let Part { options: Some(options), names, videos, .. } = &self.parts[place] else { return Ok(None) };
        if self.open.as_ref().is_none_or(|(open, _)| *open != place) {
            self.open = None;
            self.open = Some((place, Again::new(options, (&self.place, names), videos.clone())?));
        }
        Ok(self.open.as_mut().map(|(_, again)| again))
    }
}

/// A simulation and a render context to compare with.
struct Again {
    /// For each of the part's own videos, its index in the recording's list; the same without a list.
    listed: Option<Vec<u32>>,
    environment: Environment,
    renderer: Option<Renderer>,
    videos: Arc<VideoLibrary>,
    /// Where videos should be that are not there, so that nothing is drawn.
    absent: Option<PathBuf>,
}

impl Again {
    fn new(options: &RecordOptions, (place, names): (&Path, &[String]), listed: Option<Vec<u32>>) -> Result<Self> {
        let environment = options.environment().map_err(|error| error.in_file(place))?;
        let absent = options.pictures().map(|_| options.absent_videos(place, names)).transpose()?.flatten();
        let settings = options.pictures().filter(|_| absent.is_none());
        let open = |settings| Renderer::new(settings, environment.scenery(), environment.physics().model());
        // Where nothing is drawn again, nobody sees a video.
        let videos = match settings {
            Some(pictures) => options.named_videos(place, names, pictures, &|_missing| true)?,
            None => Arc::new(VideoLibrary::none()),
        };
        Ok(Self { listed, renderer: settings.map(open).transpose()?, videos, environment, absent })
    }

    fn compare(&mut self, entry: &EpisodeEntry, view: &EpisodeView, verdict: &mut Verdict) -> Result<()> {
        let overrides: ModelOverrides = serde_json::from_value(entry.model_overrides.clone()).unwrap_or_default();
        let start = Start {
            qpos: view.qpos(0).to_vec(),
            qvel: view.qvel(0).to_vec(),
            model_overrides: overrides,
            ..Start::default()
        };
        self.environment.reset_to(&start)?;
        if let Some(folder) = &self.absent {
            verdict.undrawn += 1;
            verdict.absent_videos.insert(folder.clone());
        }
        let drawn = self.draw_again(view)?;
        let errors = self.simulate(view)?;
        // An episode is judged by its own errors; the verdict keeps the largest of all only to say it.
        verdict.pictures += drawn.errors.len();
        verdict.largest_picture_error =
            largest([verdict.largest_picture_error].into_iter().chain(drawn.errors.clone()));
        verdict.largest_qpos_error = largest([verdict.largest_qpos_error, errors.qpos]);
        match fault_of(&errors).or_else(|| drawn.fault()) {
            Some(fact) => Err(crate::Error::Differs { index: entry.index, fact }),
            None => Ok(()),
        }
    }

    /// Simulates the episode from where it was put, and compares every row.
    fn simulate(&mut self, view: &EpisodeView) -> Result<EpisodeErrors> {
        let mut errors = EpisodeErrors::default();
        errors.compare_row(&self.environment, view, 0);
        for step in 0..view.steps() {
            let action: Vec<f64> = view.action(step).iter().map(|&number| f64::from(number)).collect();
            let reward = self.environment.step(&action)?;
            errors.compare_reward(view, step, reward);
            errors.compare_row(&self.environment, view, step + 1);
        }
        Ok(errors)
    }

    fn draw_again(&mut self, view: &EpisodeView) -> Result<Drawn> {
        let Some(renderer) = &mut self.renderer else { return Ok(Drawn::default()) };
        renderer.set_model(self.environment.physics().model())?;
        renderer.begin_episode(view.qpos(0))?;
        Drawing { renderer, videos: &self.videos, listed: self.listed.as_deref() }.sample(view)
    }
}

/// The first column that is further off than it may be.
fn fault_of(errors: &EpisodeErrors) -> Option<String> {
    let columns = [
        ("positions", errors.qpos, QPOS_TOLERANCE),
        ("velocities", errors.qvel, OTHER_TOLERANCE),
        ("observations", errors.observations, OTHER_TOLERANCE),
        ("rewards", errors.rewards, OTHER_TOLERANCE),
    ];
    let (name, error, _) = columns.into_iter().find(|&(_, error, tolerance)| error > tolerance)?;
    Some(format!("simulated again, {name} differ by {error:.1e}"))
}
