//! Inputs from public bug reports of people who do this job: each was once taken wrongly, and its right value is held here.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[allow(dead_code, reason = "each test file uses a part of it")]
#[path = "process/numpy.rs"]
mod numpy;
#[allow(dead_code, reason = "each test file uses a part of it")]
#[path = "../../data/tests/synthetic/mod.rs"]
mod synthetic;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use hdf5_pure::{Datatype, DatatypeByteOrder, FileBuilder, FloatingPointLayout};
use vibes_collect::care::export::{ExportFormat, export};
use vibes_collect::care::import::{ImportFormat, ImportOptions, import};
use vibes_data::{Episode, Recording, RecordingWriter, verify_recording};

use numpy::{npy, npz, singles};
use synthetic::{episode, episodes, info, manifest, spec};

fn read(set: &Path) -> Result<(Recording, Vec<Episode>), String> {
    let out = set.with_extension("recording");
    let _ = fs::remove_dir_all(&out);
    let options = ImportOptions::default();
    let (recording, _) = import(ImportFormat::Dreamer, set, &options, &out).map_err(|error| error.to_string())?;
    let found = episodes(&recording);
    Ok((recording, found))
}

fn folder(within: &Path, name: &str) -> std::path::PathBuf {
    let path = within.join(name);
    fs::create_dir_all(&path).unwrap();
    path
}

/// A replay chunk of DreamerV3: row t of `rows` has the observation t, the action 100 + t chosen after it and the reward 10 t that came with it.
fn chunk(path: &Path, rows: std::ops::Range<usize>, firsts: &[usize]) {
    let flags: Vec<u8> = rows.clone().map(|row| u8::from(firsts.contains(&row))).collect();
    // The last row of an episode is the one before the next begins.
    let last: Vec<u8> = rows.clone().map(|row| u8::from(firsts.contains(&(row + 1)))).collect();
    let numbers = |of: fn(usize) -> f32| singles(&rows.clone().map(of).collect::<Vec<f32>>());
    let length = format!("{},", rows.len());
    let arrays = [
        ("action", npy("<f4", &format!("{}, 1", rows.len()), &numbers(|row| 100.0 + row as f32))),
        ("reward", npy("<f4", &length, &numbers(|row| 10.0 * row as f32))),
        ("height", npy("<f4", &length, &numbers(|row| row as f32))),
        ("is_first", npy("|b1", &length, &flags)),
        ("is_last", npy("|b1", &length, &last)),
        ("is_terminal", npy("|b1", &length, &last)),
        ("dyn/deter", npy("<f4", &format!("{}, 2", rows.len()), &vec![0; 8 * rows.len()])),
        ("stepid", npy("|u1", &format!("{}, 20", rows.len()), &vec![0; 20 * rows.len()])),
    ];
    npz(path, &arrays, false);
}

/// Two chunks of 10 and 6 rows hold episodes of 7 and 9 rows: the second goes on in the second chunk.
#[test]
fn dreamer_v3_chunks_are_joined_and_their_actions_stand_where_they_were_chosen() {
    let within = tempfile::tempdir().unwrap();
    let set = folder(within.path(), "chunks");
    // The names sort the other way round: what follows what is said by the names, not by their order.
    chunk(&set.join("20240101T000009F000001-aaaa-bbbb-10.npz"), 0..10, &[0, 7, 16]);
    chunk(&set.join("20240101T000005F000001-bbbb-0000-6.npz"), 10..16, &[16]);
    let (recording, found) = read(&set).unwrap();
    assert_eq!(verify_recording(&recording), []);
    assert_eq!(found.len(), 2);
    let rows = |range: std::ops::Range<usize>, scale: f32, plus: f32| -> Vec<f32> {
        range.map(|row| scale * row as f32 + plus).collect()
    };
    for (episode, first, end) in [(&found[0], 0, 7), (&found[1], 7, 16)] {
        assert_eq!(episode.observations, rows(first..end, 1.0, 0.0));
        assert_eq!(episode.actions, rows(first..end - 1, 1.0, 100.0), "the action chosen after each observation");
        assert_eq!(episode.rewards, rows(first + 1..end, 10.0, 0.0), "the reward that came with the next one");
        assert!(episode.is_terminal);
    }
}

