//! The loop on made-up recordings: that it learns what can be learned, that it goes on exactly where it stopped, and that it refuses what does not fit.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod synthetic;

use std::fs;
use std::path::Path;

use burn::tensor::Device;
use toml::Table;
use vibes_data::{Recording, relative_place};
use vibes_model::checkpoint::{load_tensors, save_tensors};
use vibes_train::TrainError;
use vibes_train::fit::{End, Event, Go, fit};
use vibes_train::learners::objective::Objective;
use vibes_train::metrics::read_rows;
use vibes_train::options::Options;
use vibes_train::prepare::prepare;

fn options(text: &str) -> Options {
    Options::resolve("tiny", &[("the test", text.parse::<Table>().unwrap())]).unwrap()
}

fn train(path: &Path, recordings: &[Recording], options: &Options) -> vibes_train::Result<End> {
    let run = prepare(path, recordings, options, None)?;
    fit(&run, recordings, &Device::flex(), None, &mut |_| Go::On)
}

/// Mean reward log-likelihood over the last quarter of a run.
fn reward_log_likelihood(run: &Path) -> f64 {
    let rows = read_rows(&run.join("metrics.jsonl")).unwrap();
    let last = &rows[rows.len() * 3 / 4..];
    last.iter().map(|row| row.reward_log_likelihood).sum::<f64>() / last.len() as f64
}

/// Nothing that ignores the state can be better than a normal distribution of variance 1 at ±1: −½ − ½ ln 2π = −1.42 nats; a model whose rows are one step
/// out of line can do no better.
const BLIND: f64 = -1.42;

#[test]
fn rewards_are_learned_from_pixels_because_rows_are_in_line() {
    let folder = tempfile::tempdir().unwrap();
    let recording = synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 6, 60, false);
    for objective in Objective::all().filter(|objective| objective.rewards_shape_latents()) {
        let run = folder.path().join(objective.name());
        let options = options(&format!(
            "objective = '{objective}'\nupdates = 400\nlr = 0.002\ndynamics_weight = 0.01\nobservations = 'pixels'"
        ));
        assert_eq!(train(&run, std::slice::from_ref(&recording), &options).unwrap(), End::Updates);
        let reached = reward_log_likelihood(&run);
        assert!(reached > BLIND + 0.7, "{objective}: {reached}");
    }
}

#[test]
fn rewards_are_learned_from_vectors() {
    let folder = tempfile::tempdir().unwrap();
    let recording = synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 6, 60, false);
    let run = folder.path().join("run");
    train(&run, &[recording], &options("updates = 400\nlr = 0.002\ndynamics_weight = 0.01\nobservations = 'vectors'"))
        .unwrap();
    let reached = reward_log_likelihood(&run);
    assert!(reached > BLIND + 0.7, "{reached}");
}

#[test]
fn stopping_and_going_on_gives_the_same_bytes_as_never_stopping() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 4, 20, false)];
    for objective in Objective::all() {
        let options = options(&format!(
            "objective = '{objective}'\nupdates = 7\ncheckpoint_every = 5\ndynamics_start = 2\ndynamics_after = -1.0\ndynamics_warmup = 6\nlr_warmup = 9"
        ));
        let whole = folder.path().join(format!("{objective}-whole"));
        train(&whole, &recordings, &options).unwrap();
        let parts = folder.path().join(format!("{objective}-parts"));
        for stop_at in [2, 3, 100] {
            let run = prepare(&parts, &recordings, &options, None).unwrap();
            let listen = &mut |event: Event<'_>| match event {
                Event::Update { update, .. } if update == stop_at => Go::Stop,
                _ => Go::On,
            };
            fit(&run, &recordings, &Device::flex(), None, listen).unwrap();
        }
        for file in ["model.safetensors", "optimizer.safetensors"] {
            let read = |run: &Path| fs::read(run.join("checkpoints/000007").join(file)).unwrap();
            assert!(read(&whole) == read(&parts), "{objective}: {file} differs");
        }
    }
}

#[test]
fn several_recordings_are_trained_together() {
    let folder = tempfile::tempdir().unwrap();
    let recordings =
        ["a", "b"].map(|name| synthetic::recording(&folder.path().join(name), synthetic::SIDE, 2, 20, false));
    let run = folder.path().join("run");
    train(&run, &recordings, &options("updates = 3\nbatch = 6")).unwrap();
    let other = synthetic::recording(&folder.path().join("c"), 32, 2, 20, false);
    let mixed = [recordings[0].clone(), other];
    let error = train(&folder.path().join("mixed"), &mixed, &options("updates = 3")).unwrap_err().to_string();
    assert!(error.contains("32×32") && error.contains("16×16"), "{error}");
}

