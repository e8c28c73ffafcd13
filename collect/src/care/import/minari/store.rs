//! Where a Minari dataset's columns lie: one HDF5 file with a group an episode, or a folder an episode with an Arrow table.
//!
//! Layout: `minari/dataset/_storages/hdf5_storage.py` and `arrow_storage.py`. HDF5 has T rows of actions and rewards; Arrow pads them to the T + 1 of the
//! observations.

use std::path::{Path, PathBuf};

use arrow::array::{Array as _, ArrayRef, ArrowPrimitiveType, AsArray, RecordBatch};
use arrow::datatypes::{
    DataType, Float16Type, Float32Type, Float64Type, Int8Type, Int16Type, Int32Type, Int64Type, UInt8Type, UInt16Type,
    UInt32Type, UInt64Type,
};
use hdf5_pure::{AttrValue, DType, Datatype, DatatypeByteOrder};
use image::ImageReader;
use serde_json::{Value, json};
use vibes_data::{ImageSize, read_table};
use vibes_env::videos::picture::is_whole_jpeg;

use super::super::array::{Array, Kind};
use super::super::channels_last;
use crate::error::{Error, Result};

/// Deflate makes at most this many bytes of one.
const DEFLATE_AT_MOST: u64 = 1040;

/// The dataset's files.
pub(super) enum Store {
    Arrow { folder: PathBuf },
    Hdf5 { path: PathBuf, file: hdf5_pure::File, bytes: u64 },
}

/// One episode's columns.
pub(super) enum EpisodeStore {
    Arrow { path: PathBuf, table: RecordBatch },
    Hdf5 { path: PathBuf, group: hdf5_pure::Group, bytes: u64 },
}

impl Store {
    pub(super) fn open(folder: &Path, format: &str) -> Result<Self> {
        match format {
            "arrow" => Ok(Self::Arrow { folder: folder.to_owned() }),
            "hdf5" => {
                let path = folder.join("main_data.hdf5");
                let bytes = std::fs::metadata(&path).map_err(Error::io("open", &path))?.len();
                let file = hdf5_pure::File::open_streaming(&path).map_err(broken(&path))?;
                Ok(Self::Hdf5 { path, file, bytes })
            }
            other => {
                let fact = format!("the storage is {other}");
                let expected = "hdf5 and arrow are read; in Python: minari.create_dataset_from_buffers(..., data_format=\"arrow\")";
                Err(Error::malformed(folder.join("metadata.json"), fact, expected))
            }
        }
    }

    /// The file that holds an episode.
    pub(super) fn path(&self, place: u32) -> PathBuf {
        match self {
            Self::Arrow { folder } => folder.join(place.to_string()).join("part-0.arrow"),
            Self::Hdf5 { path, .. } => path.clone(),
        }
    }

    pub(super) fn episode(&self, place: u32) -> Result<EpisodeStore> {
        let path = self.path(place);
        match self {
            Self::Arrow { .. } => {
                let batches = read_table(&path)?;
                let [table] = batches.try_into().map_err(|batches: Vec<_>| {
                    Error::malformed(&path, format!("{} record batches", batches.len()), "one, as Minari writes it")
                })?;
                Ok(EpisodeStore::Arrow { path, table })
            }
            Self::Hdf5 { file, bytes, .. } => {
                let group = file.group(&format!("episode_{place}")).map_err(broken(&path))?;
                Ok(EpisodeStore::Hdf5 { path, group, bytes: *bytes })
            }
        }
    }
}

impl EpisodeStore {
    fn path(&self) -> &Path {
        match self {
            Self::Arrow { path, .. } | Self::Hdf5 { path, .. } => path,
        }
    }

    /// Number of actions.
    pub(super) fn steps(&self, rewards: &Array) -> usize {
        match self {
            Self::Arrow { .. } => rewards.rows().saturating_sub(1),
            Self::Hdf5 { .. } => rewards.rows(),
        }
    }

    /// A column, by the names from the episode down.
    pub(super) fn array(&self, names: &[String]) -> Result<Array> {
        let name = names.join("/");
        let refused = |fact: String| Error::malformed(self.path(), fact, "the columns that the dataset's spaces name");
        match self {
            Self::Arrow { table, .. } => {
                let column = column(table, names).ok_or_else(|| refused(format!("no column {name}")))?;
                if column.null_count() > 0 {
                    return Err(refused(format!("{} missing values in {name}", column.null_count())));
                }
                from_arrow(&column).ok_or_else(|| refused(format!("{name} of type {}", column.data_type())))
            }
            Self::Hdf5 { group, bytes, path } => {
                let dataset = group.dataset(&name).map_err(broken(path))?;
                from_hdf5(&dataset, *bytes).map_err(|fact| refused(format!("{name}: {fact}")))
            }
        }
    }

