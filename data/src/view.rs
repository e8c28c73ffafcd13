//! A memory-mapped episode: typed slices into the pages of its Arrow file, with nothing copied. In: the file and the spec
//! its columns must have. Out: one row at a time, or the whole [`Episode`].

use std::path::Path;

use arrow::array::{
    Array, FixedSizeBinaryArray, FixedSizeListArray, Float32Array, Float64Array, RecordBatch, StructArray, UInt32Array,
};
use arrow::array::{AsArray, BooleanArray};
use arrow::buffer::ScalarBuffer;
use arrow::datatypes::{Float32Type, Float64Type, UInt32Type};

use crate::arrow_table::{ACTING_DISTRACTOR, episode_schema};
use crate::episode::first_not_finite;
use crate::map::{MappedTable, Pages};
use crate::{BackgroundFrame, CameraPose, Cell, Episode, Error, Result, Spec};

/// One episode in a file.
#[derive(Clone, Debug)]
pub struct EpisodeView {
    index: u32,
    cell: Option<Cell>,
    acting_distractor: Option<u32>,
    rows: usize,
    is_terminal: bool,
    actions: Columns<f32>,
    rewards: ScalarBuffer<f32>,
    discounts: ScalarBuffer<f32>,
    observations: Columns<f32>,
    qpos: Columns<f64>,
    qvel: Columns<f64>,
    pixels: Option<FixedSizeBinaryArray>,
    camera: [ScalarBuffer<f64>; 4],
    video: UInt32Array,
    frame: UInt32Array,
    colors: Columns<f32>,
    table: RecordBatch,
    pages: Pages,
}

/// A column of `len` numbers a row.
#[derive(Clone, Debug)]
struct Columns<T: arrow::datatypes::ArrowNativeType> {
    values: ScalarBuffer<T>,
    len: usize,
}

impl<T: arrow::datatypes::ArrowNativeType> Columns<T> {
    fn row(&self, row: usize) -> &[T] {
        &self.values[row * self.len..(row + 1) * self.len]
    }
}

impl EpisodeView {
    /// Maps an episode's Arrow file and checks its columns and their alignment.
    ///
    /// # Errors
    /// [`Error::Malformed`] when the file is damaged, has other columns than the spec, or breaks the alignment rule.
    pub fn open(path: &Path, spec: &Spec) -> Result<Self> {
        let (batch, pages) = checked_table(path, spec)?;
        Ok(Self::of(&batch, spec, pages))
    }

    /// Gives the memory of the rows seen so far back until they are looked at again: for whoever keeps many episodes open.
    pub fn release(&self) {
        self.pages.release();
    }

    /// Columns are taken by name after the schema has been checked, so that the types are known.
    fn of(batch: &RecordBatch, spec: &Spec, pages: Pages) -> Self {
        let rows = batch.num_rows();
        let uint = |name: &str| batch[name].as_primitive::<UInt32Type>().clone();
        let scalar = |name: &str| batch[name].as_primitive::<Float32Type>().values().clone();
        let (state, distractor) = (uint("state"), uint("distractor"));
        let cell = (state.is_valid(0) && distractor.is_valid(0))
            .then(|| Cell { state: state.value(0), distractor: distractor.value(0) });
        let acting = batch.column_by_name(ACTING_DISTRACTOR).map(|column| column.as_primitive::<UInt32Type>());
        let camera: &StructArray = batch["camera"].as_struct();
        let part = |i: usize| camera.column(i).as_primitive::<Float64Type>().values().clone();
        Self {
            index: uint("episode").value(0),
            cell,
            acting_distractor: acting.filter(|acting| acting.is_valid(0)).map(|acting| acting.value(0)),
            rows,
            is_terminal: batch["is_terminal"].as_boolean().value(rows - 1),
            actions: floats(batch["action"].as_fixed_size_list()),
            rewards: scalar("reward"),
            discounts: scalar("discount"),
            observations: batch
                .column_by_name("observation")
                .map_or_else(no_columns, |c| floats(c.as_fixed_size_list())),
            qpos: batch.column_by_name("qpos").map_or_else(no_columns, |c| doubles(c.as_fixed_size_list())),
            qvel: batch.column_by_name("qvel").map_or_else(no_columns, |c| doubles(c.as_fixed_size_list())),
            pixels: spec.pixels.map(|_| batch["pixels"].as_fixed_size_binary().clone()),
            camera: [part(0), part(1), part(2), part(3)],
            video: uint("video"),
            frame: uint("frame"),
            colors: batch.column_by_name("colors").map_or_else(no_columns, |c| floats(c.as_fixed_size_list())),
            table: batch.clone(),
            pages,
        }
    }

