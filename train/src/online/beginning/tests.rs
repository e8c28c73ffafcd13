//! What a run began with: counted once, kept when recordings are taken away, and refused under a protocol where it cannot be.

use vibes_data::RunFolder;

use super::super::prepare::{again, default_options, default_world, from_run};
use super::super::protocol::Protocol;
use super::*;
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
    let file = RunFolder::at(&path).info_path();
    let mut info: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    info["from"] = "../nowhere".into();
    std::fs::write(&file, info.to_string()).unwrap();
    let run = Run::open(&path).unwrap();
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

/// A run that went on from an online one began with what that one lived through too, which only its replay can tell.
#[test]
fn what_an_online_run_before_lived_through_counts_and_a_copy_without_its_replay_does_not_say() {
    let folder = tempfile::tempdir().unwrap();
    let [path, recording, next] = ["run", "recording", "next"].map(|name| folder.path().join(name));
    let run = run_on(&path, &recording);
    options().keep(&path).unwrap();
    assert_eq!(begun(&settled(&next, &run, PIXELS, options()).unwrap()), (None, Some(GivenFrom::Unknown)));
    let replay = sample(&path.join("replay"));
    let mut manifest = replay.manifest().clone();
    manifest.episodes.iter_mut().for_each(|entry| entry.seed += 1);
    manifest.write(&replay.path().join("manifest.json")).unwrap();
    let settled = settled(&next, &run, PIXELS, options()).unwrap();
    assert_eq!(begun(&settled), (Some(2 * 2 * 12 * 4), Some(GivenFrom::Recordings)));
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
