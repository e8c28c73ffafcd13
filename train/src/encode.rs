//! Latents of a recording: the posterior mean of every row of every episode, the last row among them, or what an agent without a world model sees there. The encoder follows each episode from its start, a
//! chunk of rows at a time, and the table is written chunk by chunk, so memory follows the chunk.

use std::path::Path;

use burn::tensor::Device;
use vibes_data::{EpisodeEntry, EpisodeView, Latents, LatentsSource, LatentsWriter, Recording, relative_place};
use vibes_model::ObservationKind;
use vibes_model::encode::RawFrames;
use vibes_model::trained::{EpisodeLatents, TrainedEncoder};

use crate::error::{Result, TrainError};

/// Rows encoded at a time.
const CHUNK: usize = 128;

/// Writes the latents of every episode to `output`; `checkpoint` is the encoder's file, for the table's metadata. `listen` gets the number of rows done
/// after every chunk.
///
/// # Errors
/// The recording does not fit the encoder, or the table cannot be written.
pub fn encode_recording(
    encoder: TrainedEncoder<'_>,
    checkpoint: &Path,
    recording: &Recording,
    output: &Path,
    device: &Device,
    listen: &mut dyn FnMut(u64),
) -> Result<()> {
    check_fit(encoder, recording)?;
    let source = LatentsSource {
        recording: Some(relative_place(recording.path(), folder_of(output))),
        checkpoint: Some(relative_place(checkpoint, folder_of(output))),
    };
    let mut table = LatentsWriter::create(output, encoder.latent(), &source)?;
    let mut latents = encoder.episode(device);
    let mut done = 0;
    for entry in recording.episodes() {
        let episode = recording.episode(entry.index)?;
        latents.reset();
        for start in (0..episode.rows()).step_by(CHUNK) {
            let rows = start..episode.rows().min(start + CHUNK);
            done += rows.len() as u64;
            let latent = encode_rows(encoder, &mut latents, &episode, rows.clone())?;
            table.append(&chunk(entry, &episode, rows, encoder.latent(), latent))?;
            listen(done);
        }
    }
    Ok(table.finish()?)
}

/// The folder of a file, which places in it are relative to.
pub(crate) fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Latents of some rows of an episode, which must follow those encoded before: `[rows, latent]`.
///
/// # Errors
/// The observations are not the encoder's.
pub fn encode_rows(
    encoder: TrainedEncoder<'_>,
    latents: &mut EpisodeLatents<'_>,
    episode: &EpisodeView,
    rows: std::ops::Range<usize>,
) -> Result<Vec<f32>> {
    let width = encoder.actions();
    let mut previous = Vec::with_capacity(rows.len() * width);
    for row in rows.clone() {
        match row {
            0 => previous.resize(width, 0.0),
            _ => previous.extend_from_slice(episode.action(row - 1)),
        }
    }
    let latent = match encoder.observation() {
        ObservationKind::Pixels { .. } => {
            let pixels: Vec<u8> = rows.flat_map(|row| episode.pixels(row)).copied().collect();
            latents.push(RawFrames::Pixels(&pixels), &previous)
        }
        ObservationKind::Vector { .. } => {
            let observations: Vec<f32> = rows.flat_map(|row| episode.observation(row)).copied().collect();
            latents.push(RawFrames::Vectors(&observations), &previous)
        }
    };
    Ok(latent?)
}

/// Checks that an encoder can read a recording.
///
/// # Errors
/// Pictures of another size, or actions of another number.
pub fn check_fit(encoder: TrainedEncoder<'_>, recording: &Recording) -> Result<()> {
    check_sizes(encoder.task(), encoder.observation(), encoder.actions(), recording)
}

/// The same of an encoder that is yet to be made.
pub(crate) fn check_sizes(
    task: &str,
    observation: ObservationKind,
    actions: usize,
    recording: &Recording,
) -> Result<()> {
    let spec = &recording.manifest().spec;
    let fits = match observation {
        ObservationKind::Pixels { height, width } => {
            spec.pixels.is_some_and(|size| (size.height as usize, size.width as usize) == (height, width))
        }
        ObservationKind::Vector { len } => spec.observation_len() == len,
    };
    if fits && spec.action.min.len() == actions {
        return Ok(());
    }
    let pixels = spec.pixels.map_or("no pixels".to_owned(), |size| format!("pixels of {}×{}", size.height, size.width));
    let found = format!(
        "{} with {pixels}, observation vectors of {} and {} actions",
        spec.task,
        spec.observation_len(),
        spec.action.min.len()
    );
    let wanted = format!("{task} with {observation} and {actions} actions");
    Err(TrainError::OtherRecording { found, wanted, path: recording.path().to_owned() })
}

fn chunk(
    entry: &EpisodeEntry,
    episode: &EpisodeView,
    rows: std::ops::Range<usize>,
    dims: usize,
    latent: Vec<f32>,
) -> Latents {
    let cell = entry.cell;
    Latents {
        episode: vec![entry.index; rows.len()],
        step: rows.clone().map(|row| row as u32).collect(),
        state: vec![cell.map(|cell| cell.state); rows.len()],
        distractor: vec![cell.map(|cell| cell.distractor); rows.len()],
        reward: rows.map(|row| (row < episode.steps()).then(|| episode.reward(row))).collect(),
        dims,
        latent,
        source: LatentsSource::default(),
    }
}
