//! Going on with a recording: what lies in its folder is taken for its own only where it is, and its files stay of one kind.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

mod older;
#[allow(dead_code, reason = "each test file uses a part of it")]
mod synthetic;

use std::fs;
use std::path::Path;

use vibes_data::{Cell, FileTransfer, Grid, Manifest, Recording, RecordingWriter, Video, verify_recording};

use older::make_older;
use synthetic::{episode, files, info, manifest, recording, spec};

/// Plain episodes of 5 steps.
fn plain(folder: &Path, count: u32, with_mcap: bool) -> Recording {
    let writer = RecordingWriter::create_or_resume(folder, manifest(&spec(true), None), with_mcap).unwrap();
    for index in (0..count).filter(|&index| !writer.has(index)) {
        writer.write(&episode(&spec(true), index, None, 5, false), info(index)).unwrap();
    }
    writer.finish().unwrap()
}

#[test]
fn episodes_without_a_manifest_are_nobody_s_to_go_on_with() {
    let folder = tempfile::tempdir().unwrap();
    recording(folder.path(), 1, 2);
    let whole = fs::read(folder.path().join("manifest.json")).unwrap();
    fs::remove_file(folder.path().join("manifest.json")).unwrap();
    let header = || manifest(&spec(true), Some(Grid { states: 1, distractors: 2 }));
    let begin = || RecordingWriter::create_or_resume(folder.path(), Manifest { seed: 8, ..header() }, true);
    let error = begin().unwrap_err().to_string();
    assert!(error.contains("episodes of another recording lie here"), "{error}");
    assert!(!folder.path().join("manifest.json").exists());
    fs::write(folder.path().join("manifest.json"), whole).unwrap();
    assert_eq!(RecordingWriter::create_or_resume(folder.path(), header(), true).unwrap().len(), 2);
}

/// A table under another number, of another cell or of other columns is a stray, and not an episode.
#[test]
fn only_tables_that_are_the_episode_of_their_number_are_adopted() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, other) = (folder.path().join("whole"), folder.path().join("other"));
    recording(&whole, 2, 2);
    let header = manifest(&spec(false), Some(Grid { states: 2, distractors: 2 }));
    let writer = RecordingWriter::create_or_resume(&other, header.clone(), false).unwrap();
    let cell = |index: u32| Cell { state: index / 2, distractor: index % 2 };
    writer.write(&episode(&spec(false), 1, Some(cell(1)), 9, false), info(1)).unwrap();
    writer.write(&episode(&spec(false), 2, Some(cell(0)), 9, false), info(2)).unwrap();
    drop(writer);
    // As a killed program leaves it.
    header.write(&other.join("manifest.json")).unwrap();
    let table = |of: &Path, index: u32| of.join(format!("episodes/{index:06}.arrow"));
    let kept = fs::read(whole.join("manifest.json")).unwrap();
    let strays_of = |change: &dyn Fn()| -> usize {
        let mut unlisted: Manifest = serde_json::from_slice(&kept).unwrap();
        unlisted.episodes.truncate(1);
        unlisted.write(&whole.join("manifest.json")).unwrap();
        change();
        let opened = Recording::open(&whole).unwrap();
        assert_eq!(opened.episodes().len() + opened.strays().len(), 4);
        opened.strays().len()
    };
    assert_eq!(strays_of(&|| {}), 0, "its own are adopted");
    let copy = |from: &Path, to: &Path| {
        fs::copy(from, to).unwrap();
    };
    assert_eq!(strays_of(&|| copy(&table(&whole, 2), &table(&whole, 3))), 1, "another number");
    assert_eq!(strays_of(&|| copy(&table(&other, 1), &table(&whole, 1))), 2, "other columns");
    // In a recording of its own columns, the table of number 2 in the cell of number 0.
    let opened = Recording::open(&other).unwrap();
    assert_eq!((opened.episodes().len(), opened.strays().len()), (1, 1));
}

#[test]
fn logs_that_are_asked_for_later_are_written_from_the_tables() {
    let folder = tempfile::tempdir().unwrap();
    let (at_once, later) = (folder.path().join("at-once"), folder.path().join("later"));
    plain(&at_once, 3, true);
    plain(&later, 2, false);
    let writer = RecordingWriter::create_or_resume(&later, manifest(&spec(true), None), true).unwrap();
    assert!(writer.lacks_log(1) && !writer.lacks_log(2), "of one that is not there nothing is missing yet");
    writer.add_log(0).unwrap();
    writer.add_log(1).unwrap();
    assert!(!writer.lacks_log(1) && writer.add_log(2).is_err());
    drop(writer.finish().unwrap());
    plain(&later, 3, true);
    assert_eq!(files(&later), files(&at_once), "as if they had been asked for at once");
    let table = later.join("episodes/000001.arrow");
    let mut bytes = fs::read(&table).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(table, bytes).unwrap();
    let writer = RecordingWriter::create_or_resume(&later, manifest(&spec(true), None), true).unwrap();
    let error = writer.add_log(1).unwrap_err().to_string();
    assert!(error.contains("its checksum differs") && error.contains("000001.arrow"), "{error}");
}

