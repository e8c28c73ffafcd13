//! A scene of an online run: its episodes as the policy improved, on the timeline of control steps (action repeats counted).
//!
//! In: the run's replay, which holds every episode in the order in which it was lived through, the episodes to show, and returns measured on the way. Out:
//! one `.rrd` file with the shown episodes' frames and rewards, and the return of every episode.

use std::path::Path;

use rerun::blueprint::components::PanelState;
use rerun::blueprint::{
    Blueprint, BlueprintPanel, Horizontal, SelectionPanel, Spatial2DView, TextDocumentView, TimePanel, TimeSeriesView,
    Vertical,
};
use rerun::{EncodedImage, RecordingStream, Scalars, SeriesLines, SeriesPoints, TextDocument, TimeColumn};
use vibes_data::{EpisodeEntry, Recording};

use super::{JPEG_QUALITY, SceneError, rgba, write_whole};
use crate::picture::Pixels;
use crate::picture::color::kind;
use crate::picture::encode::encode_jpeg;
use crate::picture::number::fixed;

/// The timeline's name.
const TIMELINE: &str = "control_steps";

/// What the scene shows.
#[derive(Debug)]
pub struct Progress<'a> {
    /// The run's name.
    pub name: &'a str,
    /// `RUN/replay`.
    pub replay: &'a Recording,
    /// Numbers of the episodes whose frames are shown, rising.
    pub shown: &'a [u32],
    /// Mean returns of evaluations by control steps, if there were any.
    pub evaluations: &'a [(f64, f64)],
    /// Whether these were under videos, which training did not show; not where nobody sees one.
    pub sees_videos: bool,
}

impl Progress<'_> {
    /// Writes the scene whole or not at all.
    ///
    /// # Errors
    /// [`SceneError`].
    pub fn write(&self, path: &Path) -> Result<(), SceneError> {
        write_whole(path, self.name, |stream| self.log(stream))
    }

    fn repeat(&self) -> i64 {
        i64::from(self.replay.manifest().spec.action_repeat)
    }

    /// Every episode with the control steps at which it began.
    fn begun(&self) -> Vec<(&EpisodeEntry, i64)> {
        let mut at = 0;
        let begun = self.replay.episodes().iter().map(|entry| {
            let start = at;
            at += i64::from(entry.steps) * self.repeat();
            (entry, start)
        });
        begun.collect()
    }

    fn log(&self, stream: &RecordingStream) -> Result<(), SceneError> {
        self.blueprint().send(stream, rerun::blueprint::BlueprintActivation::default())?;
        let begun = self.begun();
        let ends = begun.iter().map(|(entry, start)| start + i64::from(entry.steps) * self.repeat());
        let returns = begun.iter().map(|(entry, _)| entry.episode_return);
        let series = Scalars::update_fields().with_scalars(returns);
        let time = TimeColumn::new_sequence(TIMELINE, ends);
        stream.send_columns("returns/episodes", [time], series.columns_of_unit_batches()?)?;
        let style = SeriesPoints::new().with_names(["while training"]).with_colors([rgba(kind(0))]);
        stream.log_static("returns/episodes", &style)?;
        if !self.evaluations.is_empty() {
            let time = TimeColumn::new_sequence(TIMELINE, self.evaluations.iter().map(|(at, _)| *at as i64));
            let series = Scalars::update_fields().with_scalars(self.evaluations.iter().map(|(_, mean)| *mean));
            stream.send_columns("returns/held_out", [time], series.columns_of_unit_batches()?)?;
            let name = if self.sees_videos { "held-out videos" } else { "at evaluations" };
            let style = SeriesLines::new().with_names([name]).with_colors([rgba(kind(4))]);
            stream.log_static("returns/held_out", &style)?;
        }
        for (entry, start) in begun.iter().filter(|(entry, _)| self.shown.contains(&entry.index)) {
            self.log_episode(stream, entry, *start)?;
        }
        Ok(())
    }

    fn log_episode(&self, stream: &RecordingStream, entry: &EpisodeEntry, start: i64) -> Result<(), SceneError> {
        let Ok(view) = self.replay.episode(entry.index) else { return Ok(()) };
        // An episode's last picture and the next one's first are of the same moment; the next one's is kept.
        let times: Vec<i64> = (0..view.steps() as i64).map(|step| start + step * self.repeat()).collect();
        let time = || TimeColumn::new_sequence(TIMELINE, times.iter().copied());
        let rewards = Scalars::update_fields().with_scalars((0..view.steps()).map(|step| f64::from(view.reward(step))));
        stream.send_columns("reward", [time()], rewards.columns_of_unit_batches()?)?;
        let text = format!(
            "**episode {}**, begun after {start} control steps\n\nreturn {}, {} steps\n\npolicy: {}",
            entry.index,
            fixed(entry.episode_return, 1),
            entry.steps,
            entry.policy
        );
        stream.set_time_sequence(TIMELINE, start);
        stream.log("episode", &TextDocument::from_markdown(text))?;
        if let Some(size) = self.replay.manifest().spec.pixels {
            let picture = |step: usize| {
                let pixels = Pixels { width: size.width, height: size.height, rgb: view.pixels(step).to_vec() };
                encode_jpeg(&pixels, JPEG_QUALITY).unwrap_or_default()
            };
            let blobs: Vec<Vec<u8>> = (0..view.steps()).map(picture).collect();
            let types = vec![rerun::MediaType::jpeg(); blobs.len()];
            let images = EncodedImage::update_fields().with_many_blob(blobs).with_many_media_type(types);
            stream.send_columns("frame", [time()], images.columns_of_unit_batches()?)?;
        }
        Ok(())
    }

    fn blueprint(&self) -> Blueprint {
        let above = Horizontal::new([
            Spatial2DView::new("frame").with_origin("frame").into(),
            TextDocumentView::new("episode").with_origin("episode").into(),
        ]);
        let below = Horizontal::new([
            TimeSeriesView::new("return of every episode").with_origin("returns").into(),
            TimeSeriesView::new("reward").with_origin("reward").into(),
        ]);
        Blueprint::new(Vertical::new([above.into(), below.into()]).with_row_shares([2.0, 1.0]))
            .with_auto_layout(false)
            .with_auto_views(false)
            .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
            .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
            .with_time_panel(TimePanel::new().with_state(PanelState::Collapsed).with_timeline(TIMELINE))
    }
}