#[test]
fn a_chunk_that_is_not_what_its_name_says_and_a_mixed_folder_are_refused() {
    let within = tempfile::tempdir().unwrap();
    let set = folder(within.path(), "short");
    chunk(&set.join("20240101T000000F000001-aaaa-0000-12.npz"), 0..10, &[0]);
    let error = read(&set).unwrap_err();
    assert!(error.contains("10 rows, its name says 12"), "{error}");
    let set = folder(within.path(), "mixed");
    chunk(&set.join("20240101T000000F000001-aaaa-0000-10.npz"), 0..10, &[0]);
    chunk(&set.join("20200101T000000-abcd-10.npz"), 0..10, &[0]);
    let error = read(&set).unwrap_err();
    assert!(error.contains("20200101T000000-abcd-10.npz") && error.contains("one kind"), "{error}");
}

/// An episode file of the older kind whose numbers are of `descr`.
fn file(path: &Path, descr: &str, number: fn(f64) -> Vec<u8>, more: &[(&str, Vec<u8>)], deflate: bool) {
    let bytes = |values: [f64; 4]| values.into_iter().flat_map(number).collect::<Vec<u8>>();
    let mut arrays = vec![
        ("action", npy(descr, "4, 1", &bytes([0.0, 0.5, -0.5, 1.0]))),
        ("reward", npy(descr, "4,", &bytes([0.0, 1.0, 2.0, 3.0]))),
        ("speed", npy(descr, "4,", &bytes([0.25, 0.5, 0.75, 1.0]))),
    ];
    arrays.extend_from_slice(more);
    npz(path, &arrays, deflate);
}

