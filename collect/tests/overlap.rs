//! Recordings that hold an episode twice, under two numbers or under two distractors, and recordings that hold a damaged one: on episodes whose every number is known.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "../../data/tests/older/mod.rs"]
mod older;
#[allow(dead_code, reason = "each test file uses a part of it")]
#[path = "../../data/tests/synthetic/mod.rs"]
mod synthetic;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;
use vibes_collect::care::export::{ExportFormat, Pictures, export};
use vibes_collect::care::merge::{merge, merged_parts};
use vibes_collect::care::select::write_subset;
use vibes_collect::care::split::{SplitBy, shared_trajectories, split};
use vibes_collect::returns::Returns;
use vibes_data::{Episode, FileTransfer, Recording, RecordingWriter, verify_recording};

use older::make_older;
use synthetic::{episode, episodes, info, manifest, spec};

/// So many plain episodes, asked for as that many, each changed as the caller likes.
fn listed(folder: &Path, count: u32, change: fn(&mut Episode)) -> Recording {
    let mut header = manifest(&spec(true), None);
    header.options["episodes"] = count.into();
    header.options["folder"] = folder.file_name().unwrap().to_string_lossy().into();
    let writer = RecordingWriter::create_or_resume(folder, header, false).unwrap();
    for index in 0..count {
        let mut episode = episode(&spec(true), index, None, 9, false);
        change(&mut episode);
        writer.write(&episode, info(index)).unwrap();
    }
    writer.finish().unwrap()
}

/// The same states under another camera.
fn drawn_again(episode: &mut Episode) {
    episode.cameras.iter_mut().for_each(|camera| camera.v += 1.0);
    episode.pixels.iter_mut().for_each(|byte| *byte ^= 1);
}

#[test]
fn an_episode_that_two_recordings_hold_is_merged_to_one() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let (short, long) = (listed(&place("short"), 3, |_| {}), listed(&place("long"), 5, |_| {}));
    let parts = [short, long];
    let (merged, report) = merge(&parts, &place("merged"), FileTransfer::Link).unwrap();
    assert!(!report.kept_numbers);
    assert_eq!((report.taken, report.rewritten, report.repeated), (5, 0, 3));
    assert_eq!(episodes(&merged), episodes(&parts[1]));
    assert_eq!(verify_recording(&merged), []);
    let notes = merged_parts(merged.manifest()).unwrap();
    assert_eq!(notes.iter().map(|part| (part.first, part.episodes)).collect::<Vec<_>>(), [(0, 3), (3, 2)]);
    // Merged once more, it has nothing new to give.
    let (again, report) = merge(&[parts[1].clone(), merged], &place("again"), FileTransfer::Link).unwrap();
    assert_eq!((again.episodes().len(), report.repeated), (5, 5));
    // A view of an episode is another.
    let view = listed(&place("view"), 3, drawn_again);
    let (both, report) = merge(&[parts[0].clone(), view], &place("both"), FileTransfer::Link).unwrap();
    assert_eq!((both.episodes().len(), report.repeated), (6, 0));
}

