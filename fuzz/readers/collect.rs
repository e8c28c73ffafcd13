//! The readers of `vibes-data`, `vibes-env` and `vibes-collect`: recordings, tables that the programs exchange, other people's datasets, traces, and the frames of
//! a folder of videos.

#[allow(dead_code, reason = "a part of it is used here")]
#[path = "../../data/tests/synthetic/mod.rs"]
mod synthetic;

use std::fs;
use std::path::Path;

use vibes_collect::Trace;
use vibes_collect::care::export::{ExportFormat, export};
use vibes_collect::care::import::{ImportFormat, ImportOptions, import, read_dreamer_file, read_minari_folder};
use vibes_collect::distractor_trace::DistractorTrace;
use vibes_collect::stored::options_of;
use vibes_data::{
    Decoded, DecodedRow, EpisodeView, Latents, Manifest, Recording, read_episode_entry, read_mcap, read_table,
    verify_recording,
};
use vibes_env::distractors::DistractorSettings;
use vibes_env::videos::picture::decode;

use crate::readers::{Part, Reader};

/// All of them.
pub(crate) const PART: Part = Part { readers: &READERS, make };

const READERS: [Reader; 21] = [
    Reader { name: "manifest", file: "recording/manifest.json", read: manifest },
    Reader { name: "options", file: "recorded/manifest.json", read: options },
    Reader { name: "episode", file: "recording/episodes/000000.arrow", read: episode },
    Reader { name: "log", file: "recording/episodes/000000.mcap", read: log },
    Reader { name: "log_plain", file: "plain.mcap", read: log },
    Reader { name: "latents", file: "latents.arrow", read: |_, path| Latents::read(path).is_ok() },
    Reader { name: "decoded", file: "decoded.arrow", read: |_, path| Decoded::read(path).is_ok() },
    Reader { name: "npz_stored", file: "stored.npz", read: |_, path| read_dreamer_file(path).is_ok() },
    Reader { name: "npz_deflated", file: "deflated.npz", read: |_, path| read_dreamer_file(path).is_ok() },
    Reader { name: "npz_arrays", file: "arrays.npy", read: npz_of_arrays },
    Reader { name: "chunk_first", file: "chunks/20240101T000000F000001-aa-bb-4.npz", read: chunks },
    Reader { name: "chunk_next", file: "chunks/20240101T000005F000001-bb-cc-4.npz", read: chunks },
    Reader { name: "minari_metadata", file: "arrow-v0/data/metadata.json", read: minari },
    Reader { name: "minari_arrow", file: "arrow-v0/data/1/part-0.arrow", read: minari_table },
    Reader { name: "minari_hdf5", file: "hdf5-v0/data/main_data.hdf5", read: minari },
    Reader { name: "minari_jpeg", file: "jpeg-v0/data/0/part-0.arrow", read: minari_table },
    Reader { name: "exported_metadata", file: "exported-v0/data/metadata.json", read: minari },
    Reader { name: "exported_table", file: "exported-v0/data/0/part-0.arrow", read: minari_table },
    Reader { name: "trace", file: "trace.json", read: trace },
    Reader { name: "frame_png", file: "frame.png", read: frame },
    Reader { name: "frame_jpeg", file: "frame.jpg", read: frame },
];

/// Makes the valid files.
fn make(folder: &Path) {
    let at = |name: &str| folder.join(name);
    let recording = synthetic::recording(&at("recording"), 1, 1);
    make_options(&at("recorded"));
    latents().write(&at("latents.arrow")).unwrap();
    decoded().write(&at("decoded.arrow")).unwrap();
    let log = fs::read(at("recording/episodes/000000.mcap")).unwrap();
    fs::write(at("plain.mcap"), without_checksums(&log)).unwrap();
    export(&recording, ExportFormat::Minari, None, &at("exported-v0")).unwrap();
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("../collect/tests/golden");
    for name in ["arrow-v0", "hdf5-v0", "jpeg-v0"] {
        copy(&golden.join("minari").join(name), &at(name));
    }
    fs::write(at("trace.json"), small_trace(&golden)).unwrap();
    make_archives(folder);
    make_pictures(folder);
}

