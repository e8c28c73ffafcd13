//! Updates that are made beside one another are those made one after another: in rounds of one, nothing is beside anything.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use burn::tensor::Device;
use vibes_env::distractors::{Axes, DistractorSettings};
use vibes_env::videos::VideoSet;
use vibes_model::parameters::read_parameters;

use super::*;
use crate::learners::behaviour::BehaviourPhases;
use crate::online::checkpoint::resume;
use crate::online::options::{OnlineOptions, WorldOptions};
use crate::online::{online, prepare};
use crate::options::Options;
use crate::replay::ReplayOptions;

const COUNT: u64 = 6;

#[test]
fn updates_beside_one_another_are_those_one_after_another() {
    let (folder, device) = (tempfile::tempdir().unwrap(), Device::flex());
    let path = folder.path().join("run");
    let world = prepare::default_world("known-slide").unwrap();
    let distractors = DistractorSettings { axes: Axes::NONE, ..world.distractors };
    let world = WorldOptions { steps: 20, size: None, distractors, ..world };
    let mut options = prepare::default_options(world, false);
    options.behaviour.guard = 1.0;
    let options = OnlineOptions {
        control_steps: 8 * 40,
        prefill: 2,
        first_updates: 4,
        evaluate_every: 0,
        evaluation_episodes: 1,
        final_episodes: 1,
        rows_per_step: 8.0,
        ..options
    };
    let mut prepared = prepare::from_nothing(&path, &Options::preset("tiny").unwrap(), options).unwrap();
    let setup = Setup { run: &prepared.run, options: &prepared.options, given: &[], device: &device };
    online(&setup, &mut |_| Go::On).unwrap();
    // Within the updates that are compared the actor begins to learn and the horizon grows.
    let before = resume(&prepared.run, true, &device).unwrap().unwrap().online.updates;
    let options = &mut prepared.options;
    (options.critic_first, options.short_horizon, options.short_for) = (before + 2, 3, before + 4);
    let setup = Setup { run: &prepared.run, options: &prepared.options, given: &[], device: &device };
    let run_of = |rounds: &[u64]| {
        let resumed = resume(setup.run, true, &device).unwrap().unwrap();
        let (place, model) = (path.join("replay"), &setup.run.info().options);
        let videos = setup.options.world.video_library(VideoSet::Train).unwrap();
        let manifest = setup.options.world.manifest(model.seed, videos.videos(), &place).unwrap();
        let sizes = ReplayOptions { length: model.length, batch: model.batch, given_share: 0.0 };
        let replay = Replay::open(&place, manifest, (resumed.online.episodes, 0), &[], sizes).unwrap();
        let mut session = Session::open(setup.run, &device, resumed.world, false).unwrap();
        let (mut learners, mut done, mut measures, mut told) =
            ((resumed.learner, resumed.behaviour), resumed.online.updates, Vec::new(), 0);
        let mut foreseen = None;
        for &count in rounds {
            let mut listen = |_: Event<'_>| {
                told += 1;
                Go::On
            };
            let (next, round, _) =
                updates(&setup, &replay, &mut session, learners, (done, count), &mut listen).unwrap();
            (learners, done, foreseen) = (next, done + count, round.foresight);
            measures.extend(
                round.measures.into_iter().map(|made| BehaviourMeasures { phases: BehaviourPhases::default(), ..made }),
            );
        }
        assert_eq!(
            (done - resumed.online.updates, session.state.update - resumed.world.update, told),
            (COUNT, COUNT, COUNT)
        );
        let (learner, behaviour) = learners;
        let weights = [
            read_parameters(&learner.model.world, ""),
            read_parameters(&behaviour.behaviour.actor, ""),
            read_parameters(&behaviour.behaviour.critic, ""),
            read_parameters(&behaviour.behaviour.slow, ""),
            read_parameters(&behaviour.guard.unwrap().guard.members, ""),
        ];
        (measures, weights, foreseen)
    };
    let (made, weights, foreseen) = run_of(&[COUNT]);
    let (after, wanted, last) = run_of(&[1; COUNT as usize]);
    assert_eq!((&made, foreseen), (&after, last));
    let moved: Vec<bool> = made.iter().map(|made| made.actor_gradient_norm.is_some()).collect();
    assert_eq!(moved, [false, false, true, true, true, true]);
    assert!(weights == wanted);
    assert!(made.windows(2).any(|pair| pair[0] != pair[1]), "every update measures something of its own");
}

#[test]
fn a_panic_beside_is_an_error_and_what_was_made_here_is_there() {
    let (here, there) = beside(|| 7, || -> Result<()> { panic!("out of memory") });
    let error = there.unwrap_err();
    assert!(here == 7 && error.to_string().contains("out of memory"), "{error}");
}
