//! A recording holds what eyes see: every row of every cell of a grid, drawn from stored states, is the row that eyes draw while the same episode goes on.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::sync::atomic::AtomicBool;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use vibes_collect::plan::{ChosenSeeds, RecordOptions, distractor_seed, state_seed};
use vibes_collect::recorder::{PolicyMaker, RecordRun, Source, record};
use vibes_data::{Grid, Recording};
use vibes_env::distractors::DistractorSettings;
use vibes_env::render::Look;
use vibes_env::videos::{VideoSet, VideoSource};
use vibes_env::{Eyes, example_tasks};

const GRID: Grid = Grid { states: 2, distractors: 2 };
const SEED: u64 = 5;

fn options(task: &str) -> RecordOptions {
    RecordOptions {
        task: task.to_owned(),
        policy: "random:1".to_owned(),
        grid: Some(GRID),
        episodes: GRID.states * GRID.distractors,
        steps: 4,
        action_repeat: 3,
        raw_torques: false,
        distractors: DistractorSettings::default(),
        videos: VideoSource::Procedural,
        video_set: VideoSet::Train,
        video_count: Some(2),
        size: Some(24),
        look: Look::Fast,
        axis_seeds: ChosenSeeds::default(),
        acting: Vec::new(),
        rotated: None,
    }
}

fn recorded(options: &RecordOptions, folder: &std::path::Path) -> Recording {
    let run = RecordRun {
        options,
        seed: SEED,
        threads: 1,
        with_mcap: false,
        source: Source::Simulation,
        turn: 0.0,
        policies: PolicyMaker::default(),
        stop: &AtomicBool::new(false),
    };
    record(folder, &run, &|_| {}).unwrap()
}

#[test]
fn every_row_of_a_grid_is_what_eyes_see() {
    for task in example_tasks() {
        let folder = tempfile::tempdir().unwrap();
        let options = options(task);
        let recording = recorded(&options, folder.path());
        let environment = options.environment().unwrap();
        let videos = options.video_library().unwrap();
        let mut eyes = Eyes::new(environment, options.distractors, options.pictures(), videos).unwrap();
        for entry in recording.episodes() {
            let (view, cell) = (recording.episode(entry.index).unwrap(), entry.cell.unwrap());
            assert_eq!(view.acting_distractor(), None, "a random policy sees nothing");
            let mut start = ChaCha8Rng::seed_from_u64(state_seed(SEED, cell.state));
            eyes.reset(&mut start, distractor_seed(SEED, cell.distractor).into()).unwrap();
            for row in 0..view.rows() {
                let frame = eyes.frame().unwrap();
                let said = format!("{task}, cell {},{}, row {row}", cell.state, cell.distractor);
                assert_eq!(frame.qpos, view.qpos(row), "{said}");
                assert_eq!(frame.qvel, view.qvel(row), "{said}");
                assert_eq!(frame.observation, view.observation(row), "{said}");
                assert_eq!((frame.camera, frame.background), (view.camera(row), view.background(row)), "{said}");
                assert_eq!(frame.colors, view.colors(row), "{said}");
                assert!(frame.pixels == view.pixels(row), "{said}: another picture");
                if row < view.steps() {
                    let action: Vec<f64> = view.action(row).iter().map(|&number| f64::from(number)).collect();
                    assert_eq!(eyes.step(&action).unwrap() as f32, view.reward(row), "{said}");
                }
            }
        }
    }
}
