//! Episodes as Dreamer, DreamerV2 and V-D4RL keep them: a `.npz` file each, with `image` `[L, 64, 64, 3]`, `action` `[L, A]`, `reward` `[L]`, and where there
//! are any `discount`, `is_first`, `is_last`, `is_terminal` and vector observations `[L, n]`.
//!
//! **Alignment.** There the action and the reward of row t are those that *led to* observation t, and row 0 has zeros; so our `a_t` and `r_t` are their
//! row t + 1. A file with several `is_first` holds several episodes.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use vibes_data::{Episode, EpisodeInfo, ImageSize, ObservationPart, Spec};

use super::array::{Array, Kind};
use super::npz::Npz;
use super::{ImportFormat, ImportOptions, ImportReport, begin, bounds_of, naming, without_distractors};
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
    is_terminal: Option<Array>,
    vectors: Vec<(String, Array)>,
    ignored: BTreeSet<String>,
}

/// Reads a folder of files into a recording at `out`.
pub(super) fn read(source: &Path, options: &ImportOptions, out: &Path) -> Result<ImportReport> {
    let files = files_of(source)?;
    let mut bounds = None;
    for file in &files {
        let action = Npz::open(file)?.needed("action")?;
        bounds_of(&action.singles(0, action.rows()), action.width(), &mut bounds);
    }
    let name = source.file_name().map_or_else(|| "dreamer".into(), |name| name.to_string_lossy().into_owned());
    let first = Chunk::read(&files[0])?;
    let spec =
        first.spec(options.spec(&name, bounds.unwrap_or_else(|| vibes_data::ActionSpec { min: vec![], max: vec![] })));
    let writer = begin(spec.clone(), ImportFormat::Dreamer, &name, out, options.with_mcap)?;
    let mut report = ImportReport::default();
    for file in &files {
        let chunk = Chunk::read(file)?;
        let own = chunk.spec(Spec { observation: Vec::new(), pixels: None, ..spec.clone() });
        if own != spec || chunk.action.width() != spec.action_len() {
            let fact = "arrays of other names or shapes";
            return Err(Error::malformed(file, fact, format!("those of {}", files[0].display())));
        }
        for (from, to) in chunk.segments() {
            let episode = chunk.episode(report.episodes as u32, from, to);
            let info = EpisodeInfo { policy: "imported".into(), ..EpisodeInfo::default() };
            writer.write(&episode, info).map_err(naming(file))?;
            report.episodes += 1;
            report.rows += episode.rows() as u64;
        }
        report.ignored.extend(chunk.ignored);
    }
    writer.finish()?;
    Ok(report)
}

/// The `.npz` files of a folder, by name.
fn files_of(source: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(source).map_err(Error::io("list", source))? {
        let path = entry.map_err(Error::io("list", source))?.path();
        if path.extension().is_some_and(|ending| ending == "npz") {
            files.push(path);
        }
    }
    files.sort_unstable();
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
    let chunk = Chunk::read(path)?;
    Ok(chunk
        .segments()
        .into_iter()
        .enumerate()
        .map(|(index, (from, to))| chunk.episode(index as u32, from, to))
        .collect())
}

impl Chunk {
    fn read(path: &Path) -> Result<Self> {
        let mut file = Npz::open(path)?;
        let (action, reward) = (file.needed("action")?, file.needed("reward")?);
        let image = file.array("image")?;
        let mut chunk = Self {
            discount: file.array("discount")?,
            is_first: file.array("is_first")?,
            is_terminal: file.array("is_terminal")?,
            image: image.map(|image| as_rgb(image, path)).transpose()?,
            vectors: Vec::new(),
            ignored: BTreeSet::new(),
            action,
            reward,
        };
        for name in file.names().into_iter().filter(|name| !KNOWN.contains(&name.as_str())) {
            match file.array(&name)? {
                Some(array)
                    if array.kind.is_float() && (1..=2).contains(&array.shape.len()) && !name.starts_with("log_") =>
                {
                    chunk.vectors.push((name, array));
                }
                _ => drop(chunk.ignored.insert(name)),
            }
        }
        chunk.fault().map_or(Ok(()), |fact| Err(Error::malformed(path, fact, "arrays with one row an observation")))?;
        Ok(chunk)
    }

