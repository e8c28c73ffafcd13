//! Recordings to the formats of others and back, on episodes whose every number is known, and datasets that others wrote.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[allow(dead_code, reason = "each test file uses a part of it")]
#[path = "../../data/tests/synthetic/mod.rs"]
mod synthetic;

#[allow(dead_code, reason = "each test file uses a part of it")]
#[path = "process/numpy.rs"]
mod numpy;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use arrow::array::{Array, AsArray, RecordBatch};
use arrow::datatypes::{Float32Type, Float64Type, Int64Type};
use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use vibes_collect::care::export::{ExportFormat, Pictures, export};
use vibes_collect::care::import::{ImportFormat, ImportOptions, import};
use vibes_data::{Recording, RecordingWriter, verify_recording};

use numpy::{npy, npz, singles};
use synthetic::{episode, episodes, files, info, manifest, recording, spec};

/// Plain episodes, every other one terminal.
fn plain(folder: &Path, count: u32) -> Recording {
    let spec = spec(true);
    let writer = RecordingWriter::create_or_resume(folder, manifest(&spec, None), true).unwrap();
    for index in 0..count {
        writer.write(&episode(&spec, index, None, 9, index % 2 == 1), info(index)).unwrap();
    }
    writer.finish().unwrap()
}

#[test]
fn a_minari_dataset_brings_the_recording_back_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    for (name, made) in
        [("grid", recording(&folder.path().join("grid"), 2, 3)), ("plain", plain(&folder.path().join("plain"), 3))]
    {
        let (set, back) = (folder.path().join(format!("{name}-v0")), folder.path().join(format!("{name}-back")));
        let report = export(&made, ExportFormat::Minari, None, &set).unwrap();
        assert_eq!((report.episodes, report.rows), (made.episodes().len(), 10 * made.episodes().len() as u64));
        let options = ImportOptions { with_mcap: true, ..ImportOptions::default() };
        import(ImportFormat::Minari, &set, &options, &back).unwrap();
        assert_eq!(files(&back), files(made.path()));
    }
}

/// The datasets in `golden/minari` were written by Minari itself; see `golden/make_minari.py`.
#[test]
fn datasets_that_minari_wrote_are_read() {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/minari");
    let folder = tempfile::tempdir().unwrap();
    for storage in ["hdf5", "arrow"] {
        let out = folder.path().join(storage);
        let source = golden.join(format!("{storage}-v0"));
        let (read, report) = import(ImportFormat::Minari, &source, &ImportOptions::default(), &out).unwrap();
        assert_eq!((report.episodes, report.rows), (2, 9));
        assert_eq!(verify_recording(&read), []);
        for (number, episode) in episodes(&read).into_iter().enumerate() {
            let (steps, n) = (3 + number, number as f32);
            assert_eq!(
                episode.observations,
                (0..=steps).flat_map(|t| [t as f32 + 10.0 * n, t as f32 * 0.5]).collect::<Vec<_>>()
            );
            assert_eq!(
                episode.actions,
                (0..steps).flat_map(|t| [t as f64 * 0.1, t as f64 * -0.1].map(|a| a as f32)).collect::<Vec<_>>()
            );
            assert_eq!(episode.rewards, (0..steps).map(|t| t as f32 + 0.25 * n).collect::<Vec<_>>());
            assert_eq!(
                episode.pixels,
                (0..=steps).flat_map(|t| (0..48).map(move |i| ((t * 7 + number + i) % 256) as u8)).collect::<Vec<_>>()
            );
            assert_eq!((episode.is_terminal, episode.discounts[steps - 1]), (number == 1, [1.0, 0.0][number]));
            assert_eq!(read.episodes()[number].seed, 40 + number as u64);
            assert_eq!(read.episodes()[number].policy, "by hand");
        }
    }
    let (read, _) =
        import(ImportFormat::Minari, &golden.join("jpeg-v0"), &ImportOptions::default(), &folder.path().join("jpeg"))
            .unwrap();
    let episode = &episodes(&read)[0];
    assert_eq!(episode.actions, [0.0, 1.0, 1.0, 0.0], "choices become zeros and a one");
    assert_eq!(episode.pixels.len(), 3 * 32 * 32 * 3);
    assert!(
        episode.pixels.chunks(3).all(|rgb| rgb.iter().zip([200, 100, 50]).all(|(&got, made)| got.abs_diff(made) < 4))
    );
}