    /// Pictures `[rows, height, width, 3]`, from numbers, which may have their channels first, or from JPEGs.
    pub(super) fn pictures(
        &self,
        names: &[String],
        (size, channels_first): (ImageSize, bool),
        rows: usize,
    ) -> Result<Vec<u8>> {
        let name = names.join("/");
        let refused = |fact: String| Error::malformed(self.path(), fact, "pictures of the size that the space says");
        if let Self::Arrow { table, .. } = self
            && let Some(column) = column(table, names)
            && let Some(files) = column.as_binary_opt::<i32>()
        {
            let files = (0..rows).map(|row| if row < files.len() { files.value(row) } else { &[] });
            let decoded: std::result::Result<Vec<Vec<u8>>, String> = files.map(|file| jpeg(file, size)).collect();
            return Ok(decoded.map_err(|fact| refused(format!("{name}: {fact}")))?.concat());
        }
        let array = self.array(names)?;
        if array.kind != Kind::U8 {
            return Err(refused(format!("{name} is {}, not uint8", array.kind.name())));
        }
        // JPEGs of one length become a table of bytes.
        if array.shape.len() == 2 && array.width() != size.bytes() && array.rows() >= rows {
            let decoded: std::result::Result<Vec<Vec<u8>>, String> =
                (0..rows).map(|row| jpeg(array.bytes(row, row + 1), size)).collect();
            return Ok(decoded.map_err(|fact| refused(format!("{name}: {fact}")))?.concat());
        }
        if array.rows() < rows || array.width() != size.bytes() {
            return Err(refused(format!("{name} of shape {:?}", array.shape)));
        }
        let bytes = array.bytes(0, rows);
        Ok(if channels_first { channels_last(bytes, size.bytes() / 3) } else { bytes.to_vec() })
    }

    /// What is below `infos`, by name; nothing where it cannot be listed.
    pub(super) fn infos(&self) -> Vec<String> {
        let names: Vec<String> = match self {
            Self::Arrow { table, .. } => table
                .column_by_name("infos")
                .and_then(|infos| infos.as_struct_opt())
                .map_or_else(Vec::new, |infos| infos.column_names().into_iter().map(str::to_owned).collect()),
            Self::Hdf5 { group, .. } => {
                let infos = group.group("infos").ok();
                let listed = infos.map(|infos| [infos.groups(), infos.datasets()].into_iter().flatten().flatten());
                listed.into_iter().flatten().collect()
            }
        };
        names.into_iter().map(|name| format!("infos/{name}")).collect()
    }

    /// What the episode says of itself.
    pub(super) fn metadata(&self) -> Result<Value> {
        match self {
            Self::Arrow { path, .. } => {
                let file = path.with_file_name("metadata.json");
                let text = std::fs::read(&file).map_err(Error::io("read", &file))?;
                serde_json::from_slice(&text).map_err(|error| Error::malformed(&file, error.to_string(), "valid JSON"))
            }
            Self::Hdf5 { group, path, .. } => {
                let attributes = group.attrs().map_err(broken(path))?;
                Ok(match attributes.get("seed") {
                    Some(AttrValue::I64(seed)) => json!({ "seed": seed }),
                    _ => json!({}),
                })
            }
        }
    }
}

fn broken(path: &Path) -> impl Fn(hdf5_pure::Error) -> Error {
    let path = path.to_owned();
    move |error| Error::malformed(path.clone(), error.to_string(), "a whole HDF5 file of a Minari dataset")
}

fn column(table: &RecordBatch, names: &[String]) -> Option<ArrayRef> {
    let (first, below) = names.split_first()?;
    let mut column = table.column_by_name(first)?.clone();
    for name in below {
        column = column.as_struct_opt()?.column_by_name(name)?.clone();
    }
    Some(column)
}

/// Numbers, or lists of one size of them.
fn from_arrow(column: &ArrayRef) -> Option<Array> {
    if let Some(list) = column.as_fixed_size_list_opt() {
        let inner = from_arrow(list.values())?;
        let width = usize::try_from(list.value_length()).ok()?;
        return Array::new(inner.kind, vec![list.len(), width], inner.data);
    }
    fn bytes<T: ArrowPrimitiveType>(column: &ArrayRef) -> Vec<u8> {
        column.as_primitive::<T>().values().inner().as_slice().to_vec()
    }
    let (kind, data) = match column.data_type() {
        DataType::Float16 => (Kind::F16, bytes::<Float16Type>(column)),
        DataType::Float32 => (Kind::F32, bytes::<Float32Type>(column)),
        DataType::Float64 => (Kind::F64, bytes::<Float64Type>(column)),
        DataType::Int8 => (Kind::I8, bytes::<Int8Type>(column)),
        DataType::Int16 => (Kind::I16, bytes::<Int16Type>(column)),
        DataType::Int32 => (Kind::I32, bytes::<Int32Type>(column)),
        DataType::Int64 => (Kind::I64, bytes::<Int64Type>(column)),
        DataType::UInt8 => (Kind::U8, bytes::<UInt8Type>(column)),
        DataType::UInt16 => (Kind::U16, bytes::<UInt16Type>(column)),
        DataType::UInt32 => (Kind::U32, bytes::<UInt32Type>(column)),
        DataType::UInt64 => (Kind::U64, bytes::<UInt64Type>(column)),
        DataType::Boolean => (Kind::Bool, column.as_boolean().values().iter().map(u8::from).collect()),
        _ => return None,
    };
    Array::new(kind, vec![column.len()], data)
}

