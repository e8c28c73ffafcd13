//! What a run began with: counted once, kept when recordings are taken away, and refused under a protocol where it cannot be.

use serde_json::Value;
use vibes_data::RunFolder;
use vibes_env::videos::VideoSource;

use super::super::prepare::{again, default_options, default_world, from_run};
use super::super::protocol::Protocol;
use super::*;
use crate::keep::{Extent, keep};
use crate::options::Options;

const PIXELS: ObservationKind = ObservationKind::Pixels { height: 32, width: 32 };
/// The held-out videos that the sample is drawn under: the built-in ones that an easy world has too.
const HELD_OUT: [&str; 4] = ["cells-000", "marble-000", "tiles-000", "tiles-001"];

/// A copy of the sample: two state trajectories of 12 agent steps, each under three distractors, with actions held for 4 control steps.
fn sample(place: &Path) -> Recording {
    let found = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../data/sample"));
    std::fs::create_dir_all(place.join("episodes")).unwrap();
    std::fs::copy(found.join("manifest.json"), place.join("manifest.json")).unwrap();
    for entry in Recording::open(found).unwrap().episodes() {
        std::fs::copy(found.join(&entry.arrow.path), place.join(&entry.arrow.path)).unwrap();
    }
    Recording::open(place).unwrap()
}

/// An offline run at `path` on a copy of the sample at `recording`, before its first update.
fn run_on(path: &Path, recording: &Path) -> Run {
    crate::prepare::prepare(path, &[sample(recording)], &Options::preset("tiny").unwrap(), None).unwrap()
}

/// The run at `path`, going on from another, which is there or not.
fn going_on_from(path: &Path, from: &str) -> Run {
    let file = RunFolder::at(path).info_path();
    let mut info: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    info["from"] = from.into();
    std::fs::write(&file, info.to_string()).unwrap();
    Run::open(path).unwrap()
}

/// Gives the episodes of a recording other seeds: another two state trajectories.
fn reseed(recording: &Recording) {
    let mut manifest = recording.manifest().clone();
    manifest.episodes.iter_mut().for_each(|entry| entry.seed += 1);
    manifest.write(&recording.path().join("manifest.json")).unwrap();
}

fn options() -> OnlineOptions {
    default_options(default_world("reacher-easy").unwrap(), true)
}

fn published() -> OnlineOptions {
    let mut options = options();
    options.settle(Protocol::DcsEasyDynamic500k);
    options
}

/// What a run that goes on from this one is said to have begun with.
fn begun(options: &OnlineOptions) -> (Option<u64>, Option<GivenFrom>) {
    (options.given_control_steps, options.given_from)
}

#[test]
fn what_a_run_began_with_is_counted_once_and_kept_when_recordings_are_taken_away() {
    let folder = tempfile::tempdir().unwrap();
    let [run, recording, first, second] = ["run", "recording", "first", "second"].map(|name| folder.path().join(name));
    let run = run_on(&run, &recording);
    let settle = |path: &Path| settled(path, &run, PIXELS, options()).unwrap();
    assert_eq!(begun(&settle(&first)), (Some(2 * 12 * 4), Some(GivenFrom::Recordings)), "views count once");
    std::fs::create_dir_all(&first).unwrap();
    settle(&first).keep(&first).unwrap();
    std::fs::remove_dir_all(&recording).unwrap();
    let kept = settle(&first);
    assert_eq!(begun(&kept), (Some(2 * 12 * 4), Some(GivenFrom::Recordings)));
    assert_eq!(kept.held_out_seen, HELD_OUT);
    let late = settle(&second);
    assert_eq!(begun(&late), (Some(6 * 12 * 4), Some(GivenFrom::RunFile)), "every view, as run.json has it");
    assert!(
        late.given_in_words()
            .unwrap()
            .contains("288 control steps of recordings and of runs before it (of those that are gone")
    );
    assert!(late.held_out_seen.is_empty(), "nobody knows");
    // Under the protocol that is told, and no reason to refuse.
    let late = settled(&second, &run, PIXELS, published()).unwrap();
    assert_eq!(begun(&late), (Some(6 * 12 * 4), Some(GivenFrom::RunFile)));
    // What a run before is known to have seen stays known.
    kept.keep(run.path()).unwrap();
    assert_eq!(settle(&folder.path().join("third")).held_out_seen, HELD_OUT);
}

