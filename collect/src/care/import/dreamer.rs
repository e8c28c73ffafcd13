//! Episodes as Dreamer, DreamerV2 and V-D4RL keep them: a `.npz` file each, with `image` `[L, 64, 64, 3]`, `action` `[L, A]`, `reward` `[L]`, and where there
//! are any `discount`, `is_first`, `is_last`, `is_terminal` and vector observations `[L, n]`; and the replay chunks of `DreamerV3`.
//!
//! **Alignment.** In all of them the reward of row t is the one that came with observation t, so that our `r_t` is their row t + 1. The action differs
//! ([`Convention`]). A file with several `is_first`, or without any with an `is_last` before its last row, holds several episodes; an episode of `DreamerV3` may go on in the next chunk ([`chains`]).

mod chains;
mod rows;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use vibes_data::{Episode, EpisodeInfo, ImageSize, ObservationPart, RecordingWriter, Spec};
use vibes_env::names;

use self::chains::Chain;
use self::rows::{Convention, Rows};
use super::array::{Array, Kind};
use super::npz::Npz;
use super::{
    ImportFormat, ImportOptions, ImportReport, begin, bounds_of, channels_last, check_observed, go_on, write_checked,
};
use crate::error::{Error, Result};

/// Arrays that are no observation.
const KNOWN: [&str; 7] = ["image", "action", "reward", "discount", "is_first", "is_last", "is_terminal"];

/// The arrays of one file, all of one length.
struct Chunk {
    image: Option<Array>,
    action: Array,
    reward: Array,
    discount: Option<Array>,
    is_first: Option<Array>,
    /// Looked at where nothing says which rows are first.
    is_last: Option<Array>,
    is_terminal: Option<Array>,
    vectors: Vec<(String, Array)>,
    ignored: BTreeSet<String>,
}

/// Reads a folder of files into a recording at `out`.
pub(super) fn read(source: &Path, options: &ImportOptions, out: &Path, stop: &AtomicBool) -> Result<ImportReport> {
    let files = files_of(source)?;
    let chains = chains::chains(&files)?;
    let mut bounds = None;
    for file in &files {
        go_on(stop)?;
        let action = Npz::open(file)?.needed("action")?;
        bounds_of(&action.singles(0, action.rows()), action.width(), &mut bounds);
    }
    let name = source.file_name().map_or_else(|| "dreamer".into(), |name| name.to_string_lossy().into_owned());
    let first = Chunk::read(&files[0], chains[0].convention)?;
    let spec =
        first.spec(options.spec(&name, bounds.unwrap_or_else(|| vibes_data::ActionSpec { min: vec![], max: vec![] })));
    check_observed(&spec, &first.ignored, &files[0])?;
    let writer = begin(spec.clone(), ImportFormat::Dreamer, &name, out, options.with_mcap)?;
    let mut import = Import { spec, writer, first: files[0].clone(), report: ImportReport::default() };
    for chain in &chains {
        import.chain(chain, stop)?;
    }
    import.writer.finish()?;
    Ok(import.report)
}

/// An import at work.
struct Import {
    spec: Spec,
    writer: RecordingWriter,
    /// The file whose arrays all others must have.
    first: PathBuf,
    report: ImportReport,
}

impl Import {
    /// The episodes of files that follow each other, one file at a time in memory and at most one unfinished episode.
    fn chain(&mut self, chain: &Chain, stop: &AtomicBool) -> Result<()> {
        let mut open: Option<(PathBuf, Rows)> = None;
        for file in &chain.files {
            go_on(stop)?;
            let chunk = Chunk::read(file, chain.convention)?;
            let own = chunk.spec(Spec { observation: Vec::new(), pixels: None, ..self.spec.clone() });
            if own != self.spec || chunk.action.width() != self.spec.action_len() {
                let fact = "arrays of other names or shapes";
                return Err(Error::malformed(file, fact, format!("those of {}", self.first.display())));
            }
            for segment in chunk.segments() {
                let rows = chunk.rows(segment);
                if let (Some((_, begun)), false) = (open.as_mut(), segment.is_first) {
                    begun.append(rows);
                } else {
                    let finished = open.replace((file.clone(), rows));
                    self.write(finished, chain.convention)?;
                }
            }
            self.report.ignored.extend(chunk.ignored);
        }
        self.write(open, chain.convention)
    }