/// A recording that was begun, with options as `vibes-collect` writes them.
fn make_options(folder: &Path) {
    let options = serde_json::json!({
        "task": "reacher-easy", "policy": "random:1", "grid": null, "episodes": 2, "steps": 3, "action_repeat": 4, "raw_torques": false,
        "distractors": DistractorSettings::default(), "videos": "procedural", "video_set": "train", "video_count": 2, "size": 16, "look": "fast",
    });
    fs::create_dir(folder).unwrap();
    let manifest = Manifest { options, ..synthetic::manifest(&synthetic::spec(true), None) };
    manifest.write(&folder.join("manifest.json")).unwrap();
}

/// Latents of two rows.
fn latents() -> Latents {
    Latents {
        episode: vec![0, 0],
        step: vec![0, 1],
        state: vec![Some(0), None],
        distractor: vec![None, Some(1)],
        reward: vec![Some(1.0), None],
        dims: 3,
        latent: vec![0.5; 6],
        ..Latents::default()
    }
}

/// A strip of two pictures.
fn decoded() -> Decoded {
    let row = |step: u32| DecodedRow {
        step,
        recorded: vec![step as u8; 12],
        shown: vec![9; 12],
        predicted: (step > 0).then(|| vec![7; 12]),
        ..DecodedRow::default()
    };
    Decoded { size: (2, 2), rows: vec![row(0), row(1)], explained: Some(0.5), ..Decoded::default() }
}

/// Dreamer's episodes as archives and as bare arrays.
fn make_archives(folder: &Path) {
    let at = |name: &str| folder.join(name);
    for (name, method) in
        [("stored.npz", zip::CompressionMethod::Stored), ("deflated.npz", zip::CompressionMethod::Deflated)]
    {
        write_npz(&at(name), method, &npy_arrays());
    }
    fs::write(at("arrays.npy"), npy_arrays().into_iter().flat_map(|(_, bytes)| bytes).collect::<Vec<u8>>()).unwrap();
    fs::create_dir(at("chunks")).unwrap();
    for name in ["chunk_first", "chunk_next"] {
        let place = READERS.iter().find(|reader| reader.name == name).unwrap().file;
        write_npz(&at(place), zip::CompressionMethod::Stored, &npy_arrays());
    }
}

/// A picture in either format that frames of videos have.
fn make_pictures(folder: &Path) {
    let picture = image::RgbImage::from_fn(12, 9, |x, y| image::Rgb([(x * 37 + y * 11) as u8, y as u8, x as u8]));
    for name in ["frame.png", "frame.jpg"] {
        picture.save(folder.join(name)).unwrap();
    }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for file in fs::read_dir(from).unwrap() {
        let path = file.unwrap().path();
        let place = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy(&path, &place);
        } else {
            fs::copy(&path, &place).unwrap();
        }
    }
}

/// The same messages in a log that damage can reach into: not compressed, no checksums.
fn without_checksums(log: &[u8]) -> Vec<u8> {
    let options =
        mcap::WriteOptions::new().compression(None).calculate_chunk_crcs(false).calculate_data_section_crc(false);
    let mut writer = options.calculate_summary_section_crc(false).create(std::io::Cursor::new(Vec::new())).unwrap();
    for message in mcap::MessageStream::new(log).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// The first steps of a golden trace: long files hide the mutations of their heads.
fn small_trace(golden: &Path) -> String {
    let text = fs::read_to_string(golden.join("physics/reacher-easy-0.json")).unwrap();
    let mut trace: serde_json::Value = serde_json::from_str(&text).unwrap();
    for (key, rows) in [("actions", 3), ("rewards", 3), ("observations", 4), ("qpos_trace", 4)] {
        if let Some(list) = trace[key].as_array_mut() {
            list.truncate(rows);
        }
    }
    trace.to_string()
}

/// Arrays of a Dreamer episode of 4 rows.
fn npy_arrays() -> Vec<(&'static str, Vec<u8>)> {
    let npy = |descr: &str, shape: &str, bytes: usize| {
        let mut header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({shape}), }}");
        header.push_str(&" ".repeat(63 - (10 + header.len()) % 64));
        header.push('\n');
        let data: Vec<u8> = (0..bytes).map(|i| (i % 3) as u8).collect();
        [&b"\x93NUMPY\x01\x00"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes(), &data].concat()
    };
    vec![
        ("image", npy("|u1", "4, 2, 2, 3", 48)),
        ("action", npy("<f4", "4, 2", 32)),
        ("reward", npy("<f4", "4,", 16)),
        ("is_first", npy("|b1", "4,", 4)),
        ("speed", npy("<f8", "4, 1", 32)),
    ]
}