#[test]
fn what_cannot_be_known_is_not_said_and_refused_under_a_protocol() {
    let folder = tempfile::tempdir().unwrap();
    let [path, recording, next] = ["run", "recording", "next"].map(|name| folder.path().join(name));
    run_on(&path, &recording);
    std::fs::remove_dir_all(&recording).unwrap();
    let run = going_on_from(&path, "../nowhere");
    let unknown = settled(&next, &run, PIXELS, options()).unwrap();
    assert_eq!(begun(&unknown), (None, Some(GivenFrom::Unknown)));
    assert_eq!(given_control_steps(&run, &unknown, &[]), None, "not what happens to be left either");
    assert!(notes(&run, &unknown)[0].contains("is not known"));
    let error = settled(&next, &run, PIXELS, published()).unwrap_err().to_string();
    assert!(error.contains("dcs-easy-dynamic-500k") && error.contains("not known") && error.contains("--protocol"));
    // One that was begun before this was kept goes on as it did, under a protocol too.
    std::fs::create_dir_all(&next).unwrap();
    published().keep(&next).unwrap();
    assert_eq!(begun(&settled(&next, &run, PIXELS, published()).unwrap()), (None, None));
}

/// A run that went on from an online one began with what that one lived through too, which its replay or, without that, its checkpoint tells.
#[test]
fn what_an_online_run_before_lived_through_counts_and_one_with_neither_replay_nor_checkpoint_does_not_say() {
    let folder = tempfile::tempdir().unwrap();
    let [path, recording, next] = ["run", "recording", "next"].map(|name| folder.path().join(name));
    let run = run_on(&path, &recording);
    options().keep(&path).unwrap();
    assert_eq!(begun(&settled(&next, &run, PIXELS, options()).unwrap()), (None, Some(GivenFrom::Unknown)));
    reseed(&sample(&path.join("replay")));
    let settled = settled(&next, &run, PIXELS, options()).unwrap();
    assert_eq!(begun(&settled), (Some(2 * 2 * 12 * 4), Some(GivenFrom::Recordings)));
}

/// An online run has kept what it began with, so that the run before it need not be there; nor, for what it lived through itself, its replay.
#[test]
fn the_nearest_run_that_says_what_it_began_with_ends_the_count() {
    let folder = tempfile::tempdir().unwrap();
    let [middle, path, recording, next] = ["middle", "run", "recording", "next"].map(|name| folder.path().join(name));
    run_on(&middle, &recording);
    going_on_from(&middle, "../nowhere");
    let given = (Some(1000), Some(GivenFrom::Recordings));
    OnlineOptions { given_control_steps: given.0, given_from: given.1, ..options() }.keep(&middle).unwrap();
    run_on(&path, &recording);
    let run = going_on_from(&path, "../middle");
    let settle = |options| settled(&next, &run, PIXELS, options);
    // Neither a replay nor a checkpoint says how much the run between lived through.
    assert_eq!(begun(&settle(options()).unwrap()), (None, Some(GivenFrom::Unknown)));
    reseed(&sample(&middle.join("replay")));
    // The recording that both have learned from is among the thousand.
    let counted = (Some(1000 + 2 * 12 * 4), Some(GivenFrom::Recordings));
    assert_eq!(begun(&settle(options()).unwrap()), counted);
    let world = WorldOptions { videos: VideoSource::Folder(folder.path().join("films")), ..options().world };
    let told = (counted.0, Some(GivenFrom::RunFile));
    let other = settle(OnlineOptions { world, ..options() }).unwrap();
    assert_eq!(begun(&other), told, "nobody has looked whether these videos were seen before");
    // As in a kept copy.
    for taken in [middle.join("replay"), recording.clone()] {
        std::fs::remove_dir_all(taken).unwrap();
    }
    let checkpoint = RunFolder::at(&middle).checkpoint_path(7);
    std::fs::create_dir_all(&checkpoint).unwrap();
    std::fs::write(checkpoint.join("online.json"), "{\"control_steps\":400}").unwrap();
    assert_eq!(begun(&settle(published()).unwrap()), (Some(1000 + 400), Some(GivenFrom::RunFile)));
}