#[test]
fn old_checkpoints_are_let_go_and_metrics_follow_the_checkpoints() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false)];
    let path = folder.path().join("run");
    train(&path, &recordings, &options("updates = 8\ncheckpoint_every = 2\nlog_every = 2\nkeep = 2")).unwrap();
    let run = vibes_train::run::Run::open(&path).unwrap();
    assert_eq!(run.checkpoints(), [6, 8]);
    // As if the program had died after update 8 was logged but before it was saved.
    fs::remove_dir_all(run.checkpoint_path(8)).unwrap();
    train(&path, &recordings, &options("updates = 10\ncheckpoint_every = 2\nlog_every = 2\nkeep = 2")).unwrap();
    let updates: Vec<u64> = read_rows(&run.metrics_path()).unwrap().iter().map(|row| row.update).collect();
    assert_eq!(updates, [2, 4, 6, 8, 10]);
}

#[test]
fn a_run_of_other_options_is_refused_and_a_finished_one_has_nothing_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false)];
    let path = folder.path().join("run");
    train(&path, &recordings, &options("updates = 2")).unwrap();
    assert_eq!(train(&path, &recordings, &options("updates = 2")).unwrap(), End::Nothing);
    let error = train(&path, &recordings, &options("updates = 2\nlr = 0.5")).unwrap_err();
    assert!(matches!(&error, TrainError::OtherRun { key, .. } if key == "lr"), "{error}");
    let others = [synthetic::recording(&folder.path().join("other"), synthetic::SIDE, 2, 20, false)];
    let error = train(&path, &others, &options("updates = 4")).unwrap_err();
    assert!(matches!(&error, TrainError::OtherRun { key, .. } if key == "recordings"), "{error}");
}

#[test]
fn a_loss_that_is_no_number_stops_and_keeps_the_last_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false)];
    let path = folder.path().join("run");
    // No weight is lost in the first steps, but soon they overflow; whatever was saved before that stays, and is finite.
    let error =
        train(&path, &recordings, &options("updates = 50\ncheckpoint_every = 1\nlr = 1e18\nadversary_lr = 1e-3"))
            .unwrap_err();
    let run = vibes_train::run::Run::open(&path).unwrap();
    assert!(matches!(error, TrainError::Diverged { is_kept: true, .. }), "{error}");
    assert!(error.to_string().contains("checkpoint is kept") && error.to_string().contains("--from"), "{error}");
    let unsaved = options("updates = 50\ncheckpoint_every = 50\nlr = 1e18\nadversary_lr = 1e-3");
    let lost = train(&folder.path().join("unsaved"), &recordings, &unsaved).unwrap_err();
    assert!(matches!(lost, TrainError::Diverged { is_kept: false, .. }), "{lost}");
    assert!(!lost.to_string().contains("is kept") && lost.to_string().contains("from the beginning"), "{lost}");
    for update in run.checkpoints() {
        let (weights, _) = load_tensors(&run.checkpoint_path(update).join("model.safetensors")).unwrap();
        assert!(
            weights.values().flat_map(|tensor| &tensor.values).all(|weight| weight.is_finite()),
            "checkpoint {update}"
        );
    }
}

#[test]
fn windows_longer_than_every_episode_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 5, false)];
    let error = train(&folder.path().join("run"), &recordings, &options("length = 8")).unwrap_err().to_string();
    assert!(error.contains("longest has 5"), "{error}");
    assert!(!folder.path().join("run").exists(), "the same command with a length that can be would find another run");
}

#[test]
fn a_run_can_begin_with_the_weights_of_another_of_the_same_model() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false)];
    let (first, second) = (folder.path().join("first"), folder.path().join("second"));
    train(&first, &recordings, &options("updates = 3")).unwrap();
    // A step size of almost nothing: whatever the new run ends with, it began with.
    let still = options("updates = 1\nlr = 1e-12\nadversary_lr = 1e-12\nseed = 9");
    let run = prepare(&second, &recordings, &still, Some(&first)).unwrap();
    fit(&run, &recordings, &Device::flex(), None, &mut |_| Go::On).unwrap();
    let weights = |path: &Path| load_tensors(&path.join("model.safetensors")).unwrap().0;
    let (before, after) = (weights(&first.join("checkpoints/000003")), weights(&second.join("checkpoints/000001")));
    for (name, tensor) in &before {
        let pairs = tensor.values.iter().zip(&after[name].values);
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-6), "{name}");
    }
    assert_eq!(vibes_train::run::Run::open(&second).unwrap().info().from, Some(relative_place(&first, &second)));
    let wider = options("updates = 1\nlatent = 9");
    let error = prepare(&folder.path().join("third"), &recordings, &wider, Some(&first)).unwrap_err();
    assert!(matches!(error, TrainError::OtherModel { .. }), "{error}");
}