#[test]
fn dreamer_rows_are_shifted_to_the_row_where_the_action_was_taken() {
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    fs::create_dir(&set).unwrap();
    let (height, width, rows) = (2, 4, 5);
    let image: Vec<u8> = (0..rows * height * width * 3).map(|i| i as u8).collect();
    // Row t holds what led to observation t: action t and reward 10 t; row 0 has zeros.
    let action: Vec<f32> = (0..rows).flat_map(|t| [t as f32, -(t as f32)]).collect();
    let reward: Vec<f32> = (0..rows).map(|t| 10.0 * t as f32).collect();
    let common = |image_shape: &str, image: Vec<u8>| {
        vec![
            ("image", npy("|u1", image_shape, &image)),
            ("action", npy("<f4", "5, 2", &singles(&action))),
            ("reward", npy("<f4", "5,", &singles(&reward))),
            ("height", npy("<f4", "5,", &singles(&[0.5, 1.5, 2.5, 3.5, 4.5]))),
            ("log_speed", npy("<f4", "5,", &singles(&[0.0; 5]))),
        ]
    };
    let mut whole = common("5, 2, 4, 3", image.clone());
    whole.push(("is_terminal", npy("|b1", "5,", &[0, 0, 0, 0, 1])));
    npz(&set.join("a.npz"), &whole, false);
    // Channels first, two episodes in one file, discounts instead of flags.
    let turned: Vec<u8> =
        (0..rows).flat_map(|t| (0..3).flat_map(move |c| (0..8).map(move |i| (t * 24 + i * 3 + c) as u8))).collect();
    let mut pair = common("5, 3, 2, 4", turned);
    pair.push(("is_first", npy("|b1", "5,", &[1, 0, 1, 0, 0])));
    pair.push(("discount", npy("<f4", "5,", &singles(&[1.0, 0.5, 1.0, 1.0, 0.0]))));
    npz(&set.join("b.npz"), &pair, true);

    let options = ImportOptions { task: Some("made-up".into()), with_mcap: true, ..ImportOptions::default() };
    let (read, report) = import(ImportFormat::Dreamer, &set, &options, &folder.path().join("out")).unwrap();
    assert_eq!((report.episodes, report.rows), (3, 10));
    assert_eq!(report.ignored, BTreeSet::from(["log_speed".to_owned()]));
    assert_eq!(verify_recording(&read), []);
    let found = episodes(&read);
    assert_eq!(found[0].actions, action[2..]);
    assert_eq!(found[0].rewards, [10.0, 20.0, 30.0, 40.0]);
    assert_eq!(found[0].discounts, [1.0, 1.0, 1.0, 0.0]);
    assert_eq!(found[0].observations, [0.5, 1.5, 2.5, 3.5, 4.5]);
    assert_eq!((found[0].is_terminal, found[0].pixels.as_slice()), (true, image.as_slice()));
    assert_eq!(
        (found[1].rewards.as_slice(), found[1].discounts.as_slice(), found[1].is_terminal),
        (&[10.0][..], &[0.5][..], false)
    );
    assert_eq!((found[2].rewards.as_slice(), found[2].is_terminal), (&[30.0, 40.0][..], true));
    assert_eq!([&found[1].pixels[..], &found[2].pixels].concat(), image, "channels last");
    let spec = &read.manifest().spec;
    assert_eq!((spec.action.min.as_slice(), spec.action.max.as_slice()), (&[-1.0, -4.0][..], &[4.0, 1.0][..]));

    let refused = |arrays: &[(&str, Vec<u8>)], says: &str| {
        let bad = folder.path().join("bad");
        let _ = fs::remove_dir_all(&bad);
        fs::create_dir(&bad).unwrap();
        npz(&bad.join("c.npz"), arrays, true);
        let error = import(ImportFormat::Dreamer, &bad, &options, &folder.path().join("no")).unwrap_err().to_string();
        assert!(error.contains(says) && error.contains("c.npz"), "{error}");
        assert!(!folder.path().join("no").exists() && !folder.path().join(".no.making").exists());
    };
    refused(&whole[..2], "no array reward");
    refused(&[whole[1].clone(), ("reward", npy("<f4", "4,", &singles(&[0.0; 4])))], "4 rewards, but action");
    let nan = ("reward", npy("<f4", "5,", &singles(&[0.0, f32::NAN, 0.0, 0.0, 0.0])));
    refused(&[whole[1].clone(), whole[3].clone(), nan], "NaN");
    refused(&[whole[1].clone(), whole[2].clone()], "no observation that a recording holds");
    refused(&[whole[1].clone(), ("reward", npy("<f4", "4611686018427387904,", &[0; 64]))], "in so small a file");
    refused(&[whole[1].clone(), ("reward", npy("<U1", "5,", &[0; 20]))], "<U1");
}

fn parquet(path: &Path) -> RecordBatch {
    let reader = ParquetRecordBatchReaderBuilder::try_new(fs::File::open(path).unwrap())
        .unwrap()
        .with_batch_size(1 << 20)
        .build()
        .unwrap();
    let batches: Vec<RecordBatch> = reader.map(Result::unwrap).collect();
    arrow::compute::concat_batches(&batches[0].schema(), &batches).unwrap()
}

