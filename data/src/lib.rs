//! What is on disk, and shared by the three programs: recordings, run folders and tables of latents, how they are written and read back.
//!
//! In: finished episodes from `vibes-collect`, metrics and latents from `vibes-train`. Out: a folder of Arrow and MCAP files with a manifest,
//! memory-mapped views of it, random windows for training; a run folder; a table of latents for analysis; one owner for each while it is written.
//! The format itself is specified in this package's `README.md`.

mod arrow_table;
mod atomic;
mod decoded;
mod digest;
mod episode;
mod error;
mod finding;
mod latents;
mod lock;
mod manifest;
mod map;
mod mcap_log;
pub mod numpy;
mod place;
mod quantity;
mod readable;
mod recording;
mod run;
mod spec;
mod updates;
mod verify;
mod view;
mod windows;
mod writer;

pub use arrow_table::{episode_schema, read_episode_entry};
pub use atomic::{sha256_hex, write_atomically};
pub use decoded::{Decoded, DecodedRow};
pub use episode::{BackgroundFrame, CameraPose, Episode, EpisodeBuilder, Frame};
pub use error::{Error, Result};
pub use finding::Finding;
pub use latents::{Latents, LatentsSource, LatentsWriter};
pub use lock::FolderLock;
pub use manifest::{Cell, EpisodeEntry, FORMAT, FileEntry, Grid, Manifest, Video};
pub use map::read_table;
pub use mcap_log::{mcap_bytes, read_mcap};
pub use place::{find_place, followed, followed_place, is_same_place, relative_place, whole};
pub use quantity::{About, Formula, Quantity};
pub use readable::Readable;
pub use recording::Recording;
pub use run::{GivenFrom, HeadStart, MODEL_FREE_FORMAT, Metrics, MetricsFile, RUN_FORMAT, RunFolder, RunInfo};
pub use spec::{ActionSpec, ImageSize, MOST_ACTION_REPEAT, MOST_EPISODES, MOST_STEPS, ObservationPart, Spec};
pub use updates::{Purpose, Windows, update_rng};
pub use verify::{check_file, verify_episode, verify_recording};
pub use view::{EpisodeView, episode_table};
pub use windows::{WindowBatch, WindowSampler};
pub use writer::{EpisodeInfo, FileTransfer, RecordingWriter};