/// A run that goes on from another's checkpoint goes on with its optimisers, its gate and the weight that had risen until then.
#[test]
fn going_on_from_a_run_carries_moments_gate_and_schedules_over() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false)];
    let (first, second) = (folder.path().join("first"), folder.path().join("second"));
    let shared = "dynamics_start = 2\ndynamics_warmup = 10\ndynamics_weight = 1.0\nlr_warmup = 20\nlog_every = 1";
    train(&first, &recordings, &options(&format!("{shared}\nupdates = 8"))).unwrap();
    let still = options(&format!("{shared}\nupdates = 1\nseed = 9"));
    let run = prepare(&second, &recordings, &still, Some(&first)).unwrap();
    fit(&run, &recordings, &Device::flex(), None, &mut |_| Go::On).unwrap();
    let weight = |run: &Path, row: usize| read_rows(&run.join("metrics.jsonl")).unwrap()[row].dynamics_weight;
    assert!((weight(&first, 7) - 0.5).abs() < 1e-6 && (weight(&second, 0) - 0.6).abs() < 1e-6);
    let moments = |path: &Path| load_tensors(&path.join("optimizer.safetensors")).unwrap().0;
    let (before, after) = (moments(&first.join("checkpoints/000008")), moments(&second.join("checkpoints/000001")));
    assert!(before.keys().any(|name| name.starts_with("adversary.second.")));
    for (name, tensor) in
        before.iter().filter(|(name, _)| name.starts_with("world.second.") || name.starts_with("adversary.second."))
    {
        // Second moments fall by a thousandth a step and never faster.
        let pairs = tensor.values.iter().zip(&after[name].values);
        assert!(pairs.into_iter().all(|(before, after)| *after >= 0.998 * before), "{name}");
    }
    let state = fs::read_to_string(second.join("checkpoints/000001/state.json")).unwrap();
    let state: vibes_train::run::State = serde_json::from_str(&state).unwrap();
    assert_eq!((state.update, state.carried, state.optimizer_steps, state.gate.opened), (1, 8, 9, Some(2)));
    // The third in the row counts on.
    let third = folder.path().join("third");
    let run = prepare(&third, &recordings, &still, Some(&second)).unwrap();
    fit(&run, &recordings, &Device::flex(), None, &mut |_| Go::On).unwrap();
    assert!((weight(&third, 0) - 0.7).abs() < 1e-6);
    // Weights alone count as trained: the gate is open, and only the moments are lost.
    for file in ["optimizer.safetensors", "state.json"] {
        fs::remove_file(first.join("checkpoints/000008").join(file)).unwrap();
    }
    let fourth = folder.path().join("fourth");
    let run = prepare(&fourth, &recordings, &still, Some(&first)).unwrap();
    fit(&run, &recordings, &Device::flex(), None, &mut |_| Go::On).unwrap();
    assert!((weight(&fourth, 0) - 0.8).abs() < 1e-6, "eight of ten, counted from the first update");
}

/// What a run that goes on from another is shown is what the other would have been shown next, and not what it was shown from the beginning.
#[test]
fn going_on_from_a_run_draws_on() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false)];
    let shown = |name: &str, updates: u32, from: Option<&Path>| {
        let run =
            prepare(&folder.path().join(name), &recordings, &options(&format!("updates = {updates}")), from).unwrap();
        let mut starts = Vec::new();
        let listen = &mut |event: Event<'_>| {
            if let Event::Windows { batch, .. } = event {
                starts.push(batch.starts.clone());
            }
            Go::On
        };
        fit(&run, &recordings, &Device::flex(), None, listen).unwrap();
        starts
    };
    let whole = shown("whole", 6, None);
    let (first, second) = (shown("first", 3, None), shown("second", 3, Some(&folder.path().join("first"))));
    assert_eq!(whole, [first, second].concat());
}

