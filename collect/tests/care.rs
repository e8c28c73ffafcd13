//! Taking recordings apart and joining them: laws that hold for every recording, on episodes whose every number is known.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[allow(dead_code, reason = "each test file uses a part of it")]
#[path = "../../data/tests/synthetic/mod.rs"]
mod synthetic;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use vibes_collect::Error;
use vibes_collect::care::export::{ExportFormat, export, export_until};
use vibes_collect::care::import::{ImportFormat, ImportOptions, import_until};
use vibes_collect::care::merge::{merge, merge_until, merged_parts};
use vibes_collect::care::select::{Filter, Part, write_subset, write_subsets};
use vibes_collect::care::split::{SplitBy, split};
use vibes_data::{Episode, FileTransfer, Recording, RecordingWriter, Video, verify_recording};

use synthetic::{episode, episodes, files, info, manifest, recording, spec};

/// Plain episodes under another seed and other videos.
fn plain(folder: &Path, count: u32, seed: u64, videos: &[&str]) -> Recording {
    let spec = spec(true);
    let video = |name: &&str| Video { name: (*name).into(), set: "train".into(), frames: 50 };
    let header = vibes_data::Manifest { seed, videos: videos.iter().map(video).collect(), ..manifest(&spec, None) };
    let writer = RecordingWriter::create_or_resume(folder, header, true).unwrap();
    for index in 0..count {
        let mut info = info(index);
        info.policy = if index % 2 == 0 { "random".into() } else { "planner".into() };
        writer.write(&episode(&spec, index, None, 9, index % 2 == 1), info).unwrap();
    }
    writer.finish().unwrap()
}

#[test]
fn what_is_split_is_clean_and_comes_together_again() {
    let folder = tempfile::tempdir().unwrap();
    let mut header = manifest(&spec(true), Some(vibes_data::Grid { states: 4, distractors: 5 }));
    header.options["episodes"] = 20.into();
    let path = folder.path().join("whole");
    let writer = RecordingWriter::create_or_resume(&path, header, true).unwrap();
    for index in 0..20 {
        let cell = vibes_data::Cell { state: index / 5, distractor: index % 5 };
        writer.write(&episode(&spec(true), index, Some(cell), 6, false), info(index)).unwrap();
    }
    let whole = writer.finish().unwrap();
    for (number, by) in [SplitBy::Episode, SplitBy::State, SplitBy::Distractor].into_iter().enumerate() {
        let parts = split(&whole, by, &[0.5, 0.25, 0.25], 3).unwrap();
        assert_eq!(parts, split(&whole, by, &[0.5, 0.25, 0.25], 3).unwrap(), "the same seed deals the same");
        let key = |index: u32| match by {
            SplitBy::State => index / 5,
            SplitBy::Distractor => index % 5,
            _ => index,
        };
        let keys: Vec<BTreeSet<u32>> =
            parts.iter().map(|part| part.iter().map(|&index| key(index)).collect()).collect();
        assert!(keys[0].is_disjoint(&keys[1]) && keys[1].is_disjoint(&keys[2]) && keys[0].is_disjoint(&keys[2]));
        let transfer = [FileTransfer::Link, FileTransfer::Copy][number % 2];
        let write = |place: usize| {
            let note = serde_json::json!({ "verb": "split", "part": place });
            let out = folder.path().join(format!("part-{number}-{place}"));
            let part = write_subset(&whole, &parts[place], &note, &out, transfer).unwrap();
            assert_eq!(verify_recording(&part), []);
            part
        };
        let parts: Vec<Recording> = (0..3).map(write).collect();
        let out = folder.path().join(format!("joined-{number}"));
        let (joined, report) = merge(&parts, &out, FileTransfer::Link).unwrap();
        assert!(report.kept_numbers && report.taken == 20 && report.rewritten == 0);
        assert_eq!(joined.manifest(), whole.manifest());
        assert_eq!(files(&out), files(&path), "the same bytes as before");
        let (two, _) = merge(&parts[..2], &folder.path().join(format!("two-{number}")), FileTransfer::Link).unwrap();
        assert!(two.manifest().options.get("subset").is_some(), "a part says that it is one");
    }
    let both = split(&whole, SplitBy::Both, &[0.5, 0.5], 0).unwrap();
    let cells = |part: &[u32], key: fn(u32) -> u32| -> BTreeSet<u32> { part.iter().map(|&index| key(index)).collect() };
    for key in [|index| index / 5, |index| index % 5] {
        assert!(cells(&both[0], key).is_disjoint(&cells(&both[1], key)));
    }
    for shares in [&[1.0][..], &[0.5, 0.6], &[0.5, -0.1], &[0.5, f64::NAN], &[0.99, 0.01]] {
        assert!(split(&whole, SplitBy::State, shares, 0).is_err(), "{shares:?}");
    }
}