#[test]
fn a_log_that_is_no_episode_s_is_removed_or_named() {
    let folder = tempfile::tempdir().unwrap();
    plain(folder.path(), 2, true);
    let file = |name: &str| folder.path().join("episodes").join(name);
    // Its table is gone, and it is written again without a log.
    fs::remove_file(file("000001.arrow")).unwrap();
    let made = plain(folder.path(), 2, false);
    assert!(!file("000001.mcap").exists() && made.episodes()[1].mcap.is_none() && made.episodes()[0].mcap.is_some());
    assert_eq!(verify_recording(&made), []);
    for name in ["000001.mcap", "000007.mcap"] {
        fs::copy(file("000000.mcap"), file(name)).unwrap();
    }
    let named = |is_whole: bool| -> Vec<String> {
        let found = Recording::open(folder.path()).unwrap().unlisted_logs(is_whole);
        found.iter().map(|finding| finding.path.file_name().unwrap().to_string_lossy().into_owned()).collect()
    };
    assert_eq!(named(true), ["000001.mcap", "000007.mcap"]);
    assert_eq!(named(false), ["000001.mcap"], "the other may be what a killed program left");
    assert_eq!(verify_recording(&Recording::open(folder.path()).unwrap()).len(), 1);
}

/// Readers that take all tables of a recording for one ask for one schema.
#[test]
fn a_recording_keeps_the_schema_that_it_began_with() {
    let folder = tempfile::tempdir().unwrap();
    plain(folder.path(), 1, false);
    make_older(folder.path(), 0);
    let grown = plain(folder.path(), 2, false);
    assert_eq!(verify_recording(&grown), []);
    let names = |index: u32| -> Vec<String> {
        let schema = grown.episode(index).unwrap().table().schema();
        schema.fields().iter().map(|field| field.name().clone()).collect()
    };
    assert_eq!(names(0), names(1));
    assert!(!names(1).contains(&"acting_distractor".to_owned()));
    // Where it says something it is there all the same.
    let writer = RecordingWriter::create_or_resume(folder.path(), manifest(&spec(true), None), false).unwrap();
    let mut acted = episode(&spec(true), 2, None, 5, false);
    acted.acting_distractor = Some(2);
    writer.write(&acted, info(2)).unwrap();
    assert_eq!(writer.finish().unwrap().episode(2).unwrap().acting_distractor(), Some(2));
}

/// A link is the damaged file itself, which its checksum still tells; a copy would be a second one.
#[test]
fn what_is_copied_is_checked_and_what_is_linked_keeps_its_checksum() {
    let folder = tempfile::tempdir().unwrap();
    let whole = plain(&folder.path().join("whole"), 1, false);
    let path = folder.path().join("whole/episodes/000000.arrow");
    let mut bytes = fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&path, bytes).unwrap();
    let take = |name: &str, way: FileTransfer| {
        let header = manifest(&spec(true), None);
        let writer = RecordingWriter::create_or_resume(&folder.path().join(name), header, false).unwrap();
        writer.take(&whole, &whole.episodes()[0], way).map(|()| writer.finish().unwrap())
    };
    let error = take("copied", FileTransfer::Copy).unwrap_err().to_string();
    assert!(error.contains("its checksum differs from the manifest's") && error.contains("000000.arrow"), "{error}");
    let linked = take("linked", FileTransfer::Link).unwrap();
    assert_eq!(verify_recording(&linked).len(), 1);
}

#[test]
fn a_recording_under_other_videos_by_now_says_which() {
    let folder = tempfile::tempdir().unwrap();
    plain(folder.path(), 1, false);
    let now = |names: &[&str], frames: u32| {
        let video = |name: &&str| Video { name: (*name).into(), set: "train".into(), frames };
        let header = Manifest { videos: names.iter().map(video).collect(), ..manifest(&spec(true), None) };
        RecordingWriter::create_or_resume(folder.path(), header, false).unwrap_err().to_string()
    };
    let said = now(&["b", "c"], 50);
    assert!(said.contains("its videos were a, b; this folder now gives b, c;"), "{said}");
    let said = now(&["a", "b"], 51);
    assert!(said.contains("a (50 train frames)") && said.contains("b (51 train frames)"), "{said}");
}

#[test]
fn a_manifest_stands_for_its_recording() {
    let folder = tempfile::tempdir().unwrap();
    let whole = plain(folder.path(), 1, false);
    let named = Recording::open(&folder.path().join("manifest.json")).unwrap();
    assert_eq!((named.path(), named.manifest()), (whole.path(), whole.manifest()));
    assert_eq!(Recording::folder_of(Path::new("nowhere/manifest.json")), Path::new("nowhere/manifest.json"));
}
