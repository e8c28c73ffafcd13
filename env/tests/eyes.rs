//! What eyes draw step by step is what a recording draws afterwards from the stored states and the same seeds, byte for byte.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::sync::Arc;

use rand::{RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_env::distractors::{AxisSeeds, DistractorSettings, DistractorTrajectory};
use vibes_env::render::{Look, RenderSettings, Renderer, undistracted};
use vibes_env::videos::{VideoLibrary, VideoSet, VideoSource};
use vibes_env::{
    Environment, EnvironmentOptions, EpisodeSeeds, Eyes, Policy, Random, Result, Sight, Start, Trained, example_tasks,
    rollout, rollout_frames,
};

const PICTURES: RenderSettings = RenderSettings { size: 32, look: Look::Fast };
const STEPS: u32 = 6;

fn videos() -> Arc<VideoLibrary> {
    let source = VideoSource::Procedural;
    let names = source.list(VideoSet::Train, Some(2)).unwrap();
    Arc::new(VideoLibrary::open(&source, VideoSet::Train, &names, PICTURES.look.sky_side(PICTURES.size)).unwrap())
}

fn eyes(task: &str, pictures: Option<RenderSettings>) -> Eyes {
    let environment = Environment::new(task, EnvironmentOptions::default()).unwrap();
    Eyes::new(environment, DistractorSettings::default(), pictures, videos()).unwrap()
}

/// Acts at random and keeps what it saw.
#[derive(Debug, Default)]
struct Witness {
    seen: Vec<Vec<u8>>,
}

impl Policy for Witness {
    fn pictures(&self) -> Option<RenderSettings> {
        Some(PICTURES)
    }

    fn begin(&mut self, _: &Start) -> Result<()> {
        self.seen.clear();
        Ok(())
    }

    fn act(&mut self, sight: &Sight<'_>, rng: &mut dyn RngCore) -> Result<Vec<f64>> {
        self.seen.push(sight.pixels.to_vec());
        Random.act(sight, rng)
    }
}

#[test]
fn pictures_step_by_step_are_those_drawn_afterwards_from_stored_states() {
    let videos = videos();
    for task in example_tasks() {
        let mut eyes = eyes(task, Some(PICTURES));
        let seeds = EpisodeSeeds { state: 3, distractors: AxisSeeds { background: 4, camera: 5, color: 6 } };
        // A second episode, so that nothing of the first one is left.
        let mut witness = Witness::default();
        rollout(&mut eyes, &mut witness, 2, 9.into()).unwrap();
        let states = rollout(&mut eyes, &mut witness, STEPS, seeds).unwrap();

        let mut environment = Environment::new(task, EnvironmentOptions::default()).unwrap();
        environment.reset_to(&states.start).unwrap();
        let model = environment.physics().model();
        let from = undistracted(environment.scenery(), model, &videos).unwrap();
        let repeat = environment.action_repeat() as usize;
        let settings = DistractorSettings::default();
        let stored = DistractorTrajectory::generate(&settings, &from, STEPS as usize, repeat, seeds.distractors);
        let mut renderer = Renderer::new(PICTURES, environment.scenery(), model).unwrap();
        renderer.begin_episode(&states.qpos[0]).unwrap();
        let mut picture = vec![0; renderer.picture_bytes()];
        assert_eq!(witness.seen.len(), STEPS as usize);
        for (row, seen) in witness.seen.iter().enumerate() {
            renderer.draw(&states.qpos[row], &stored.view(row), &videos, &mut picture).unwrap();
            assert!(picture == *seen, "{task}: row {row} is another picture");
        }
        assert!(witness.seen[0] != witness.seen[STEPS as usize - 1], "{task}: nothing moves");
    }
}

#[test]
fn looking_or_not_changes_nothing_but_what_is_drawn() {
    for task in example_tasks() {
        let seeds = AxisSeeds::from(8);
        let actions = rollout(&mut eyes(task, None), &mut Random, STEPS, 8.into()).unwrap().actions;
        let play = |look_at: &dyn Fn(usize) -> bool| {
            let mut eyes = eyes(task, Some(PICTURES));
            eyes.reset(&mut ChaCha8Rng::seed_from_u64(8), seeds).unwrap();
            for (step, action) in actions.iter().enumerate() {
                if look_at(step) {
                    eyes.picture().unwrap();
                }
                eyes.step(action).unwrap();
            }
            eyes.frame().unwrap()
        };
        assert_eq!(play(&|_| true), play(&|_| false), "{task}");
    }
}

#[test]
fn a_policy_that_sees_pictures_needs_eyes_that_draw_them() {
    let mut blind = Eyes::blind(Environment::new("reacher-easy", EnvironmentOptions::default()).unwrap()).unwrap();
    assert!(blind.picture().unwrap().is_empty());
    let error = rollout(&mut blind, &mut Witness::default(), 2, 1.into()).unwrap_err().to_string();
    assert!(error.contains("size: 32"), "{error}");
    let mut small = eyes("reacher-easy", Some(RenderSettings { size: 16, ..PICTURES }));
    assert!(rollout(&mut small, &mut Witness::default(), 2, 1.into()).is_err());
}

/// What is kept of an episode does not change it: its states alone, or every row with its picture.
#[test]
fn an_episode_with_its_frames_is_that_of_its_states_with_the_pictures_that_the_policy_saw() {
    for task in example_tasks() {
        let mut eyes = eyes(task, Some(PICTURES));
        let mut witness = Witness::default();
        let states = rollout(&mut eyes, &mut witness, STEPS, 8.into()).unwrap();
        let (start, episode) = rollout_frames(&mut eyes, &mut witness, STEPS, 8.into()).unwrap();
        episode.check(&eyes.environment().spec(Some(PICTURES.size as u32))).unwrap();
        assert_eq!((start, &episode.qpos), (states.start, &states.qpos.concat()), "{task}");
        let actions: Vec<f64> = episode.actions.iter().map(|&number| f64::from(number)).collect();
        assert_eq!(actions, states.actions.concat(), "{task}");
        let rows: Vec<&[u8]> = episode.pixels.chunks_exact(witness.seen[0].len()).collect();
        assert_eq!(rows[..witness.seen.len()], witness.seen.iter().map(Vec::as_slice).collect::<Vec<_>>(), "{task}");
    }
}

/// A trained agent is told where an episode begins, sees what it was trained on, and what it asks for is cut to the bounds.
#[test]
fn a_trained_agent_begins_every_episode_anew_and_its_errors_say_whose_they_are() {
    let mut eyes = eyes("reacher-easy", Some(PICTURES));
    let mut rows = Vec::new();
    let mut agent = Trained::new("runs/mine".to_owned(), None, |sight, is_first, _| {
        rows.push((is_first, sight.pixels.len(), sight.observation.len()));
        Ok(vec![7.0, -0.5])
    });
    for _ in 0..2 {
        let states = rollout(&mut eyes, &mut agent, 3, 1.into()).unwrap();
        assert!(states.actions.iter().all(|action| *action == [1.0, -0.5]));
    }
    drop(agent);
    assert_eq!(rows.iter().map(|row| row.0).collect::<Vec<_>>(), [true, false, false, true, false, false]);
    assert!(rows.iter().all(|(_, pixels, observation)| (*pixels, *observation) == (0, 6)));
    let mut lost = Trained::new("runs/mine".to_owned(), None, |_, _, _| Err("no weights".into()));
    let error = rollout(&mut eyes, &mut lost, 3, 1.into()).unwrap_err().to_string();
    assert!(error.contains("runs/mine") && error.contains("no weights"), "{error}");
}