#[test]
fn recordings_of_different_commands_are_numbered_anew_and_their_videos_found() {
    let folder = tempfile::tempdir().unwrap();
    let parts = [
        recording(&folder.path().join("grid"), 2, 2),
        plain(&folder.path().join("plain"), 3, 9, &["b", "c"]),
        plain(&folder.path().join("more"), 2, 11, &["d", "b"]),
    ];
    let out = folder.path().join("out");
    let (merged, report) = merge(&parts, &out, FileTransfer::Link).unwrap();
    assert!(!report.kept_numbers && report.taken + report.rewritten == 9);
    assert_eq!(verify_recording(&merged), []);
    assert_eq!(merged.manifest().grid, None);
    let names =
        |recording: &Recording| -> Vec<String> { recording.manifest().videos.iter().map(|v| v.name.clone()).collect() };
    assert_eq!(names(&merged), ["a", "b", "c", "d"]);
    let mut index = 0;
    for part in &parts {
        for (entry, mut before) in part.episodes().iter().zip(episodes(part)) {
            let mut after = merged.episode(index).unwrap().to_episode();
            let shown = |recording: &Recording, episode: &Episode| -> Vec<Option<(String, u32)>> {
                let name = |video: u32| names(recording)[video as usize].clone();
                episode.backgrounds.iter().map(|shown| shown.map(|shown| (name(shown.video), shown.frame))).collect()
            };
            assert_eq!(shown(part, &before), shown(&merged, &after));
            let found = &merged.episodes()[index as usize];
            assert_eq!(
                (&found.policy, found.seed, &found.model_overrides),
                (&entry.policy, entry.seed, &entry.model_overrides)
            );
            (before.index, before.cell) = (index, None);
            before.backgrounds.clear();
            after.backgrounds.clear();
            assert_eq!(before, after);
            index += 1;
        }
    }
    let notes = merged_parts(merged.manifest()).unwrap();
    assert_eq!(notes.iter().map(|part| (part.first, part.episodes)).collect::<Vec<_>>(), [(0, 4), (4, 3), (7, 2)]);
    let (again, _) =
        merge(&[merged, parts.into_iter().nth(1).unwrap()], &folder.path().join("again"), FileTransfer::Link).unwrap();
    assert_eq!(again.episodes().len(), 9, "what is there already is not doubled");
    assert_eq!(merged_parts(again.manifest()).unwrap().len(), 4, "parts of parts are kept apart");
    assert_eq!(verify_recording(&again), []);
}

#[test]
fn only_recordings_of_one_spec_are_merged() {
    let folder = tempfile::tempdir().unwrap();
    let one = recording(&folder.path().join("one"), 1, 2);
    let header = manifest(&spec(false), None);
    let writer = RecordingWriter::create_or_resume(&folder.path().join("other"), header, false).unwrap();
    let other = writer.finish().unwrap();
    let refused = |parts: &[Recording], says: &str| {
        let error = merge(parts, &folder.path().join("out"), FileTransfer::Link).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    };
    refused(&[one.clone(), other], "another pixels");
    refused(std::slice::from_ref(&one), "two or more");
    refused(&[], "two or more");
    fs::write(folder.path().join("one/episodes/000001.arrow"), "short").unwrap();
    refused(&[one.clone(), one], "000001.arrow");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2, "nothing is left behind");
}

#[test]
fn a_filter_keeps_what_passes_every_test() {
    let folder = tempfile::tempdir().unwrap();
    let whole = recording(&folder.path().join("grid"), 3, 4);
    let kept = |filter: Filter| filter.select(&whole).unwrap();
    assert_eq!(
        kept(Filter { states: "1-2".parse().ok(), distractors: "0,3".parse().ok(), ..Filter::default() }),
        [4, 7, 8, 11]
    );
    let returns: Vec<f64> = whole.episodes().iter().map(|entry| entry.episode_return).collect();
    assert_eq!(kept(Filter { min_return: Some(returns[10]), ..Filter::default() }), [10, 11]);
    assert_eq!(kept(Filter { max_return: Some(returns[1]), ..Filter::default() }), [0, 1]);
    let error =
        Filter { policies: vec!["planner".into()], ..Filter::default() }.select(&whole).unwrap_err().to_string();
    assert!(error.contains("12 episodes") && error.contains("random") && error.contains("3 x 4"), "{error}");
    let part =
        write_subset(&whole, &[4, 7], &serde_json::json!({}), &folder.path().join("part"), FileTransfer::Link).unwrap();
    assert_eq!(episodes(&part), [whole.episode(4).unwrap().to_episode(), whole.episode(7).unwrap().to_episode()]);
    assert_eq!(part.manifest().grid, whole.manifest().grid);
    let taken = write_subset(&whole, &[4], &serde_json::json!({}), &folder.path().join("part"), FileTransfer::Link);
    assert!(taken.unwrap_err().to_string().contains("name a new folder with -o"));
}

