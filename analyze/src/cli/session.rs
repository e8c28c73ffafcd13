//! What the verbs share: which latents, whose pictures, where the output goes, and what every output says about where it comes from.

use std::path::{Path, PathBuf};

use anyhow::Context;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Serialize;
use serde_json::{Value, json};
use vibes_data::{Latents, relative_place};

use super::{Globals, Outcome, say, wrong};
use crate::figures::{Figure, Heading};
use crate::input::{
    Asked, Frames, InputError, MOVED, Origin, ReadLatents, RowsError, UserColumn, find_recording, newest_latents,
    read_with_origin,
};
use crate::output;
use crate::output::Column;
use vibes_measure::Table;

/// A table of latents that a verb looks at, and where its output goes.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct TableInput {
    /// A table of latents (Arrow, Parquet, CSV, npy, npz), or a folder, such as a run, whose newest latents*.arrow is taken [default: the newest latents*.arrow below the folder runs, or below the current folder].
    #[arg(value_name = "LATENTS")]
    input: Option<PathBuf>,
    /// The same, named by an option.
    #[arg(long, value_name = "FILE", conflicts_with = "input")]
    latents: Option<PathBuf>,
    /// Where the output goes [default: the folder `figures` beside the latents].
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    /// Seed of everything random.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// A line under the title of every figure, as in "after 300 updates: barely trained".
    #[arg(long, value_name = "TEXT")]
    note: Option<String>,
    /// Which rows to look at, as in "step >= 50 and state in (0, 3)": an expression over columns of the latents or of a joined table.
    #[arg(id = "where", long = "where", value_name = "EXPRESSION")]
    rows: Option<String>,
    /// A table of your own (CSV, Parquet, Arrow, npz), joined on episode and step, or on episode alone; may be given several times.
    #[arg(long, value_name = "TABLE")]
    join: Vec<PathBuf>,
    /// The recording the latents were encoded from [default: the one that their metadata names]. Named here, it also gives the cells of the grid and the rewards where the table
    /// lacks them, and the rows of a plain array (npy) their keys, in order.
    #[arg(long, value_name = "FOLDER")]
    recording: Option<PathBuf>,
}

/// The same with the recording beside it, for verbs that look into that too.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Input {
    #[command(flatten)]
    table: TableInput,
    /// Go on without the recording: no pictures, no task state.
    #[arg(long, conflicts_with = "recording")]
    no_frames: bool,
}

impl From<&TableInput> for Input {
    fn from(table: &TableInput) -> Self {
        Self { table: table.clone(), no_frames: true }
    }
}

impl Input {
    /// The input of a verb that is run by another.
    pub(super) fn named(
        latents: Option<&Path>,
        recording: Option<&Path>,
        output: Option<&Path>,
        seed: u64,
        note: Option<&str>,
    ) -> Self {
        let owned = |path: Option<&Path>| path.map(Path::to_path_buf);
        let table = TableInput {
            input: owned(latents),
            latents: None,
            output: owned(output),
            seed,
            note: note.map(String::from),
            rows: None,
            join: Vec::new(),
            recording: owned(recording),
        };
        Self { table, no_frames: false }
    }

    /// The same for a verb that never looks into the recording.
    pub(super) fn into_table(self) -> TableInput {
        self.table
    }

    /// The folder that was named, if it is one.
    pub(super) fn folder(&self) -> Option<&Path> {
        self.table.latents.as_deref().or(self.table.input.as_deref()).filter(|path| path.is_dir())
    }

    /// Where the output was asked to go.
    pub(super) fn output(&self) -> Option<PathBuf> {
        self.table.output.clone()
    }

    /// The same, going on without the recording if that is asked for.
    pub(super) fn less_frames(self, no_frames: bool) -> Self {
        Self { no_frames: self.no_frames || no_frames, ..self }
    }

    /// The same with tables of the user's own beside the latents.
    pub(super) fn joined(self, tables: &[PathBuf]) -> Self {
        Self { table: TableInput { join: tables.to_vec(), ..self.table }, ..self }
    }
}

impl TableInput {
    /// What is asked of the table of latents; `columns` are those that the verb has a use for.
    fn asked(&self, columns: &[String]) -> anyhow::Result<Asked> {
        let rows = self.rows.as_deref().map(str::parse).transpose().map_err(|e: RowsError| wrong(e.to_string()))?;
        Ok(Asked { rows, joins: self.join.clone(), columns: columns.to_vec(), recording: self.recording.clone() })
    }
}

