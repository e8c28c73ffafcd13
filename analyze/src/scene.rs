//! A Rerun recording to walk through: frame, latent, map with the current point lit, nearest neighbours, reward and distractor parameters,
//! all on the timeline `row`, with a fixed layout.
//!
//! In: a table of latents with its recording, a map, the rows to show and their neighbours. Out: one `.rrd` file. Pictures are stored as
//! JPEG: a scene is for looking, the recording is for measuring.

mod layout;
pub mod progress;

use std::path::Path;

use rerun::{
    BarChart, EncodedImage, LineStrips2D, Points2D, RecordingStream, RecordingStreamBuilder, Scalars, SeriesLines,
    TextDocument, TimeColumn,
};
use vibes_data::{Decoded, DecodedRow, Latents};

use crate::figures::Coloring;
use crate::input::{Frames, UserColumn};
use crate::picture::Pixels;
use crate::picture::color::{self, Color};
use crate::picture::encode::encode_jpeg;
use vibes_measure::neighbours::Neighbours;

/// The timeline's name: the running number of the rows shown.
const TIMELINE: &str = "row";
/// Quality of the pictures, of 100.
const JPEG_QUALITY: u8 = 92;

/// A picture of a row that a decoder drew.
type PictureOf = fn(&DecodedRow) -> Option<&[u8]>;

/// What a scene shows.
#[derive(Debug)]
pub struct Scene<'a> {
    /// The table.
    pub latents: &'a Latents,
    /// Its recording, if there is one.
    pub frames: Option<&'a Frames>,
    /// The map, `[rows of the table, 2]`.
    pub positions: &'a [[f32; 2]],
    /// What colours the map's points, if anything does.
    pub color: Option<&'a UserColumn>,
    /// Rows of the table to show, in order; the timeline counts them.
    pub rows: &'a [usize],
    /// The neighbours of each of `rows`, in the same order.
    pub neighbours: &'a Neighbours,
    /// What a decoder draws of some of the rows, if it was asked to.
    pub decoded: Option<&'a Decoded>,
    /// Shown in the text panel, as in "after 300 updates: barely trained".
    pub note: Option<&'a str>,
}