#[test]
fn every_float_of_numpy_in_either_byte_order_is_read() {
    let within = tempfile::tempdir().unwrap();
    type Kind = (&'static str, fn(f64) -> Vec<u8>);
    let kinds: [Kind; 6] = [
        ("<f2", |x| half::f16::from_f64(x).to_le_bytes().to_vec()),
        (">f2", |x| half::f16::from_f64(x).to_be_bytes().to_vec()),
        ("<f4", |x| (x as f32).to_le_bytes().to_vec()),
        (">f4", |x| (x as f32).to_be_bytes().to_vec()),
        ("<f8", |x| x.to_le_bytes().to_vec()),
        (">f8", |x| x.to_be_bytes().to_vec()),
    ];
    for (number, (descr, bytes)) in kinds.into_iter().enumerate() {
        let set = folder(within.path(), &format!("kind-{number}"));
        // What is not needed is not looked at: text and Python objects beside the numbers. savez_compressed deflates.
        let more = [("note", npy("<U2", "4,", &[0; 32])), ("info", npy("|O", "4,", b"pickled"))];
        file(&set.join("a.npz"), descr, bytes, &more, number % 2 == 1);
        let (recording, found) = read(&set).unwrap();
        assert_eq!(found[0].actions, [0.5, -0.5, 1.0], "{descr}");
        assert_eq!(found[0].rewards, [1.0, 2.0, 3.0], "{descr}");
        assert_eq!(found[0].observations, [0.25, 0.5, 0.75, 1.0], "{descr}");
        assert_eq!(recording.episodes()[0].episode_return, 6.0);
    }
}

#[test]
fn helper_files_are_no_episodes_and_numbers_are_counted() {
    let within = tempfile::tempdir().unwrap();
    let set = folder(within.path(), "set");
    for number in [1, 2, 10] {
        let speed = npy("<f4", "4,", &singles(&[number as f32; 4]));
        let arrays =
            [("action", npy("<f4", "4, 1", &singles(&[0.0; 4]))), ("reward", npy("<f4", "4,", &singles(&[0.0; 4])))];
        npz(&set.join(format!("episode-{number}.npz")), &[&arrays[..], &[("speed", speed)]].concat(), false);
        fs::write(set.join(format!("._episode-{number}.npz")), b"resource fork").unwrap();
    }
    fs::create_dir(set.join("__MACOSX")).unwrap();
    let (_, found) = read(&set).unwrap();
    let order: Vec<f32> = found.iter().map(|episode| episode.observations[0]).collect();
    assert_eq!(order, [1.0, 2.0, 10.0]);
}

#[test]
fn a_number_that_is_none_is_refused_with_episode_and_step() {
    let within = tempfile::tempdir().unwrap();
    let whole = [
        ("action", npy("<f4", "4, 2", &singles(&[0.5; 8]))),
        ("reward", npy("<f4", "4,", &singles(&[0.5; 4]))),
        ("speed", npy("<f4", "4,", &singles(&[0.5; 4]))),
    ];
    for (place, (name, shape, len)) in
        [("action", "4, 2", 8), ("reward", "4,", 4), ("speed", "4,", 4)].into_iter().enumerate()
    {
        for none in [f32::NAN, f32::INFINITY] {
            let set = folder(within.path(), &format!("{name}-{none}"));
            npz(&set.join("a.npz"), &whole, false);
            let mut values = vec![0.5; len];
            values[len / 2 + 1] = none;
            let mut broken = whole.clone();
            broken[place].1 = npy("<f4", shape, &singles(&values));
            npz(&set.join("b.npz"), &broken, false);
            let error = read(&set).unwrap_err();
            let said = if name == "speed" { "observation" } else { name };
            assert!(error.contains("episode 1") && error.contains("b.npz"), "{error}");
            assert!(error.contains(&format!("the {said} of step")), "{error}");
        }
    }
}

/// Readers of Minari fail on an episode without a step; both exports say what they leave out.
#[test]
fn an_episode_without_a_step_is_left_out_and_said() {
    let within = tempfile::tempdir().unwrap();
    let spec = spec(true);
    let writer = RecordingWriter::create_or_resume(&within.path().join("r"), manifest(&spec, None), false).unwrap();
    for (index, steps) in [(0, 5), (1, 0), (2, 4)] {
        writer.write(&episode(&spec, index, None, steps, false), info(index)).unwrap();
    }
    let recording = writer.finish().unwrap();
    assert!(recording.episodes()[1].episode_return.is_sign_positive(), "a return of -0");
    for (format, episodes, left_out) in
        [(ExportFormat::Minari, 2, 1), (ExportFormat::Lerobot, 2, 1), (ExportFormat::Parquet, 3, 0)]
    {
        let out = within.path().join(format!("{format:?}-v0"));
        let report = export(&recording, format, None, &out).unwrap();
        assert_eq!((report.episodes, report.left_out), (episodes, left_out), "{format:?}");
    }
    let minari = within.path().join("Minari-v0");
    let metadata: serde_json::Value =
        serde_json::from_slice(&fs::read(minari.join("data/metadata.json")).unwrap()).unwrap();
    assert_eq!((&metadata["total_episodes"], &metadata["total_steps"]), (&2.into(), &9.into()));
    assert!(!minari.join("data/2").exists(), "episodes are numbered without gaps");
    let back = within.path().join("back");
    let (back, _) = import(ImportFormat::Minari, &minari, &ImportOptions::default(), &back).unwrap();
    assert_eq!(back.episodes().iter().map(|entry| entry.index).collect::<Vec<_>>(), [0, 2]);
}

/// A Minari dataset of one episode of two steps in HDF5, its pictures as given and its speed as float16 in either byte order.
fn hdf5(set: &Path, order: DatatypeByteOrder, pictures: &dyn Fn(&mut hdf5_pure::GroupBuilder)) {
    let layout = FloatingPointLayout {
        bit_offset: 0,
        bit_precision: 16,
        exponent_location: 10,
        exponent_size: 5,
        mantissa_location: 0,
        mantissa_size: 10,
        exponent_bias: 15,
    };
    let bytes = |value: f32| {
        let half = half::f16::from_f32(value);
        if order == DatatypeByteOrder::BigEndian { half.to_be_bytes() } else { half.to_le_bytes() }
    };
    let speed: Vec<u8> = [0.25, 0.5, -1.5].into_iter().flat_map(bytes).collect();
    let mut file = FileBuilder::new();
    let mut episode = file.create_group("episode_0");
    let mut observations = episode.create_group("observations");
    let half = Datatype::FloatingPoint { size: 2, byte_order: order, layout };
    observations.create_dataset("speed").with_raw_data(half, speed, 3);
    pictures(&mut observations);
    episode.add_group(observations.finish());
    episode.create_dataset("actions").with_f32_data(&[0.5, -0.5]).with_shape(&[2, 1]);
    episode.create_dataset("rewards").with_f64_data(&[1.0, 2.0]);
    for name in ["terminations", "truncations"] {
        episode.create_dataset(name).with_u8_data(&[0, 0]);
    }
    let mut infos = episode.create_group("infos");
    infos.create_dataset("torque").with_f32_data(&[0.0, 1.0, 2.0]);
    episode.add_group(infos.finish());
    file.add_group(episode.finish());
    fs::write(set.join("main_data.hdf5"), file.finish().unwrap()).unwrap();
    let observations = r#"{"type": "Dict", "subspaces": {
        "eye": {"type": "Box", "dtype": "uint8", "shape": [16, 16, 3], "low": 0, "high": 255},
        "speed": {"type": "Box", "dtype": "float16", "shape": [1], "low": [-Infinity], "high": [Infinity]}}}"#;
    let action = r#"{"type": "Box", "dtype": "float32", "shape": [1], "low": [-1.0], "high": [1.0]}"#;
    let metadata = serde_json::json!({
        "total_episodes": 1, "data_format": "hdf5", "observation_space": observations, "action_space": action,
    });
    fs::write(set.join("metadata.json"), metadata.to_string()).unwrap();
}