/// What is fitted on one view must not be checked on another, and an interval must not take them for two trajectories.
#[test]
fn views_of_one_trajectory_are_divided_together_and_counted_once() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let parts = [listed(&place("one"), 6, |_| {}), listed(&place("view"), 6, drawn_again)];
    let (merged, _) = merge(&parts, &place("merged"), FileTransfer::Link).unwrap();
    assert_eq!(SplitBy::usual(&merged).unwrap(), SplitBy::State);
    assert_eq!(SplitBy::usual(&parts[0]).unwrap(), SplitBy::Episode);
    for seed in 0..5 {
        let divided = split(&merged, SplitBy::State, &[0.5, 0.5], seed).unwrap();
        let states = |part: &[u32]| part.iter().map(|index| index % 6).collect::<BTreeSet<u32>>();
        assert!(states(&divided[0]).is_disjoint(&states(&divided[1])), "{divided:?}");
        assert_eq!((divided[0].len(), divided[1].len()), (6, 6));
        assert_eq!(shared_trajectories(&merged, &divided).unwrap(), 0);
    }
    let apart: [Vec<u32>; 2] = [(0..6).collect(), (6..12).collect()];
    assert_eq!(shared_trajectories(&merged, &apart).unwrap(), 6);
    assert!(split(&merged, SplitBy::Distractor, &[0.5, 0.5], 0).is_err(), "there are no columns");
    let (one, both) = (Returns::of(&parts[0]).unwrap(), Returns::of(&merged).unwrap());
    assert_eq!(both, one, "the same mean, and no narrower an interval");
    // Without views, trajectories are dealt as episodes are.
    let by_episode = split(&parts[0], SplitBy::Episode, &[0.5, 0.5], 4).unwrap();
    assert_eq!(split(&parts[0], SplitBy::State, &[0.5, 0.5], 4).unwrap(), by_episode);
    // Two views of a single trajectory are nothing to divide, though their actions tell nobody apart.
    let note = serde_json::json!({ "verb": "filter", "episodes": "1,7" });
    let pair = write_subset(&merged, &[1, 7], &note, &place("pair"), FileTransfer::Link).unwrap();
    let error = split(&pair, SplitBy::State, &[0.5, 0.5], 0).unwrap_err().to_string();
    assert!(error.contains("1 state trajectories") && Returns::of(&pair).unwrap().returns.len() == 1, "{error}");
}

/// Readers that take all tables for one ask for one schema.
#[test]
fn what_is_made_of_older_recordings_has_one_schema() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let (older, other) = (listed(&place("older"), 2, |_| {}), listed(&place("other"), 2, drawn_again));
    make_older(older.path(), 0);
    let older = Recording::open(&place("older")).unwrap();
    let columns = |of: &Recording, index: u32| of.episode(index).unwrap().table().num_columns();
    assert_eq!(columns(&older, 0) + 1, columns(&older, 1), "an earlier version left it so");
    let (merged, report) = merge(&[older.clone(), other], &place("merged"), FileTransfer::Link).unwrap();
    assert_eq!((report.taken, report.rewritten), (1, 3), "that one is written again, to have the column");
    assert!((0..4).all(|index| columns(&merged, index) == columns(&older, 1)));
    assert_eq!(verify_recording(&merged), []);
    export(&older, ExportFormat::Parquet, Some(Pictures::Raw), &place("tables")).unwrap();
    let schema = |index: u32| {
        let file = fs::File::open(place("tables").join(format!("episodes/{index:06}.parquet"))).unwrap();
        ParquetRecordBatchReaderBuilder::try_new(file).unwrap().schema().fields().clone()
    };
    assert_eq!(schema(0), schema(1));
}

/// What is made of a damaged episode has checksums of its own, and would be sound.
#[test]
fn a_damaged_episode_is_neither_merged_nor_exported() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let (made, other) = (listed(&place("made"), 2, |_| {}), listed(&place("other"), 3, drawn_again));
    let file = place("made/episodes/000001.arrow");
    let mut bytes = fs::read(&file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&file, bytes).unwrap();
    let out = place("out");
    let export = |format: ExportFormat| export(&made, format, None, &out).err();
    let refused = [
        merge(&[other, made.clone()], &out, FileTransfer::Link).err(),
        export(ExportFormat::Minari),
        export(ExportFormat::Lerobot),
        export(ExportFormat::Parquet),
    ];
    for (place, error) in refused.iter().enumerate() {
        let said = error.as_ref().map(ToString::to_string).unwrap_or_default();
        let is_right =
            said.contains("its checksum differs from the manifest's; to mend it") && said.contains("000001.arrow");
        assert!(is_right, "{place}: {said}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "nothing is left behind");
}