/// A folder whose run began otherwise is not gone on with as if `--from` had not been there.
#[test]
fn a_run_that_began_elsewhere_is_another_run() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false)];
    let place = |name: &str| folder.path().join(name);
    let go_on = |name: &str, from: Option<&Path>| {
        let run = prepare(&place(name), &recordings, &options("updates = 1"), from)?;
        fit(&run, &recordings, &Device::flex(), None, &mut |_| Go::On)
    };
    for run in ["a/run", "b/run"] {
        go_on(run, None).unwrap();
    }
    go_on("second", Some(&place("a/run"))).unwrap();
    let of = |name: &str, from: &str| match go_on(name, Some(&place(from))) {
        Err(TrainError::OtherRun { key, .. }) => key,
        other => format!("{other:?}"),
    };
    assert_eq!((of("a/run", "b/run"), of("second", "b/run")), ("from".to_owned(), "from".to_owned()));
    go_on("second", Some(&place("a/run"))).unwrap();
    go_on("second", None).unwrap();
    // Both may be moved together.
    fs::rename(place("a"), place("moved")).unwrap();
    go_on("second", Some(&place("moved/run"))).unwrap();
}

/// What did not wait had its gate open from the first update on, which says nothing of whether the reward was learned.
#[test]
fn a_run_that_begins_to_wait_begins_with_a_closed_gate() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false)];
    let [first, second] = ["first", "second"].map(|name| folder.path().join(name));
    train(&first, &recordings, &options("objective = 'no-adversary'\nupdates = 2")).unwrap();
    let waiting = options("objective = 'no-adversary'\nwait = 'yes'\nupdates = 2\ndynamics_after = 0.25");
    let run = prepare(&second, &recordings, &waiting, Some(&first)).unwrap();
    fit(&run, &recordings, &Device::flex(), None, &mut |_| Go::On).unwrap();
    let opened = |run: &Path| {
        let state = fs::read_to_string(run.join("checkpoints/000002/state.json")).unwrap();
        serde_json::from_str::<vibes_train::run::State>(&state).unwrap().gate.opened
    };
    assert_eq!((opened(&first), opened(&second)), (Some(0), None));
    // What it waits to be better than begins where it begins in a new run, and not wherever its weights were drawn.
    let still = options("objective = 'no-adversary'\nwait = 'yes'\nupdates = 1\nlr = 1e-12\ndynamics_after = 0.25");
    let baseline = |name: &str, from: Option<&Path>| {
        let run = prepare(&folder.path().join(name), &recordings, &still, from).unwrap();
        fit(&run, &recordings, &Device::flex(), None, &mut |_| Go::On).unwrap();
        let (tensors, _) = load_tensors(&run.path().join("checkpoints/000001/model.safetensors")).unwrap();
        tensors["world.heads.0.mlp.last.bias"].values.clone()
    };
    let (gone_on, new) = (baseline("third", Some(&first)), baseline("new", None));
    assert!(gone_on.iter().zip(&new).all(|(a, b)| (a - b).abs() < 1e-5), "{gone_on:?} {new:?}");
    // It learns like everything else, and one that was stopped on the way becomes the undisturbed one.
    let go_on = |name: &str, updates: u64| {
        let mut asked = waiting.clone();
        asked.settings.updates = updates;
        let run = prepare(&folder.path().join(name), &recordings, &asked, Some(&first)).unwrap();
        fit(&run, &recordings, &Device::flex(), None, &mut |_| Go::On).unwrap();
        let file =
            |file: &str| fs::read(run.path().join("checkpoints").join(format!("{updates:06}")).join(file)).unwrap();
        (file("model.safetensors"), file("optimizer.safetensors"))
    };
    let (begun, undisturbed) = (go_on("stopped", 1), go_on("undisturbed", 3));
    assert!(go_on("stopped", 3) == undisturbed && begun != undisturbed);
    let place = folder.path().join("undisturbed/checkpoints/000003/optimizer.safetensors");
    let (mut moments, more) = load_tensors(&place).unwrap();
    let learned = |name: &str| moments[name].values.iter().any(|moment| *moment != 0.0);
    assert!(learned("world.first.heads.0.mlp.last.weight") && learned("world.first.heads.0.mlp.first.weight"));
    // A file that says otherwise than can be is damaged.
    moments.get_mut("world.begun.heads.0.mlp.last.weight").unwrap().values[0] = 1e9;
    save_tensors(&place, &moments, more).unwrap();
    let run = prepare(
        &folder.path().join("undisturbed"),
        &recordings,
        &options("objective = 'no-adversary'\nwait = 'yes'\nupdates = 4\ndynamics_after = 0.25"),
        None,
    );
    let error = run.unwrap().resume(&Device::flex()).unwrap_err().to_string();
    assert!(error.contains("began to be learned after 1000000000"), "{error}");
}