fn read_minari(set: &Path) -> Result<Episode, String> {
    let out = set.with_extension("recording");
    let _ = fs::remove_dir_all(&out);
    let read = import(ImportFormat::Minari, set, &ImportOptions::default(), &out).map_err(|error| error.to_string())?;
    Ok(episodes(&read.0).remove(0))
}

#[test]
fn jpegs_of_one_length_and_float16_are_read_from_hdf5() {
    let within = tempfile::tempdir().unwrap();
    let mut jpeg = std::io::Cursor::new(Vec::new());
    let picture = image::RgbImage::from_pixel(16, 16, image::Rgb([200, 100, 50]));
    picture.write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
    let jpeg = jpeg.into_inner();
    let rows = |count: usize, bytes: &[u8]| bytes.repeat(count);
    for (name, order) in [("little", DatatypeByteOrder::LittleEndian), ("big", DatatypeByteOrder::BigEndian)] {
        let set = folder(within.path(), name);
        hdf5(&set, order, &|group| {
            group.create_dataset("eye").with_u8_data(&rows(3, &jpeg)).with_shape(&[3, jpeg.len() as u64]);
        });
        let episode = read_minari(&set).unwrap();
        assert_eq!(episode.observations, [0.25, 0.5, -1.5]);
        assert_eq!(episode.pixels.len(), 3 * 16 * 16 * 3);
        let is_close = |rgb: &[u8]| rgb.iter().zip([200_u8, 100, 50]).all(|(&got, made)| got.abs_diff(made) < 4);
        assert!(episode.pixels.chunks(3).all(is_close));
    }
    let set = folder(within.path(), "cut");
    let cut = &jpeg[..jpeg.len() / 2];
    hdf5(&set, DatatypeByteOrder::LittleEndian, &|group| {
        group.create_dataset("eye").with_u8_data(&rows(3, cut)).with_shape(&[3, cut.len() as u64]);
    });
    let error = read_minari(&set).unwrap_err();
    assert!(error.contains("cut off") && error.contains("episode 0"), "{error}");
    let set = folder(within.path(), "float");
    hdf5(&set, DatatypeByteOrder::LittleEndian, &|group| {
        group.create_dataset("eye").with_f32_data(&[0.5; 3 * 768]).with_shape(&[3, 16, 16, 3]);
    });
    let error = read_minari(&set).unwrap_err();
    assert!(error.contains("float32, not uint8"), "{error}");
}

/// Puts another text in the place of one in a dataset's metadata.
fn change_metadata(set: &Path, before: &str, after: &str) {
    let path = set.join("metadata.json");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(before), "{before} in {text}");
    fs::write(&path, text.replace(before, after)).unwrap();
}

/// `infos` of other programs have no place in a recording, in either storage.
#[test]
fn what_minari_keeps_beside_the_observations_is_left_out_and_said() {
    let within = tempfile::tempdir().unwrap();
    let ignored = |set: &Path| {
        let out = set.with_extension("recording");
        import(ImportFormat::Minari, set, &ImportOptions::default(), &out).unwrap().1.ignored
    };
    let set = folder(within.path(), "hdf5");
    hdf5(&set, DatatypeByteOrder::LittleEndian, &|group| {
        group.create_dataset("eye").with_u8_data(&[7; 3 * 768]).with_shape(&[3, 16, 16, 3]);
    });
    assert_eq!(ignored(&set), BTreeSet::from(["infos/torque".to_owned()]));
    let made = synthetic::recording(&within.path().join("made"), 1, 1);
    let set = within.path().join("arrow-v0");
    export(&made, ExportFormat::Minari, None, &set).unwrap();
    assert_eq!(ignored(&set), BTreeSet::new(), "what an export put there is taken");
    // Without the recording's header it is a dataset like any other.
    let foreign = within.path().join("foreign-v0");
    fs::rename(&set, &foreign).unwrap();
    change_metadata(&foreign.join("data"), "\"vibes\"", "\"other\"");
    let names = ["discount", "qpos", "qvel", "camera", "colors", "video", "frame"];
    assert_eq!(ignored(&foreign), names.iter().map(|name| format!("infos/{name}")).collect::<BTreeSet<String>>());
}