/// Opened inputs.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) latents: Latents,
    /// What was taken away from the latents, which others that they are compared with must lack, too.
    pub(super) origin: Origin,
    pub(super) path: PathBuf,
    pub(super) out: PathBuf,
    pub(super) seed: u64,
    pub(super) outcome: Outcome,
    /// The user's own columns that the verb asked for.
    pub(super) columns: Vec<(String, UserColumn)>,
    input: Input,
    about: Value,
}

impl Session {
    /// Reads the latents and makes the output folder. `verb` and `options` go into every output.
    pub(super) fn open(input: &Input, globals: &Globals, verb: &str, options: Value) -> anyhow::Result<Self> {
        Self::open_with(input, globals, verb, options, &[])
    }

    /// The same, with columns of the user's own beside the latents.
    pub(super) fn open_with(
        input: &Input,
        globals: &Globals,
        verb: &str,
        options: Value,
        columns: &[String],
    ) -> anyhow::Result<Self> {
        let table = &input.table;
        let named = table.latents.clone().or_else(|| table.input.clone());
        let (path, how) = match &named {
            Some(path) if path.is_dir() => (newest_latents(path)?, " (the newest latents*.arrow there)"),
            Some(path) => (path.clone(), ""),
            None => (
                newest_latents(Path::new("."))?.strip_prefix(".").map(Path::to_path_buf).unwrap_or_default(),
                " (the newest latents*.arrow; name others with --latents)",
            ),
        };
        let (ReadLatents { latents, columns, remarks }, origin) = read_with_origin(&path, &table.asked(columns)?)?;
        say(
            globals,
            format_args!("latents: {}{how}, {} rows of {} dimensions", path.display(), latents.len(), latents.dims),
        );
        let out = table.output.clone().unwrap_or_else(|| path.parent().unwrap_or(Path::new("")).join("figures"));
        let options = relative_paths(options, &out);
        let place = |path: &PathBuf| relative_place(path, &out);
        let about = json!({
            "program": "vibes-analyze", "version": env!("CARGO_PKG_VERSION"), "verb": verb, "options": options, "seed": table.seed,
            "latents": place(&path), "rows": latents.len(), "where": table.rows, "dims": latents.dims,
            "checkpoint": latents.source.checkpoint, "note": table.note,
            // What was named beside the latents: the same numbers need the same tables and the same recording again.
            "join": table.join.iter().map(place).collect::<Vec<_>>(), "recording": table.recording.as_ref().map(place), "no_frames": input.no_frames,
        });
        let outcome = Outcome { remarks, ..Outcome::default() };
        let (seed, input) = (table.seed, input.clone());
        let session = Self { latents, origin, path, out, seed, outcome, columns, input, about };
        session.table().with_context(|| format!("these latents cannot be analysed: {}", session.path.display()))?;
        std::fs::create_dir_all(&session.out)
            .with_context(|| format!("cannot create the folder {}", session.out.display()))?;
        Ok(session)
    }