/// A term may be added, or left out, on the way: its head begins anew and everything else goes on.
#[test]
fn going_on_with_another_term_keeps_all_other_weights() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false)];
    let go_on = |name: &str, from: Option<&Path>, text: &str| {
        let path = folder.path().join(name);
        let run = prepare(&path, &recordings, &options(text), from).unwrap();
        fit(&run, &recordings, &Device::flex(), None, &mut |_| Go::On).unwrap();
        path
    };
    let still = "updates = 1\nlr = 1e-12\nadversary_lr = 1e-12";
    let first = go_on("first", None, "updates = 3\ndynamics_after = 0.25");
    let second = go_on("second", Some(&first), &format!("{still}\ndynamics_after = 0.0\ninverse_weight = 1.0"));
    let third = go_on("third", Some(&second), &format!("{still}\ndynamics_after = 0.25\ninverse_weight = 1.0"));
    let tensors = |run: &Path, update: &str, file: &str| {
        load_tensors(&run.join("checkpoints").join(update).join(file)).unwrap().0
    };
    let weights = |run: &Path, update: &str| tensors(run, update, "model.safetensors");
    let (before, with_term, both) = (weights(&first, "000003"), weights(&second, "000001"), weights(&third, "000001"));
    let same = |a: &[f32], b: &[f32]| a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    for (name, tensor) in before.iter().filter(|(name, _)| !name.contains(".heads.")) {
        assert!(same(&tensor.values, &with_term[name].values) && same(&tensor.values, &both[name].values), "{name}");
    }
    // The inverse was the only head, and is the second of two now; the baseline is a new one.
    let (alone, second_of_two) = ("world.heads.0.mlp.first.weight", "world.heads.1.mlp.first.weight");
    assert!(same(&with_term[alone].values, &both[second_of_two].values));
    let moments = |run: &Path| tensors(run, "000001", "optimizer.safetensors");
    let (before, after) = (moments(&second), moments(&third));
    // Adam's correction for moments that begin at zero counts from each head's own first step.
    let begun = |head: usize| after[&format!("world.begun.heads.{head}.mlp.first.weight")].values[0];
    assert_eq!((begun(0), begun(1)), (4.0, 3.0));
    let pairs = before["world.second.heads.0.mlp.first.weight"].values.iter();
    let after = &after["world.second.heads.1.mlp.first.weight"].values;
    assert!(pairs.zip(after).all(|(before, after)| *after >= 0.998 * before));
}

/// The gate compares with what past actions alone predict, by a head of its own.
#[test]
fn rewards_that_actions_alone_tell_do_not_open_the_gate() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 6, 60, false)];
    let run = folder.path().join("run");
    let text = "updates = 300\nlr = 0.002\ndynamics_after = 0.25\nobservations = 'pixels'";
    train(&run, &recordings, &options(text)).unwrap();
    let rows = read_rows(&run.join("metrics.jsonl")).unwrap();
    let last = rows.last().unwrap();
    let baseline = last.stated("reward_of_actions_log_likelihood").unwrap();
    // The reward is the product of two coins: one of them alone, the action, tells nothing.
    assert!((baseline - BLIND).abs() < 0.2, "{baseline}");
    assert!(last.reward_log_likelihood > baseline + 0.25 && last.dynamics_weight > 0.0, "{last:?}");
    assert_eq!(rows[0].dynamics_weight, 0.0);
}

/// Puts a number that is none in the place of the first reward of a recording's first episode: what damage leaves, or a program that does not check.
fn poison(recording: &Recording) {
    let entry = &recording.episodes()[0];
    let rewards = recording.episode(entry.index).unwrap().to_episode().rewards;
    let column: Vec<u8> = rewards.iter().flat_map(|reward| reward.to_le_bytes()).collect();
    let file = recording.path().join(&entry.arrow.path);
    let mut bytes = fs::read(&file).unwrap();
    let at = bytes.windows(column.len()).position(|found| found == column).unwrap();
    bytes[at..][..4].copy_from_slice(&f32::NAN.to_le_bytes());
    fs::write(&file, bytes).unwrap();
}