    /// That everything that is learned from is a finite number. Recordings may hold others (a simulator that went astray is worth looking at), so this is not part of opening.
    ///
    /// # Errors
    /// [`Error::Malformed`] naming the first action, reward or observation that is none, and the file.
    pub fn check_numbers(&self) -> Result<()> {
        let steps = self.steps();
        let columns = [
            ("action", &self.actions.values[..steps * self.actions.len], self.actions.len),
            ("reward", &self.rewards[..steps], 1),
            ("observation", &self.observations.values[..], self.observations.len),
        ];
        match columns.into_iter().find_map(|(name, values, len)| first_not_finite(name, values, len)) {
            Some(fact) => Err(Error::malformed(self.pages.path(), fact, "a finite number, to learn from")),
            None => Ok(()),
        }
    }

    /// Every column, `[T + 1]` rows, in the pages of the file: for readers that share whole columns.
    pub fn table(&self) -> &RecordBatch {
        &self.table
    }

    /// The episode's number.
    pub fn index(&self) -> u32 {
        self.index
    }

    /// Its place in the grid.
    pub fn cell(&self) -> Option<Cell> {
        self.cell
    }

    /// The distractor trajectory under which its policy acted; none for a policy that saw no picture.
    pub fn acting_distractor(&self) -> Option<u32> {
        self.acting_distractor
    }

    /// Number of rows, T + 1.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of actions, T.
    pub fn steps(&self) -> usize {
        self.rows - 1
    }

    /// Whether the last row is terminal.
    pub fn is_terminal(&self) -> bool {
        self.is_terminal
    }

    /// The action taken at step `t < T`, `[action]`.
    pub fn action(&self, t: usize) -> &[f32] {
        self.actions.row(t)
    }

    /// All actions, one after the other, `[T, action]`.
    pub fn actions(&self) -> Vec<f32> {
        (0..self.steps()).flat_map(|t| self.action(t)).copied().collect()
    }

    /// The reward earned at step `t < T`.
    pub fn reward(&self, t: usize) -> f32 {
        self.rewards[t]
    }

    /// The discount after step `t < T`.
    pub fn discount(&self, t: usize) -> f32 {
        self.discounts[t]
    }

    /// The vector observation at a row, `[observation]`.
    pub fn observation(&self, row: usize) -> &[f32] {
        self.observations.row(row)
    }

    /// The generalised positions at a row, `[qpos]`.
    pub fn qpos(&self, row: usize) -> &[f64] {
        self.qpos.row(row)
    }

    /// The generalised velocities at a row, `[qvel]`.
    pub fn qvel(&self, row: usize) -> &[f64] {
        self.qvel.row(row)
    }

    /// The picture at a row, `[height, width, 3]`; empty when the recording has none, or this row's is missing.
    pub fn pixels(&self, row: usize) -> &[u8] {
        match &self.pixels {
            Some(column) if column.is_valid(row) => column.value(row),
            _ => &[],
        }
    }

    /// The camera at a row.
    pub fn camera(&self, row: usize) -> CameraPose {
        let [r, h, v, roll] = &self.camera;
        CameraPose { r: r[row], h: h[row], v: v[row], roll: roll[row] }
    }

    /// The background at a row.
    pub fn background(&self, row: usize) -> Option<BackgroundFrame> {
        let shown = self.video.is_valid(row) && self.frame.is_valid(row);
        shown.then(|| BackgroundFrame { video: self.video.value(row), frame: self.frame.value(row) })
    }

    /// The material colours at a row, `[3 · materials]`.
    pub fn colors(&self, row: usize) -> &[f32] {
        self.colors.row(row)
    }

    /// The episode in memory.
    pub fn to_episode(&self) -> Episode {
        let rows = 0..self.rows;
        let steps = self.steps();
        Episode {
            index: self.index,
            cell: self.cell,
            acting_distractor: self.acting_distractor,
            is_terminal: self.is_terminal,
            actions: self.actions.values[..steps * self.actions.len].to_vec(),
            rewards: self.rewards[..steps].to_vec(),
            discounts: self.discounts[..steps].to_vec(),
            observations: self.observations.values.to_vec(),
            qpos: self.qpos.values.to_vec(),
            qvel: self.qvel.values.to_vec(),
            pixels: rows.clone().flat_map(|row| self.pixels(row)).copied().collect(),
            cameras: rows.clone().map(|row| self.camera(row)).collect(),
            backgrounds: rows.map(|row| self.background(row)).collect(),
            colors: self.colors.values.to_vec(),
        }
    }
}