/// Neither a merged nor an imported recording says how many episodes were asked for.
#[test]
fn what_was_merged_or_imported_comes_together_again_too() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let ones = [plain(&place("one"), 3, 9, &["a", "b"]), plain(&place("two"), 2, 11, &["b", "c"])];
    let (merged, _) = merge(&ones, &place("merged"), FileTransfer::Link).unwrap();
    let mut header = manifest(&spec(true), None);
    header.options = serde_json::json!({ "imported": { "format": "dreamer", "name": "set" }, "episodes": 0 });
    let writer = RecordingWriter::create_or_resume(&place("imported"), header, true).unwrap();
    for index in 0..5 {
        writer.write(&episode(&spec(true), index, None, 9, false), info(index)).unwrap();
    }
    for (name, whole) in [("merged", merged), ("imported", writer.finish().unwrap())] {
        let part = |of: &Recording, kept: &[u32]| {
            let out = place(&format!("{name}-{}-{kept:?}", of.episodes().len()));
            write_subset(of, kept, &serde_json::json!({ "verb": "filter" }), &out, FileTransfer::Link).unwrap()
        };
        let (first, rest) = (part(&whole, &[0, 1]), part(&whole, &[2, 3, 4]));
        let less = part(&rest, &[2, 4]);
        let (some, _) = merge(&[first.clone(), less], &place(&format!("{name}-some")), FileTransfer::Link).unwrap();
        assert_eq!(some.manifest().options["subset"]["whole"], 5, "one is missing");
        let last = part(&rest, &[3]);
        let (all, report) = merge(&[some, last], &place(&format!("{name}-all")), FileTransfer::Link).unwrap();
        assert!(report.kept_numbers && report.rewritten == 0);
        assert_eq!(all.manifest(), whole.manifest());
        let (twice, _) = merge(&[first, rest], &place(&format!("{name}-twice")), FileTransfer::Link).unwrap();
        assert_eq!(twice.manifest(), whole.manifest());
    }
}

/// Asked to stop, every verb of care ends before its next episode and leaves what was there.
#[test]
fn what_is_stopped_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let place = |name: &str| folder.path().join(name);
    let made = plain(&place("one"), 3, 9, &["a", "b"]);
    let other = plain(&place("two"), 2, 11, &["b", "c"]);
    export(&made, ExportFormat::Minari, None, &place("set-v0")).unwrap();
    let (stop, out, link) = (AtomicBool::new(true), place("out"), FileTransfer::Link);
    let note = serde_json::json!({ "verb": "filter" });
    let part = Part { kept: &[0, 1], note: &note, out: &out };
    let stopped = [
        export_until(&made, ExportFormat::Minari, None, &out, &stop).err(),
        export_until(&made, ExportFormat::Lerobot, None, &out, &stop).err(),
        export_until(&made, ExportFormat::Parquet, None, &out, &stop).err(),
        import_until(ImportFormat::Minari, &place("set-v0"), &ImportOptions::default(), &out, &stop).err(),
        merge_until(&[made.clone(), other], &out, link, &stop).err(),
        merge_until(&[made.clone(), made.clone()], &out, link, &stop).err(),
        write_subsets(&made, &[part], link, &stop).err(),
    ];
    for (place, error) in stopped.iter().enumerate() {
        assert!(matches!(error, Some(Error::Stopped)), "{place}: {error:?}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3, "the two recordings and the dataset");
}

#[test]
fn a_filter_of_nothing_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let header = manifest(&spec(false), None);
    let writer = RecordingWriter::create_or_resume(&folder.path().join("empty"), header, false).unwrap();
    let empty = writer.finish().unwrap();
    let error = Filter { min_return: Some(0.0), ..Filter::default() }.select(&empty).unwrap_err().to_string();
    assert_eq!(error, "no episode passes; the recording has no episodes");
}
