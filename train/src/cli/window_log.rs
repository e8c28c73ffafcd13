//! What every update trained on, for whoever wants to see that another program draws the same: `windows.jsonl` in the run folder.
//!
//! In: the batches of a training run. Out: a line an update: where its windows begin, and the SHA-256 of every column `[time, batch, …]`, little-endian.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use serde_json::json;
use vibes_data::{WindowBatch, sha256_hex};
use vibes_train::json::keep_lines;

#[derive(Debug)]
pub(super) struct WindowLog {
    path: PathBuf,
    file: BufWriter<File>,
    /// The first refusal; the listener of a training run cannot fail.
    refusal: Option<std::io::Error>,
}

impl WindowLog {
    /// Opens the log of a run that has made so many updates, and adds to it: lines that a stopped run wrote after its last checkpoint go, since those updates are made again.
    pub(super) fn open(run: &Path, updates: u64) -> Result<Self> {
        let path = run.join("windows.jsonl");
        keep_lines(&path, |line| line["update"].as_u64().is_some_and(|update| update < updates))?;
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let file = file.with_context(|| format!("cannot write {}", path.display()))?;
        Ok(Self { path, file: BufWriter::new(file), refusal: None })
    }

    pub(super) fn add(&mut self, update: u64, batch: &WindowBatch) {
        let numbers = |column: &[f32]| sha256_hex(&column.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>());
        let line = json!({
            "update": update,
            "starts": batch.starts,
            "pixels": sha256_hex(&batch.pixels),
            "observation": numbers(&batch.observations),
            "action": numbers(&batch.actions),
            "previous_action": numbers(&batch.previous_actions),
            "reward": numbers(&batch.rewards),
            "is_first": sha256_hex(&batch.is_first.iter().map(|&first| u8::from(first)).collect::<Vec<_>>()),
        });
        // Each line at once: a killed run goes on after its last checkpoint, which comes after these.
        if let Err(refusal) = writeln!(self.file, "{line}").and_then(|()| self.file.flush()) {
            self.refusal.get_or_insert(refusal);
        }
    }

    pub(super) fn finish(mut self) -> Result<()> {
        let written = self.file.flush();
        self.refusal.map_or(written, Err).with_context(|| format!("cannot write {}", self.path.display()))
    }
}