    /// The latents as the measures see them.
    pub(super) fn table(&self) -> Result<Table<'_>, vibes_measure::Error> {
        let l = &self.latents;
        Table::new(l.dims, &l.latent, &l.episode, &l.step)?.with_grid(&l.state, &l.distractor)
    }

    /// A generator for this run; the same seed gives the same output.
    pub(super) fn rng(&self) -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(self.seed)
    }

    /// The path of the recording: named, or found by the latents' metadata; none if nothing names one or the user wants none.
    pub(super) fn recording(&self) -> anyhow::Result<Option<PathBuf>> {
        if self.input.no_frames {
            return Ok(None);
        }
        if let Some(path) = &self.input.table.recording {
            return Ok(Some(path.clone()));
        }
        let Some(named) = &self.latents.source.recording else { return Ok(None) };
        let missing = || InputError::NoRecording { named: named.clone(), path: self.path.clone() };
        Ok(Some(find_recording(named, &self.path).ok_or_else(missing)?))
    }

    /// The recording's frames, if there is a recording.
    pub(super) fn frames(&self) -> anyhow::Result<Option<Frames>> {
        let Some(path) = self.recording()? else { return Ok(None) };
        Ok(Some(Frames::open(&path, &self.latents)?))
    }

    /// The recording's frames, for a verb that cannot go on without.
    pub(super) fn needed_frames(&self, what: &str) -> anyhow::Result<Frames> {
        self.frames()?.ok_or_else(|| {
            wrong(format!(
                "{what} needs the recording that the latents were encoded from; name it with --recording: {}",
                self.path.display()
            ))
        })
    }

    /// The user's note.
    pub(super) fn note(&self) -> Option<&str> {
        self.input.table.note.as_deref()
    }

    /// Puts the latents about the origin of others, which they are placed among.
    pub(super) fn move_to(&mut self, others: &Origin) {
        if self.origin != *others {
            self.origin.move_to(others, &mut self.latents);
            self.origin = others.clone();
            self.remark(MOVED);
        }
    }

    /// Says in every output that is still to be written how the map was made that the verb draws on.
    pub(super) fn name_map(&mut self, how: Value) {
        self.about["map"] = how;
    }

    /// Whether the user asked for some of the rows only.
    pub(super) fn chooses_rows(&self) -> bool {
        self.input.table.rows.is_some()
    }

    /// Whether the user asked to go on without the recording.
    pub(super) fn without_frames(&self) -> bool {
        self.input.no_frames
    }

    /// A heading with the user's note.
    pub(super) fn heading(&self, title: impl Into<String>) -> Heading {
        Heading::new(title).with_note(self.input.table.note.clone())
    }

    /// Writes a figure and lists its files, or says why it is left out. Where another of this session has the name already, as that of a user's column called like one of ours, it is numbered.
    pub(super) fn save(&mut self, figure: &Figure, stem: &str) -> anyhow::Result<()> {
        let is_taken = |name: &str| self.outcome.files.contains(&self.out.join(format!("{name}.png")));
        let numbered = (2..).map(|number| format!("{stem}-{number}"));
        let free = std::iter::once(stem.to_owned()).chain(numbered).find(|name| !is_taken(name));
        self.outcome.save(figure, &self.out, free.as_deref().unwrap_or(stem))
    }

    /// Writes numbers as `STEM.json` with a first field `about` that says where they come from, and keeps them as the verb's result.
    pub(super) fn write_json(&mut self, stem: &str, numbers: &impl Serialize) -> anyhow::Result<()> {
        let path = self.out.join(format!("{stem}.json"));
        let document = output::document(&self.about, numbers)?;
        output::write_json(&path, &document)?;
        self.outcome.files.push(path);
        self.outcome.json = document;
        Ok(())
    }

    /// Writes numbers as the table `STEM.arrow`, which names the latents.
    pub(super) fn write_arrow(&mut self, stem: &str, columns: &[(&str, Column)]) -> anyhow::Result<()> {
        let path = self.out.join(format!("{stem}.arrow"));
        output::write_table(&path, columns, &[("vibes.latents", relative_place(&self.path, &self.out))])?;
        self.outcome.files.push(path);
        Ok(())
    }

    /// Says something that the reader of the result must know.
    pub(super) fn remark(&mut self, text: impl Into<String>) {
        self.outcome.remarks.push(text.into());
    }

    /// Ends the verb with its line of result.
    pub(super) fn finish(mut self, line: impl Into<String>) -> Outcome {
        self.outcome.line = line.into();
        self.outcome
    }
}

/// Options that name files or folders.
const PATHS: [&str; 8] =
    ["tables", "fit", "fit_join", "fit_recording", "rotated", "rotated_recording", "onto", "onto_latents"];

/// Options with what they name seen from the folder `out`, so that outputs can be moved together with it.
pub(super) fn relative_paths(options: Value, out: &Path) -> Value {
    fn place(value: Value, out: &Path) -> Value {
        match value {
            Value::String(path) => json!(relative_place(Path::new(&path), out)),
            Value::Array(paths) => paths.into_iter().map(|path| place(path, out)).collect(),
            other => other,
        }
    }
    let Value::Object(entries) = options else { return options };
    let entry = |(key, value): (String, Value)| {
        let is_path = PATHS.contains(&key.as_str());
        (key, if is_path { place(value, out) } else { relative_paths(value, out) })
    };
    entries.into_iter().map(entry).collect()
}