#[test]
fn parquet_keeps_every_column() {
    let folder = tempfile::tempdir().unwrap();
    let made = recording(&folder.path().join("grid"), 1, 2);
    for pictures in [Pictures::Png, Pictures::Raw] {
        let out = folder.path().join(format!("{pictures:?}"));
        export(&made, ExportFormat::Parquet, Some(pictures), &out).unwrap();
        for (entry, episode) in made.episodes().iter().zip(episodes(&made)) {
            let table = parquet(&out.join(format!("episodes/{:06}.parquet", entry.index)));
            let own = vibes_data::episode_table(&made.path().join(&entry.arrow.path), &made.manifest().spec).unwrap();
            for (field, column) in own.schema().fields().iter().zip(own.columns()) {
                if field.name() != "pixels" || pictures == Pictures::Raw {
                    assert_eq!(table[field.name().as_str()].to_data(), column.to_data(), "{}", field.name());
                }
            }
            if pictures == Pictures::Png {
                let files = table["pixels"].as_binary::<i32>();
                let picture = image::load_from_memory(files.value(3)).unwrap().into_rgb8().into_raw();
                assert_eq!(picture, &episode.pixels[3 * 72..4 * 72]);
            }
        }
    }
    assert!(export(&made, ExportFormat::Parquet, Some(Pictures::Video), &folder.path().join("no")).is_err());
}

#[test]
fn a_lerobot_dataset_counts_its_frames_and_finds_them_in_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let made = plain(&folder.path().join("plain"), 3);
    let out = folder.path().join("lerobot");
    let report = export(&made, ExportFormat::Lerobot, None, &out).unwrap();
    assert_eq!((report.episodes, report.rows), (3, 27));
    let json =
        |name: &str| -> serde_json::Value { serde_json::from_slice(&fs::read(out.join(name)).unwrap()).unwrap() };
    let (info, stats) = (json("meta/info.json"), json("meta/stats.json"));
    assert_eq!(
        (&info["fps"], &info["total_frames"], &info["codebase_version"]),
        (&12.5.into(), &27.into(), &"v3.0".into())
    );
    let frames = parquet(&out.join("data/chunk-000/file-000.parquet"));
    let whole = |name: &str| frames[name].as_primitive::<Int64Type>().values().to_vec();
    assert_eq!(whole("index"), (0..27).collect::<Vec<i64>>());
    assert_eq!(whole("episode_index"), (0..27).map(|i| i / 9).collect::<Vec<i64>>());
    let rewards: Vec<f32> = episodes(&made).iter().flat_map(|episode| episode.rewards.clone()).collect();
    assert_eq!(frames["next.reward"].as_primitive::<Float32Type>().values(), rewards.as_slice());
    let mean = rewards.iter().map(|&reward| f64::from(reward)).sum::<f64>() / 27.0;
    assert!((stats["next.reward"]["mean"][0].as_f64().unwrap() - mean).abs() < 1e-9);
    assert_eq!(stats["observation.images.camera"]["mean"].as_array().unwrap().len(), 3);
    let listed = parquet(&out.join("meta/episodes/chunk-000/file-000.parquet"));
    let seconds = |name: &str| {
        listed[format!("videos/observation.images.camera/{name}").as_str()]
            .as_primitive::<Float64Type>()
            .values()
            .to_vec()
    };
    assert_eq!(seconds("from_timestamp"), [0.0, 9.0 * 0.08, 18.0 * 0.08]);
    assert_eq!(seconds("to_timestamp")[2], 27.0 * 0.08);
    let video = fs::read(out.join("videos/observation.images.camera/chunk-000/file-000.mp4")).unwrap();
    let tops = boxes(&video);
    assert_eq!(tops.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["ftyp", "mdat", "moov"]);
    let sizes = find(&video, b"stsz");
    assert_eq!(u32::from_be_bytes(sizes[8..12].try_into().unwrap()), 27, "one sample a frame");
    let total: u64 =
        sizes[12..12 + 4 * 27].chunks(4).map(|size| u64::from(u32::from_be_bytes(size.try_into().unwrap()))).sum();
    assert_eq!(total, tops[1].1 as u64 - 16, "the samples fill the data");
}

/// The boxes at the top of a file: names and sizes, one after another to the end.
fn boxes(mut bytes: &[u8]) -> Vec<(String, usize)> {
    let mut found = Vec::new();
    while !bytes.is_empty() {
        let short = u32::from_be_bytes(bytes[..4].try_into().unwrap()) as usize;
        let size = if short == 1 { u64::from_be_bytes(bytes[8..16].try_into().unwrap()) as usize } else { short };
        found.push((String::from_utf8_lossy(&bytes[4..8]).into_owned(), size));
        bytes = &bytes[size..];
    }
    found
}

/// What follows a box's name, wherever it is.
fn find<'a>(bytes: &'a [u8], name: &[u8]) -> &'a [u8] {
    let at = bytes.windows(4).rposition(|window| window == name).unwrap();
    &bytes[at + 4..]
}