    fn rows(&self) -> usize {
        self.reward.rows()
    }

    fn fault(&self) -> Option<String> {
        let optional = [
            ("image", &self.image),
            ("discount", &self.discount),
            ("is_first", &self.is_first),
            ("is_terminal", &self.is_terminal),
        ];
        let named = [("action", &self.action), ("reward", &self.reward)].into_iter();
        let named = named.chain(optional.iter().filter_map(|(name, array)| Some((*name, array.as_ref()?))));
        let mut named = named.chain(self.vectors.iter().map(|(name, array)| (name.as_str(), array)));
        if self.rows() == 0 || self.reward.shape.is_empty() || self.action.width() == 0 {
            return Some(format!("{} rewards, {} numbers an action", self.rows(), self.action.width()));
        }
        if let Some((name, array)) = named.find(|(_, array)| array.shape.is_empty() || array.rows() != self.rows()) {
            return Some(format!("{} rewards, but {name} of shape {:?}", self.rows(), array.shape));
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

    /// First and last row (one past it) of each episode.
    fn segments(&self) -> Vec<(usize, usize)> {
        let begins = |row: &usize| *row == 0 || self.is_first.as_ref().is_some_and(|first| first.is_set(*row));
        let starts: Vec<usize> = (0..self.rows()).filter(begins).collect();
        let ends = starts.iter().skip(1).copied().chain([self.rows()]);
        starts.iter().copied().zip(ends).collect()
    }

    /// Rows `from..to`; actions and rewards are taken from one row later.
    fn episode(&self, index: u32, from: usize, to: usize) -> Episode {
        let ended = |row: usize| {
            let discount = || self.discount.as_ref().is_some_and(|discount| !discount.is_set(row));
            self.is_terminal.as_ref().map_or_else(discount, |terminal| terminal.is_set(row))
        };
        let width = |array: &Array| array.width();
        let mut observations =
            Vec::with_capacity((to - from) * self.vectors.iter().map(|(_, a)| width(a)).sum::<usize>());
        for row in from..to {
            for (_, array) in &self.vectors {
                observations.extend(array.singles(row, row + 1));
            }
        }
        let discounts = match &self.discount {
            Some(discount) => discount.singles(from + 1, to),
            None => (from + 1..to).map(|row| f32::from(!ended(row))).collect(),
        };
        let mut episode = Episode {
            index,
            is_terminal: to - from > 1 && ended(to - 1),
            actions: self.action.singles(from + 1, to),
            rewards: self.reward.singles(from + 1, to),
            discounts,
            observations,
            pixels: self.image.as_ref().map_or_else(Vec::new, |image| image.bytes(from, to).to_vec()),
            ..Episode::default()
        };
        without_distractors(&mut episode);
        episode
    }
}

/// Pictures as `[rows, height, width, 3]`; those with channels first are turned.
fn as_rgb(image: Array, path: &Path) -> Result<Array> {
    match (image.kind, image.shape.as_slice()) {
        (Kind::U8, &[_, height, width, 3]) if height > 0 && width > 0 => Ok(image),
        (Kind::U8, &[rows, 3, height, width]) if height > 0 && width > 0 => {
            let plane = height * width;
            let turned = |picture: &[u8]| -> Vec<u8> {
                (0..plane)
                    .flat_map(|pixel| [picture[pixel], picture[plane + pixel], picture[2 * plane + pixel]])
                    .collect()
            };
            let data = image.data.chunks_exact(3 * plane).flat_map(turned).collect();
            Ok(Array { kind: Kind::U8, shape: vec![rows, height, width, 3], data })
        }
        (_, shape) => {
            Err(Error::malformed(path, format!("image of shape {shape:?}"), "uint8 of [rows, height, width, 3]"))
        }
    }
}