/// Environments of Atari and others that were wrapped for PyTorch have their channels first.
#[test]
fn pictures_with_channels_first_are_turned_and_nothing_to_see_is_refused() {
    let within = tempfile::tempdir().unwrap();
    let set = folder(within.path(), "planes");
    // Three rows of a plane for each colour.
    let planes: Vec<u8> = (0..9_u8).flat_map(|plane| [10 * plane; 256]).collect();
    hdf5(&set, DatatypeByteOrder::LittleEndian, &|group| {
        group.create_dataset("eye").with_u8_data(&planes).with_shape(&[3, 3, 16, 16]);
    });
    change_metadata(&set, "[16, 16, 3]", "[3, 16, 16]");
    let episode = read_minari(&set).unwrap();
    assert_eq!(episode.pixels.len(), 3 * 768);
    for (row, picture) in episode.pixels.chunks(768).enumerate() {
        let colour = [0, 1, 2].map(|channel| 10 * (3 * row as u8 + channel));
        assert!(picture.chunks(3).all(|rgb| rgb == colour), "row {row}");
    }
    let grey = folder(within.path(), "grey");
    hdf5(&grey, DatatypeByteOrder::LittleEndian, &|group| {
        group.create_dataset("eye").with_u8_data(&[7; 768]).with_shape(&[3, 16, 16, 1]);
    });
    change_metadata(&grey, "[16, 16, 3]", "[16, 16, 1]");
    assert!(read_minari(&grey).unwrap().pixels.is_empty(), "its speed is left");
    change_metadata(
        &grey,
        "\\\"Box\\\", \\\"dtype\\\": \\\"float16\\\"",
        "\\\"Text\\\", \\\"dtype\\\": \\\"float16\\\"",
    );
    let error = read_minari(&grey).unwrap_err();
    assert!(error.contains("no observation that a recording holds") && error.contains("[16, 16, 1]"), "{error}");
}

/// Where no row says that it is the first, the last ones divide a file.
#[test]
fn rows_that_are_last_divide_a_file_without_first_ones() {
    let within = tempfile::tempdir().unwrap();
    let rows = |count: usize| singles(&(0..count).map(|row| row as f32).collect::<Vec<f32>>());
    let arrays = vec![
        ("action", npy("<f4", "6, 1", &rows(6))),
        ("reward", npy("<f4", "6,", &rows(6))),
        ("speed", npy("<f4", "6,", &rows(6))),
        ("is_last", npy("|b1", "6,", &[0, 0, 1, 0, 0, 1])),
    ];
    let set = folder(within.path(), "last");
    npz(&set.join("a.npz"), &arrays, false);
    let (_, found) = read(&set).unwrap();
    let speeds: Vec<&[f32]> = found.iter().map(|episode| episode.observations.as_slice()).collect();
    assert_eq!(speeds, [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]]);
    assert_eq!(found[1].actions, [4.0, 5.0], "the zeros of the first row are dropped in each");
    let first = [&arrays[..], &[("is_first", npy("|b1", "6,", &[1, 0, 0, 0, 0, 0]))]].concat();
    npz(&set.join("a.npz"), &first, false);
    assert_eq!(read(&set).unwrap().1.len(), 1, "what says which rows are first is believed");
}

/// A column of no length, or two of one name, would be a dataset that nobody reads.
#[test]
fn what_minari_cannot_hold_is_refused_in_words() {
    let within = tempfile::tempdir().unwrap();
    let refused = |name: &str, spec: &vibes_data::Spec, said: &str| {
        let made = RecordingWriter::create_or_resume(&within.path().join(name), manifest(spec, None), false).unwrap();
        let recording = made.finish().unwrap();
        let out = within.path().join("out");
        let error = export(&recording, ExportFormat::Minari, None, &out).unwrap_err().to_string();
        assert!(error.contains(said) && error.contains("--format parquet"), "{error}");
        assert!(!out.exists());
    };
    let mut named = spec(true);
    named.observation[1].name = "pixels".to_owned();
    refused("named", &named, "named pixels");
    refused("blind", &vibes_data::Spec { observation: Vec::new(), ..spec(false) }, "neither pictures nor");
}