/// A column that the spec leaves out: no numbers a row.
fn no_columns<T: arrow::datatypes::ArrowNativeType>() -> Columns<T> {
    Columns { values: ScalarBuffer::from(Vec::new()), len: 0 }
}

fn floats(list: &FixedSizeListArray) -> Columns<f32> {
    let values: &Float32Array = list.values().as_primitive::<Float32Type>();
    Columns { values: values.values().clone(), len: list.value_length() as usize }
}

fn doubles(list: &FixedSizeListArray) -> Columns<f64> {
    let values: &Float64Array = list.values().as_primitive::<Float64Type>();
    Columns { values: values.values().clone(), len: list.value_length() as usize }
}

/// An episode's columns as one record batch in the pages of its Arrow file, its columns and their alignment checked.
///
/// # Errors
/// [`Error::Malformed`] when the file is damaged, has other columns than the spec, or breaks the alignment rule.
pub fn episode_table(path: &Path, spec: &Spec) -> Result<RecordBatch> {
    Ok(checked_table(path, spec)?.0)
}

fn checked_table(path: &Path, spec: &Spec) -> Result<(RecordBatch, Pages)> {
    let table = MappedTable::open(path)?;
    let expected = episode_schema(spec).fields;
    let found = table.schema();
    let is_older = || found.fields().iter().eq(expected.iter().filter(|field| field.name() != ACTING_DISTRACTOR));
    if found.fields() != &expected && !is_older() {
        let fact = difference(found.fields(), &expected);
        return Err(Error::malformed(path, fact, "the columns of the manifest's spec"));
    }
    if table.batches() != 1 {
        return Err(Error::malformed(path, format!("{} record batches", table.batches()), "one"));
    }
    let batch = table.batch(0)?;
    check_alignment(&batch).map_err(|fact| Error::malformed(path, fact, "rows aligned as the format says"))?;
    Ok((batch, table.pages()))
}

fn difference(found: &arrow::datatypes::Fields, expected: &arrow::datatypes::Fields) -> String {
    let name = |field: Option<&std::sync::Arc<arrow::datatypes::Field>>| {
        field.map_or("nothing".into(), |field| format!("{} of type {}", field.name(), field.data_type()))
    };
    let differing = (0..found.len().max(expected.len())).find(|&i| found.get(i) != expected.get(i)).unwrap_or(0);
    format!("column {differing} is {}, not {}", name(found.get(differing)), name(expected.get(differing)))
}

/// Steps count from 0, one episode and one cell a file, flags at the ends, and no action or reward at the last row only.
fn check_alignment(batch: &RecordBatch) -> std::result::Result<(), String> {
    let rows = batch.num_rows();
    if rows == 0 {
        return Err("no rows".into());
    }
    let constant = ["episode", "state", "distractor", ACTING_DISTRACTOR].into_iter().find(|name| {
        let Some(column) = batch.column_by_name(name) else { return false };
        let column = column.as_primitive::<UInt32Type>();
        (1..rows).any(|row| column.is_valid(row) != column.is_valid(0) || column.value(row) != column.value(0))
    });
    if let Some(name) = constant {
        return Err(format!("{name} changes within the episode"));
    }
    let steps = batch["step"].as_primitive::<UInt32Type>();
    if let Some(row) = (0..rows).find(|&row| steps.value(row) as usize != row) {
        return Err(format!("row {row} is step {}", steps.value(row)));
    }
    let flag = |name: &str| -> BooleanArray { batch[name].as_boolean().clone() };
    let (first, last, terminal) = (flag("is_first"), flag("is_last"), flag("is_terminal"));
    for row in 0..rows {
        let ends = (first.value(row), last.value(row)) == (row == 0, row == rows - 1);
        if !ends || (terminal.value(row) && row != rows - 1) {
            return Err(format!("row {row} of {rows} has is_first, is_last or is_terminal out of place"));
        }
        for name in ["action", "reward", "discount"] {
            if batch[name].is_valid(row) != (row < rows - 1) {
                return Err(format!(
                    "row {row} of {rows} {} {name}",
                    if row < rows - 1 { "lacks its" } else { "has an extra" }
                ));
            }
        }
    }
    Ok(())
}