/// A zip file of arrays.
fn write_npz(path: &Path, method: zip::CompressionMethod, arrays: &[(&str, Vec<u8>)]) {
    use std::io::Write;
    let _ = fs::remove_file(path);
    let mut writer = zip::ZipWriter::new(fs::File::create(path).unwrap());
    for (name, bytes) in arrays {
        let options = zip::write::SimpleFileOptions::default().compression_method(method);
        writer.start_file(format!("{name}.npy"), options).unwrap();
        writer.write_all(bytes).unwrap();
    }
    writer.finish().unwrap();
}

/// The manifest alone, and the recording it leads to.
fn manifest(_: &Path, path: &Path) -> bool {
    let folder = path.parent().unwrap();
    let opened = Recording::open(folder);
    if let Ok(recording) = &opened {
        let _ = verify_recording(recording);
    }
    Manifest::read(path).is_ok() && opened.is_ok()
}

/// The options that a manifest holds, the names of the videos that they ask for, and one step in their world.
fn options(_: &Path, path: &Path) -> bool {
    let Ok(recording) = Recording::open(path.parent().unwrap()) else { return false };
    let Ok(options) = options_of(&recording) else { return false };
    let _ = options.videos.list(options.video_set, options.video_count);
    let Ok(mut environment) = options.environment() else { return false };
    let action = vec![0.0; environment.action_len()];
    environment.step(&action).is_ok()
}

fn episode(folder: &Path, path: &Path) -> bool {
    let _ = read_episode_entry(path);
    let _ = read_table(path);
    let _ = Recording::open(&folder.join("recording"));
    let view = EpisodeView::open(path, &synthetic::spec(true));
    view.map(|view| view.to_episode()).is_ok()
}

fn log(_: &Path, path: &Path) -> bool {
    read_mcap(path, &synthetic::spec(true)).is_ok()
}

/// The arrays of an episode one after the other, in the order of [`npy_arrays`], put into a `.npz` file here: its checksums would keep damage out of them.
fn npz_of_arrays(folder: &Path, path: &Path) -> bool {
    let bytes = fs::read(path).unwrap();
    let magic = b"\x93NUMPY";
    let starts = (0..bytes.len()).filter(|&at| bytes[at..].starts_with(magic)).chain([bytes.len()]);
    let starts: Vec<usize> = starts.collect();
    let pieces = starts.windows(2).map(|piece| bytes[piece[0]..piece[1]].to_vec());
    let arrays: Vec<_> = npy_arrays().into_iter().map(|(name, _)| name).zip(pieces).collect();
    let npz = folder.join("arrays.npz");
    write_npz(&npz, zip::CompressionMethod::Deflated, &arrays);
    read_dreamer_file(&npz).is_ok()
}

/// The whole import of replay chunks that follow each other, one of which is damaged.
fn chunks(folder: &Path, path: &Path) -> bool {
    let out = folder.join("imported");
    let _ = fs::remove_dir_all(&out);
    import(ImportFormat::Dreamer, path.parent().unwrap(), &ImportOptions::default(), &out).is_ok()
}

/// The dataset in whose `data` folder the file lies.
fn minari(_: &Path, path: &Path) -> bool {
    read_minari_folder(path.parent().unwrap()).is_ok()
}

/// The same, for a file in an episode's folder.
fn minari_table(_: &Path, path: &Path) -> bool {
    read_minari_folder(path.parent().unwrap().parent().unwrap()).is_ok()
}

/// Both kinds of traces are JSON; a trace that can be read is simulated.
fn trace(_: &Path, path: &Path) -> bool {
    let _ = DistractorTrace::read(path);
    Trace::read(path).is_ok_and(|trace| trace.replay().is_ok())
}

/// A frame of a video.
fn frame(_: &Path, path: &Path) -> bool {
    decode(&fs::read(path).unwrap()).is_ok()
}