#[test]
fn a_reward_that_is_no_number_is_refused_before_the_folder_is_begun() {
    let folder = tempfile::tempdir().unwrap();
    let recording = synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false);
    let file = recording.path().join(&recording.episodes()[0].arrow.path);
    let whole = fs::read(&file).unwrap();
    poison(&recording);
    let path = folder.path().join("run");
    let error = train(&path, std::slice::from_ref(&recording), &options("updates = 1")).unwrap_err().to_string();
    assert!(error.contains("the reward of step 0 is NaN") && error.contains("000000.arrow"), "{error}");
    assert!(!path.exists(), "a unit of reward that is none would stay in it");
    fs::write(&file, whole).unwrap();
    train(&path, &[recording], &options("updates = 1")).unwrap();
}

/// Says something else in `run.json`.
fn rewrite(run: &Path, change: impl Fn(&mut serde_json::Value)) {
    let file = run.join("run.json");
    let mut info = serde_json::from_str(&fs::read_to_string(&file).unwrap()).unwrap();
    change(&mut info);
    fs::write(&file, info.to_string()).unwrap();
}

/// The unit of reward is settled by what was learned in it, and not by a folder in which nothing was learned yet.
#[test]
fn a_unit_of_reward_stays_from_the_first_checkpoint_on() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false)];
    let path = folder.path().join("run");
    let options = options("updates = 1");
    let unit = |expected: f32| {
        let run = prepare(&path, &recordings, &options, None).unwrap();
        assert!((run.info().model.reward_scale - expected).abs() < 0.3, "{}", run.info().model.reward_scale);
    };
    let wrong = |info: &mut serde_json::Value| info["model"]["reward_scale"] = serde_json::Value::from(0.25);
    unit(1.0);
    rewrite(&path, wrong);
    unit(1.0);
    train(&path, &recordings, &options).unwrap();
    rewrite(&path, wrong);
    unit(0.25);
}

/// Names and sizes do not tell one recording from another.
#[test]
fn another_recording_of_the_same_name_and_size_is_another_and_one_that_has_grown_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let (coins, path) = (folder.path().join("coins"), folder.path().join("run"));
    let go_on =
        |recording: Recording, updates: u32| train(&path, &[recording], &options(&format!("updates = {updates}")));
    go_on(synthetic::recording(&coins, synthetic::SIDE, 2, 20, false), 1).unwrap();
    fs::remove_dir_all(&coins).unwrap();
    go_on(synthetic::recording(&coins, synthetic::SIDE, 3, 20, false), 2).unwrap();
    fs::remove_dir_all(&coins).unwrap();
    let other = synthetic::recording_of(&coins, synthetic::SIDE, 3, 20, false, |state, action| -state * action);
    let before = fs::read(path.join("run.json")).unwrap();
    let error = go_on(other.clone(), 3).unwrap_err();
    assert!(matches!(&error, TrainError::OtherRun { key, .. } if key == "recordings"), "{error}");
    assert_eq!(fs::read(path.join("run.json")).unwrap(), before, "what it learned from is not forgotten");
    // A run.json of before they were kept has nothing to compare with.
    rewrite(&path, |info| drop(info.as_object_mut().unwrap().remove("fingerprints").unwrap()));
    go_on(other, 3).unwrap();
}

/// Without its moments a checkpoint would go on as another run than the one that was stopped.
#[test]
fn a_checkpoint_without_its_moments_is_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false)];
    let path = folder.path().join("run");
    train(&path, &recordings, &options("updates = 2")).unwrap();
    fs::remove_file(path.join("checkpoints/000002/optimizer.safetensors")).unwrap();
    let error = train(&path, &recordings, &options("updates = 3")).unwrap_err();
    assert!(matches!(&error, TrainError::DamagedCheckpoint { .. }), "{error}");
    assert!(error.to_string().contains("optimizer.safetensors"), "{error}");
}

/// Where an objective asks for what another lacks, both are named.
#[test]
fn going_on_from_an_objective_of_other_networks_is_refused_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let recordings = [synthetic::recording(&folder.path().join("coins"), synthetic::SIDE, 2, 20, false)];
    let first = folder.path().join("first");
    train(&first, &recordings, &options("objective = 'deepmdp'\nupdates = 1")).unwrap();
    let wanted = options("objective = 'kl-constraint'\nupdates = 1");
    let error = prepare(&folder.path().join("second"), &recordings, &wanted, Some(&first)).unwrap_err().to_string();
    assert!(error.contains("no learned numbers (objective deepmdp)"), "{error}");
    assert!(error.contains("(objective kl-constraint)") && !error.contains("[]"), "{error}");
}