    fn write(&mut self, finished: Option<(PathBuf, Rows)>, convention: Convention) -> Result<()> {
        let Some((file, rows)) = finished else { return Ok(()) };
        let episode = rows.episode(self.report.episodes as u32, self.spec.action_len(), convention);
        let info = EpisodeInfo { policy: "imported".into(), ..EpisodeInfo::default() };
        write_checked(&self.writer, &self.spec, &episode, info, &file)?;
        self.report.episodes += 1;
        self.report.rows += episode.rows() as u64;
        Ok(())
    }
}

/// The `.npz` files of a folder, in the order people count.
fn files_of(source: &Path) -> Result<Vec<PathBuf>> {
    let mut files = names::listed(source)?;
    files.retain(|path| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npz")) && path.is_file());
    if files.is_empty() {
        return Err(Error::malformed(source, "no .npz file", "a folder of Dreamer episodes"));
    }
    Ok(files)
}

/// The episodes of one file, for tests and fuzzing.
///
/// # Errors
/// [`Error::Malformed`] for a damaged file, or arrays that do not fit together.
pub fn read_dreamer_file(path: &Path) -> Result<Vec<Episode>> {
    let chunk = Chunk::read(path, Convention::ActionBefore)?;
    let width = chunk.action.width();
    let segments = chunk.segments().into_iter().enumerate();
    Ok(segments
        .map(|(index, segment)| chunk.rows(segment).episode(index as u32, width, Convention::ActionBefore))
        .collect())
}

/// Rows `from..to` of a file, one past the last; the first of them begins an episode, or goes on with that of the file before.
#[derive(Clone, Copy, Debug)]
struct Segment {
    from: usize,
    to: usize,
    is_first: bool,
}

impl Chunk {
    fn read(path: &Path, convention: Convention) -> Result<Self> {
        let mut file = Npz::open(path)?;
        let (action, reward) = (file.needed("action")?, file.needed("reward")?);
        let image = file.array("image")?;
        let is_first = file.array("is_first")?;
        let mut chunk = Self {
            discount: file.array("discount")?,
            is_last: if is_first.is_none() { file.array("is_last")? } else { None },
            is_first,
            is_terminal: file.array("is_terminal")?,
            image: image.map(|image| as_rgb(image, path)).transpose()?,
            vectors: Vec::new(),
            ignored: BTreeSet::new(),
            action,
            reward,
        };
        for name in file.names().into_iter().filter(|name| !KNOWN.contains(&name.as_str())) {
            // `DreamerV3` keeps the agent's own state beside the observations, under names such as dyn/deter.
            if name.starts_with("log_") || (convention == Convention::ActionAfter && name.contains('/')) {
                chunk.ignored.insert(name);
                continue;
            }
            match file.optional(&name)? {
                Some(array) if array.kind.is_float() && (1..=2).contains(&array.shape.len()) => {
                    chunk.vectors.push((name, array));
                }
                _ => drop(chunk.ignored.insert(name)),
            }
        }
        chunk.fault().map_or(Ok(()), |fact| Err(Error::malformed(path, fact, "arrays with one row an observation")))?;
        if convention == Convention::ActionAfter {
            chains::check_chunk(path, chunk.rows_count(), chunk.is_first.is_some())?;
        }
        Ok(chunk)
    }

    fn rows_count(&self) -> usize {
        self.reward.rows()
    }

    fn fault(&self) -> Option<String> {
        let optional = [
            ("image", &self.image),
            ("discount", &self.discount),
            ("is_first", &self.is_first),
            ("is_last", &self.is_last),
            ("is_terminal", &self.is_terminal),
        ];
        let named = [("action", &self.action), ("reward", &self.reward)].into_iter();
        let named = named.chain(optional.iter().filter_map(|(name, array)| Some((*name, array.as_ref()?))));
        let mut named = named.chain(self.vectors.iter().map(|(name, array)| (name.as_str(), array)));
        if self.rows_count() == 0 || self.reward.shape.is_empty() || self.action.width() == 0 {
            return Some(format!("{} rewards, {} numbers an action", self.rows_count(), self.action.width()));
        }
        if let Some((name, array)) =
            named.find(|(_, array)| array.shape.is_empty() || array.rows() != self.rows_count())
        {
            return Some(format!("{} rewards, but {name} of shape {:?}", self.rows_count(), array.shape));
        }
        let wide = [("reward", Some(&self.reward)), ("discount", self.discount.as_ref())];
        let wide = wide.into_iter().find(|(_, array)| array.is_some_and(|array| array.width() != 1));
        wide.map(|(name, _)| format!("several numbers a row in {name}"))
    }

    /// The spec with this file's observations.
    fn spec(&self, base: Spec) -> Spec {
        let side = |place: usize| self.image.as_ref().map_or(0, |image| image.shape[place] as u32);
        let parts = self.vectors.iter().map(|(name, array)| ObservationPart { name: name.clone(), len: array.width() });
        Spec {
            pixels: self.image.as_ref().map(|_| ImageSize { height: side(1), width: side(2) }),
            observation: parts.collect(),
            ..base
        }
    }

    /// The parts of the file that lie in one episode each.
    fn segments(&self) -> Vec<Segment> {
        let begins = |row: usize| match (&self.is_first, &self.is_last) {
            (Some(first), _) => first.is_set(row),
            (None, Some(last)) => row > 0 && last.is_set(row - 1),
            (None, None) => false,
        };
        let starts: Vec<usize> = (0..self.rows_count()).filter(|&row| row == 0 || begins(row)).collect();
        let ends = starts.iter().skip(1).copied().chain([self.rows_count()]);
        // Without flags a file is an episode.
        let is_first = |row: usize| self.is_first.is_none() || begins(row);
        starts.iter().zip(ends).map(|(&from, to)| Segment { from, to, is_first: is_first(from) }).collect()
    }

    /// The rows of a segment.
    fn rows(&self, Segment { from, to, .. }: Segment) -> Rows {
        let ended = |row: usize| {
            let discount = || self.discount.as_ref().is_some_and(|discount| !discount.is_set(row));
            self.is_terminal.as_ref().map_or_else(discount, |terminal| terminal.is_set(row))
        };
        let width: usize = self.vectors.iter().map(|(_, array)| array.width()).sum();
        let mut observations = Vec::with_capacity((to - from) * width);
        for row in from..to {
            for (_, array) in &self.vectors {
                observations.extend(array.singles(row, row + 1));
            }
        }
        Rows {
            actions: self.action.singles(from, to),
            rewards: self.reward.singles(from, to),
            discounts: match &self.discount {
                Some(discount) => discount.singles(from, to),
                None => (from..to).map(|row| f32::from(!ended(row))).collect(),
            },
            is_terminal: ended(to - 1),
            observations,
            pixels: self.image.as_ref().map_or_else(Vec::new, |image| image.bytes(from, to).to_vec()),
        }
    }
}

/// Pictures as `[rows, height, width, 3]`; those with channels first are turned.
fn as_rgb(image: Array, path: &Path) -> Result<Array> {
    match (image.kind, image.shape.as_slice()) {
        (Kind::U8, &[_, height, width, 3]) if height > 0 && width > 0 => Ok(image),
        (Kind::U8, &[rows, 3, height, width]) if height > 0 && width > 0 => {
            let data = channels_last(&image.data, height * width);
            Ok(Array { kind: Kind::U8, shape: vec![rows, height, width, 3], data })
        }
        (kind, shape) => {
            let fact = format!("image is {} of shape {shape:?}", kind.name());
            Err(Error::malformed(path, fact, "uint8 of [rows, height, width, 3]"))
        }
    }
}