fn from_hdf5(dataset: &hdf5_pure::Dataset, file_bytes: u64) -> std::result::Result<Array, String> {
    let text = |error: hdf5_pure::Error| error.to_string();
    let shape = dataset.shape().map_err(text)?;
    let kind = dataset.dtype().map_err(text)?;
    let element = dataset.element_size().map_err(text)?;
    let most = if dataset.is_chunked() { file_bytes.saturating_mul(DEFLATE_AT_MOST) } else { file_bytes };
    let bytes = shape.iter().try_fold(element, |bytes, &side| bytes.checked_mul(side));
    if bytes.is_none_or(|bytes| bytes > most) {
        return Err(format!("shape {shape:?} in so small a file"));
    }
    // A chunk is allocated whole before it is read.
    let chunk = dataset.chunk_shape().map_err(text)?.unwrap_or_default();
    let chunk_bytes = chunk.iter().try_fold(element, |bytes, &side| bytes.checked_mul(side));
    if chunk_bytes.is_none_or(|bytes| bytes > most) {
        return Err(format!("chunks of shape {chunk:?} in so small a file"));
    }
    // So are its stored bytes. An index that cannot be listed is read, or refused, with the numbers.
    if dataset.chunks().is_ok_and(|chunks| chunks.iter().any(|chunk| chunk.storage_size > file_bytes)) {
        return Err("a chunk longer than the file".into());
    }
    let shape: Vec<usize> = shape.into_iter().map(|side| side as usize).collect();
    fn all<T: Copy, const N: usize>(values: Vec<T>, bytes: fn(T) -> [u8; N]) -> Vec<u8> {
        values.into_iter().flat_map(bytes).collect()
    }
    let (kind, data) = match kind {
        DType::F32 => (Kind::F32, all(dataset.read_f32().map_err(text)?, f32::to_le_bytes)),
        DType::F64 => (Kind::F64, all(dataset.read_f64().map_err(text)?, f64::to_le_bytes)),
        DType::U8 => (Kind::U8, dataset.read_u8().map_err(text)?),
        DType::I8 | DType::I16 | DType::I32 | DType::I64 | DType::U16 | DType::U32 => {
            (Kind::I64, all(dataset.read_i64().map_err(text)?, i64::to_le_bytes))
        }
        DType::U64 => (Kind::U64, all(dataset.read_u64().map_err(text)?, u64::to_le_bytes)),
        // NumPy's bool is stored as the enumeration FALSE, TRUE.
        DType::Enum(_) if element == 1 => (Kind::Bool, dataset.read_raw().map_err(text)?),
        DType::Other(other) if half_order(&other).is_some() => {
            let mut data = dataset.read_raw().map_err(text)?;
            if half_order(&other) == Some(DatatypeByteOrder::BigEndian) {
                data.chunks_exact_mut(2).for_each(<[u8]>::reverse);
            }
            (Kind::F16, data)
        }
        DType::Other(other) if matches!(*other, Datatype::VariableLength { .. }) => {
            let advice = "pictures as JPEGs of different lengths cannot be read from HDF5; save the dataset with jpeg_encoding=False";
            return Err(format!("rows of different lengths; {advice}"));
        }
        other => return Err(format!("type {other}; float16, float32, float64, integers and bool are read")),
    };
    Array::new(kind, shape.clone(), data).ok_or_else(|| format!("fewer numbers than its shape {shape:?}"))
}

/// The order of a float16's bytes; none for another type, such as a bfloat16.
fn half_order(of: &Datatype) -> Option<DatatypeByteOrder> {
    match of {
        Datatype::FloatingPoint { size: 2, byte_order, layout } if layout.exponent_size == 5 => Some(*byte_order),
        _ => None,
    }
}

fn jpeg(file: &[u8], size: ImageSize) -> std::result::Result<Vec<u8>, String> {
    if !is_whole_jpeg(file) {
        return Err("a JPEG that is cut off, or none".into());
    }
    let mut reader = ImageReader::with_format(std::io::Cursor::new(file), image::ImageFormat::Jpeg);
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(size.width);
    limits.max_image_height = Some(size.height);
    reader.limits(limits);
    let picture = reader.decode().map_err(|error| error.to_string())?.into_rgb8();
    if (picture.height(), picture.width()) != (size.height, size.width) {
        return Err(format!("a picture of {} x {}", picture.height(), picture.width()));
    }
    Ok(picture.into_raw())
}