/// A copy is sent to somebody without the runs before it, which would have counted.
#[test]
fn a_kept_copy_says_what_the_run_began_with() {
    let folder = tempfile::tempdir().unwrap();
    let [first, path, other, copy, again, next] =
        ["first", "run", "other", "copy", "again", "next"].map(|name| folder.path().join(name));
    run_on(&first, &folder.path().join("recording"));
    run_on(&path, &other);
    reseed(&Recording::open(&other).unwrap());
    let run = going_on_from(&path, "../first");
    std::fs::create_dir_all(run.checkpoint_path(1)).unwrap();
    let kept = |from: &Run, to: &Path| {
        keep(from, to, Extent::Training).unwrap();
        Run::open(to).unwrap()
    };
    let whole = HeadStart { given_control_steps: Some(2 * 12 * 4), given_from: GivenFrom::Recordings };
    let found = kept(&run, &copy);
    assert_eq!((found.info().began_with, found.info().from.as_deref()), (Some(whole), Some("runs/first")));
    for gone in [&first, &folder.path().join("recording"), &other] {
        std::fs::remove_dir_all(gone).unwrap();
    }
    // A copy of the copy says it too; that the run before it is gone is no reason to refuse.
    let found = kept(&found, &again);
    assert_eq!(found.info().began_with, Some(whole));
    let settled = settled(&next, &found, PIXELS, published()).unwrap();
    assert_eq!(begun(&settled), (Some((2 + 6) * 12 * 4), Some(GivenFrom::RunFile)));
    // Under which videos all that was is not known.
    assert!(!found.seen().is_whole && notes(&going_on_from(&path, "../again"), &settled).len() == 2);
    // Nor does a run that names itself by mistake lead round and round.
    assert!(!going_on_from(&path, "../run").before().1);
}

#[test]
fn held_out_videos_that_a_run_has_learned_under_are_told_and_refused_under_a_protocol() {
    let folder = tempfile::tempdir().unwrap();
    let [path, recording, next] = ["run", "recording", "next"].map(|name| folder.path().join(name));
    let run = run_on(&path, &recording);
    let seen = settled(&next, &run, PIXELS, options()).unwrap();
    assert_eq!(seen.held_out_seen, HELD_OUT);
    assert!(notes(&run, &seen).iter().any(|note| note.contains("tiles-001") && note.contains("is_held_out")));
    let error = settled(&next, &run, PIXELS, published()).unwrap_err().to_string();
    assert!(error.contains("cells-000, marble-000, tiles-000, tiles-001"), "{error}");
    let blind = settled(&next, &run, ObservationKind::Vector { len: 6 }, options()).unwrap();
    assert!(blind.held_out_seen.is_empty(), "who sees no video has learned under none");
}

/// However a run is begun or gone on with; what is refused leaves no folder.
#[test]
fn a_run_is_begun_and_gone_on_with_under_videos_that_it_has_seen_but_not_published() {
    let folder = tempfile::tempdir().unwrap();
    let [path, recording, next] = ["run", "recording", "next"].map(|name| folder.path().join(name));
    let (run, model) = (run_on(&path, &recording), Options::preset("tiny").unwrap());
    std::fs::create_dir_all(run.checkpoint_path(1)).unwrap();
    let from = |mut options: OnlineOptions| {
        options.world.size = Some(32);
        from_run(&next, &run, &model, options)
    };
    let error = from(published()).unwrap_err().to_string();
    assert!(error.contains("holds out videos that are in the recordings") && !next.exists(), "{error}");
    let prepared = from(options()).unwrap();
    assert_eq!((prepared.options.given_control_steps, prepared.notes().len()), (Some(2 * 12 * 4), 2));
    drop(prepared);
    let found = OnlineOptions::read(&next).unwrap().unwrap();
    assert_eq!(found.held_out_seen, HELD_OUT);
    // Whatever of this the options say that it is gone on with.
    let asked =
        OnlineOptions { held_out_seen: Vec::new(), given_control_steps: None, given_from: None, ..found.clone() };
    let gone_on_with = again(&next, &model, asked).unwrap().options;
    assert_eq!((gone_on_with, OnlineOptions::read(&next).unwrap().unwrap()), (found.clone(), found));
}

/// Films of one name are one only where they come from one source, which the parts of a merged recording say of their own.
#[test]
fn a_film_of_another_source_is_another() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("recording");
    let recording = sample(&place);
    let world = options().world;
    let seen = |change: &dyn Fn(&mut Value)| {
        let mut manifest = recording.manifest().clone();
        change(&mut manifest.options);
        manifest.write(&place.join("manifest.json")).unwrap();
        Vec::from_iter(held_out_seen(&world, &[Recording::open(&place).unwrap()]))
    };
    assert_eq!(seen(&|_| {}), HELD_OUT);
    assert!(seen(&|options| options["videos"] = serde_json::json!({ "folder": "../films" })).is_empty());
    assert!(seen(&|options| *options = serde_json::json!({ "imported": "of somebody" })).is_empty());
    let part =
        |source: Value, videos: [u64; 2]| serde_json::json!({ "options": { "videos": source }, "videos": videos });
    let parts = [part("procedural".into(), [0, 99]), part(serde_json::json!({ "folder": "../films" }), [1, 2])];
    assert_eq!(seen(&|options| *options = serde_json::json!({ "merged": parts })), ["tiles-000"]);
}