/// Why a scene could not be written.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The Rerun library refused.
    #[error("cannot write the scene: {0}")]
    Rerun(#[from] rerun::RecordingStreamError),
    /// Data that Rerun cannot hold.
    #[error("cannot write the scene: {0}")]
    Columns(#[from] rerun::external::re_types_core::SerializationError),
    /// The file could not be finished.
    #[error("cannot write the scene: {cause}: {path}")]
    Io {
        /// The system's answer.
        cause: std::io::Error,
        /// The file.
        path: std::path::PathBuf,
    },
}

/// Writes a recording of this name beside its place and renames it, so that it is there whole or not at all.
fn write_whole(
    path: &Path,
    name: &str,
    log: impl FnOnce(&RecordingStream) -> Result<(), SceneError>,
) -> Result<(), SceneError> {
    let partial = path.with_extension("rrd.partial");
    let stream = RecordingStreamBuilder::new("vibes-analyze").recording_name(name).save(&partial)?;
    log(&stream)?;
    let flushed = stream.flush_blocking().map_err(|e| std::io::Error::other(e.to_string()));
    drop(stream);
    flushed.and_then(|()| std::fs::rename(&partial, path)).map_err(|cause| SceneError::Io { cause, path: path.into() })
}

impl Scene<'_> {
    /// Writes the scene whole or not at all.
    ///
    /// # Errors
    /// [`SceneError`].
    pub fn write(&self, path: &Path) -> Result<(), SceneError> {
        write_whole(path, &self.name(), |stream| self.log(stream))
    }

    fn name(&self) -> String {
        let recording = self.latents.source.recording.as_deref().unwrap_or("latents");
        Path::new(recording).file_name().map_or_else(|| recording.to_string(), |n| n.to_string_lossy().into_owned())
    }

    fn log(&self, stream: &RecordingStream) -> Result<(), SceneError> {
        layout::blueprint(self).send(stream, rerun::blueprint::BlueprintActivation::default())?;
        self.log_map(stream)?;
        self.log_latents(stream)?;
        self.log_text(stream)?;
        if let Some(frames) = self.frames {
            self.log_pictures(stream, frames)?;
            self.log_distractors(stream, frames)?;
        }
        if let Some(decoded) = self.decoded {
            self.log_decoded(stream, decoded)?;
        }
        Ok(())
    }

    fn time(&self) -> TimeColumn {
        TimeColumn::new_sequence(TIMELINE, 0..self.rows.len() as i64)
    }

    /// A row's place on the map; Rerun's y axis points down.
    fn at(&self, row: usize) -> [f32; 2] {
        let [x, y] = self.positions[row];
        [x, -y]
    }

    fn log_map(&self, stream: &RecordingStream) -> Result<(), SceneError> {
        let all: Vec<[f32; 2]> = (0..self.positions.len()).map(|row| self.at(row)).collect();
        let colors: Vec<Color> = self.color.map_or_else(|| vec![NONE], point_colors);
        let context = Points2D::new(all)
            .with_colors(colors.into_iter().map(rgba))
            .with_radii([rerun::Radius::new_ui_points(1.2)]);
        stream.log_static("map/all", &context)?;
        let here: Vec<[f32; 2]> = self.rows.iter().map(|&row| self.at(row)).collect();
        let point = Points2D::update_fields().with_positions(here);
        stream.send_columns("map/here", [self.time()], point.columns_of_unit_batches()?)?;
        let style = |color, radius| {
            Points2D::update_fields().with_colors([rgba(color)]).with_radii([rerun::Radius::new_ui_points(radius)])
        };
        stream.log_static("map/here", &style(color::kind(4), 6.0))?;
        let k = self.neighbours.k();
        let near = (0..self.rows.len()).flat_map(|i| self.neighbours.rows(i)).map(|&row| self.at(row as usize));
        let near = Points2D::update_fields().with_positions(near.collect::<Vec<_>>());
        stream.send_columns("map/neighbours", [self.time()], near.columns(vec![k; self.rows.len()])?)?;
        stream.log_static("map/neighbours", &style(color::kind(0), 4.0))?;
        self.log_paths(stream)
    }

    /// The current episode's path, logged where an episode begins.
    fn log_paths(&self, stream: &RecordingStream) -> Result<(), SceneError> {
        let episode = |i: usize| self.latents.episode[self.rows[i]];
        let starts: Vec<usize> = (0..self.rows.len()).filter(|&i| i == 0 || episode(i) != episode(i - 1)).collect();
        let path = |start: usize| -> Vec<[f32; 2]> {
            (start..self.rows.len())
                .take_while(|&i| episode(i) == episode(start))
                .map(|i| self.at(self.rows[i]))
                .collect()
        };
        let strips = LineStrips2D::update_fields().with_strips(starts.iter().map(|&s| path(s)));
        let time = TimeColumn::new_sequence(TIMELINE, starts.iter().map(|&s| s as i64));
        stream.send_columns("map/episode", [time], strips.columns_of_unit_batches()?)?;
        let style = LineStrips2D::update_fields()
            .with_colors([rgba(color::kind(1))])
            .with_radii([rerun::Radius::new_ui_points(0.8)]);
        Ok(stream.log_static("map/episode", &style)?)
    }

    fn log_latents(&self, stream: &RecordingStream) -> Result<(), SceneError> {
        let values = self.rows.iter().map(|&row| rerun::TensorData::from(self.latents.row(row)));
        let bars = BarChart::update_fields().with_many_values(values);
        stream.send_columns("latent", [self.time()], bars.columns_of_unit_batches()?)?;
        let known: Vec<(usize, f64)> = self
            .rows
            .iter()
            .enumerate()
            .filter_map(|(i, &row)| Some((i, f64::from(self.latents.reward[row]?))))
            .collect();
        if !known.is_empty() {
            let time = TimeColumn::new_sequence(TIMELINE, known.iter().map(|&(i, _)| i as i64));
            let rewards = Scalars::update_fields().with_scalars(known.iter().map(|&(_, r)| r));
            stream.send_columns("reward", [time], rewards.columns_of_unit_batches()?)?;
            stream
                .log_static("reward", &SeriesLines::new().with_names(["reward"]).with_colors([rgba(color::kind(2))]))?;
        }
        Ok(())
    }

    fn log_text(&self, stream: &RecordingStream) -> Result<(), SceneError> {
        let l = self.latents;
        let key = |row: usize| format!("{}:{}", l.episode[row], l.step[row]);
        let cell = |row: usize| match l.state[row].zip(l.distractor[row]) {
            Some((s, d)) => format!("\n\nstate trajectory {s}, distractor trajectory {d}"),
            None => String::new(),
        };
        let text = |(i, &row): (usize, &usize)| {
            let near = self.neighbours.rows(i).iter().zip(self.neighbours.distances(i));
            let near: String = near.map(|(&n, d)| format!("\n- {} at {d:.3}", key(n as usize))).collect();
            let note = self.note.map_or_else(String::new, |n| format!("**{n}**\n\n"));
            format!(
                "{note}**episode {}, step {}**{}\n\nnearest neighbours (episode:step at distance):\n{near}",
                l.episode[row],
                l.step[row],
                cell(row)
            )
        };
        let texts: Vec<String> = self.rows.iter().enumerate().map(text).collect();
        let types = vec![rerun::MediaType::markdown(); texts.len()];
        let documents = TextDocument::update_fields().with_many_text(texts).with_many_media_type(types);
        Ok(stream.send_columns("about", [self.time()], documents.columns_of_unit_batches()?)?)
    }

    fn log_pictures(&self, stream: &RecordingStream, frames: &Frames) -> Result<(), SceneError> {
        let encode = |row: usize| {
            encode_jpeg(&*frames.picture(self.latents.episode[row], self.latents.step[row])?, JPEG_QUALITY).ok()
        };
        let send = |entity: String, rows: Vec<usize>| -> Result<(), SceneError> {
            let known: Vec<(i64, Vec<u8>)> =
                rows.iter().enumerate().filter_map(|(i, &row)| Some((i as i64, encode(row)?))).collect();
            if known.is_empty() {
                return Ok(());
            }
            let (times, blobs): (Vec<i64>, Vec<Vec<u8>>) = known.into_iter().unzip();
            let types = vec![rerun::MediaType::jpeg(); blobs.len()];
            let images = EncodedImage::update_fields().with_many_blob(blobs).with_many_media_type(types);
            Ok(stream.send_columns(
                entity,
                [TimeColumn::new_sequence(TIMELINE, times)],
                images.columns_of_unit_batches()?,
            )?)
        };
        send("frame".into(), self.rows.to_vec())?;
        for rank in 0..self.neighbours.k() {
            send(
                format!("neighbours/{}", rank + 1),
                (0..self.rows.len()).map(|i| self.neighbours.rows(i)[rank] as usize).collect(),
            )?;
        }
        Ok(())
    }

    /// The rows that a decoder drew, with its picture of the latent and of the prediction.
    fn log_decoded(&self, stream: &RecordingStream, decoded: &Decoded) -> Result<(), SceneError> {
        let (height, width) = decoded.size;
        let jpeg = |rgb: &[u8]| encode_jpeg(&Pixels { width, height, rgb: rgb.to_vec() }, JPEG_QUALITY).ok();
        let drawn = |row: usize| {
            let key = (self.latents.episode[row], self.latents.step[row]);
            decoded.rows.iter().find(|row| (row.episode, row.step) == key)
        };
        let lines: [(&str, PictureOf); 2] =
            [("decoded/shown", |row| Some(&row.shown)), ("decoded/predicted", |row| row.predicted.as_deref())];
        for (entity, of) in lines {
            let known = self.rows.iter().enumerate().filter_map(|(i, &row)| Some((i as i64, jpeg(of(drawn(row)?)?)?)));
            let (times, blobs): (Vec<i64>, Vec<Vec<u8>>) = known.unzip();
            if blobs.is_empty() {
                continue;
            }
            let types = vec![rerun::MediaType::jpeg(); blobs.len()];
            let images = EncodedImage::update_fields().with_many_blob(blobs).with_many_media_type(types);
            let time = TimeColumn::new_sequence(TIMELINE, times);
            stream.send_columns(entity, [time], images.columns_of_unit_batches()?)?;
        }
        Ok(())
    }

    fn log_distractors(&self, stream: &RecordingStream, frames: &Frames) -> Result<(), SceneError> {
        let views = || {
            self.rows
                .iter()
                .filter_map(|&row| Some((frames.view(self.latents.episode[row])?, self.latents.step[row] as usize)))
        };
        let cameras = views().map(|(view, step)| view.camera(step)).flat_map(|c| [c.r, c.h, c.v, c.roll]);
        self.send_lines(
            stream,
            "distractors/camera",
            &["distance r (m)", "azimuth h (rad)", "inclination v (rad)", "roll (rad)"],
            cameras.collect(),
        )?;
        let background = |of: fn(vibes_data::BackgroundFrame) -> u32| -> Vec<f64> {
            views().map(|(view, step)| view.background(step).map_or(f64::NAN, |b| f64::from(of(b)))).collect()
        };
        self.send_lines(stream, "distractors/background/video", &["video"], background(|b| b.video))?;
        self.send_lines(stream, "distractors/background/frame", &["frame"], background(|b| b.frame))?;
        let materials = &frames.recording().manifest().spec.materials;
        let names: Vec<String> =
            materials.iter().flat_map(|m| ["red", "green", "blue"].map(|c| format!("{m} {c}"))).collect();
        let colors: Vec<f64> = views()
            .flat_map(|(view, step)| view.colors(step).iter().map(|&v| f64::from(v)).collect::<Vec<_>>())
            .collect();
        self.send_lines(stream, "distractors/colors", &names.iter().map(String::as_str).collect::<Vec<_>>(), colors)
    }

    /// Lines that share a plot: `values` `[rows, names]`.
    fn send_lines(
        &self,
        stream: &RecordingStream,
        entity: &str,
        names: &[&str],
        values: Vec<f64>,
    ) -> Result<(), SceneError> {
        if names.is_empty() || values.len() != names.len() * self.rows.len() || values.iter().all(|v| v.is_nan()) {
            return Ok(());
        }
        let lines = Scalars::update_fields().with_scalars(values);
        stream.send_columns(entity, [self.time()], lines.columns(vec![names.len(); self.rows.len()])?)?;
        Ok(stream.log_static(entity, &SeriesLines::new().with_names(names.iter().copied()))?)
    }
}

/// The points' grey where nothing colours them.
const NONE: Color = Color::new(150, 150, 150);

/// A colour a row, as in the figures, so that here too a few values far from all others do not make these one colour.
fn point_colors(column: &UserColumn) -> Vec<Color> {
    let coloring = match column {
        UserColumn::Numbers(values) => Coloring::Quantity { name: String::new(), values: values.clone() },
        UserColumn::Kinds { of_row, names } => {
            Coloring::Kind { name: String::new(), kinds: of_row.clone(), names: names.clone() }
        }
    };
    coloring.of_points().into_iter().map(|color| color.unwrap_or(NONE)).collect()
}

fn rgba(c: Color) -> rerun::Color {
    let [r, g, b] = c.rgb;
    rerun::Color::from_rgb(r, g, b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_value_far_away_does_not_make_all_points_one_colour() {
        let mut values: Vec<f64> = (0..100).map(f64::from).collect();
        (values[50], values[60]) = (1e6, f64::NAN);
        let colors = point_colors(&UserColumn::Numbers(values));
        assert!(colors[0] != colors[30] && colors[30] != colors[99], "{colors:?}");
        assert_eq!((colors[50], colors[60]), (colors[99], NONE));
    }
}
