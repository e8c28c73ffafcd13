//! A recording holds what eyes see: every row of every cell of a grid, drawn from stored states, is the row that eyes draw while the same episode goes on.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;
use std::sync::atomic::AtomicBool;

use rand::{RngCore, SeedableRng};
use rand_chacha::ChaCha8Rng;
use vibes_collect::plan::{ChosenSeeds, RecordOptions, distractor_seed, state_seed};
use vibes_collect::recorder::{PolicyMaker, RecordRun, Source, record};
use vibes_collect::trained::ActedBy;
use vibes_data::{Grid, Recording};
use vibes_env::distractors::DistractorSettings;
use vibes_env::render::{Look, RenderSettings};
use vibes_env::videos::{VideoSet, VideoSource};
use vibes_env::{EnvironmentOptions, Eyes, Policy, PolicySpec, Sight, Start, example_tasks};

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
        actions: Vec::new(),
        protocol: None,
        rotated: None,
        redrawn: false,
    }
}

fn recorded(options: &RecordOptions, folder: &Path, policies: PolicyMaker<'_>) -> Recording {
    let run = RecordRun {
        options,
        seed: SEED,
        threads: 2,
        with_mcap: false,
        source: Source::Simulation,
        turn: 0.0,
        policies,
        stop: &AtomicBool::new(false),
    };
    record(folder, &run, &|_| {}).unwrap()
}

#[test]
fn every_row_of_a_grid_is_what_eyes_see() {
    for task in example_tasks() {
        let folder = tempfile::tempdir().unwrap();
        let options = options(task);
        let recording = recorded(&options, folder.path(), PolicyMaker::default());
        let environment = options.environment().unwrap();
        let videos = options.video_library(&|_| true).unwrap();
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

/// Acts by what it sees: each number of its action is a sum over the picture.
#[derive(Debug)]
struct Onlooker {
    pictures: RenderSettings,
}

impl Onlooker {
    fn action(pixels: &[u8], len: usize) -> Vec<f64> {
        let sum = |offset: usize| pixels.iter().skip(offset).step_by(len + 1).map(|&byte| u64::from(byte)).sum::<u64>();
        (0..len).map(|number| (sum(number) % 2001) as f64 / 1000.0 - 1.0).collect()
    }
}

impl Policy for Onlooker {
    fn pictures(&self) -> Option<RenderSettings> {
        Some(self.pictures)
    }

    fn begin(&mut self, _: &Start) -> vibes_env::Result<()> {
        Ok(())
    }

    fn act(&mut self, sight: &Sight<'_>, _: &mut dyn RngCore) -> vibes_env::Result<Vec<f64>> {
        Ok(Self::action(sight.pixels, sight.environment.action_len()))
    }
}

/// A recording of a policy that sees pictures: it acts once a row, under the distractors of the row's acting distractor, and the other columns are drawn
/// from the same states.
#[test]
fn a_policy_that_sees_acts_once_a_row_under_its_acting_distractor() {
    let folder = tempfile::tempdir().unwrap();
    // Other pictures than the recorded ones.
    let pictures = RenderSettings { size: 16, look: Look::Fast };
    let make = |_: &PolicySpec, _: &str, _: EnvironmentOptions| -> vibes_collect::Result<Box<dyn Policy>> {
        Ok(Box::new(Onlooker { pictures }))
    };
    let acting = vec![ActedBy { run: "onlooker".into(), checkpoint: "0".into(), pictures: Some(pictures) }];
    let narrow = RecordOptions { policy: "./onlooker:1".into(), acting, ..options("reacher-easy") };
    let recording = recorded(&narrow, &folder.path().join("narrow"), PolicyMaker(&make));
    assert_eq!(recording.manifest().options["acting"][0]["run"], "onlooker");
    let videos = narrow.videos_for(pictures, &|_| true).unwrap();
    let mut eyes = Eyes::new(narrow.environment().unwrap(), narrow.distractors, Some(pictures), videos).unwrap();
    for entry in recording.episodes() {
        let (view, cell) = (recording.episode(entry.index).unwrap(), entry.cell.unwrap());
        assert_eq!(view.acting_distractor(), Some(cell.state), "the diagonal of the grid");
        let mut start = ChaCha8Rng::seed_from_u64(state_seed(SEED, cell.state));
        eyes.reset(&mut start, distractor_seed(SEED, cell.state).into()).unwrap();
        for row in 0..view.steps() {
            let action = Onlooker::action(eyes.picture().unwrap(), view.action(row).len());
            let single: Vec<f32> = action.iter().map(|&number| number as f32).collect();
            assert_eq!(view.action(row), single, "cell {},{}, row {row}", cell.state, cell.distractor);
            eyes.step(&single.iter().map(|&number| f64::from(number)).collect::<Vec<_>>()).unwrap();
        }
    }
    // More columns are more views of the same states, whatever the recorded pictures.
    let wide = Grid { distractors: 3, ..GRID };
    let wide = RecordOptions { grid: Some(wide), episodes: 6, size: None, ..narrow };
    let wider = recorded(&wide, &folder.path().join("wide"), PolicyMaker(&make));
    for entry in wider.episodes() {
        let cell = entry.cell.unwrap();
        let same = recording.episodes().iter().find(|known| known.cell.unwrap().state == cell.state).unwrap();
        let (one, other) = (wider.episode(entry.index).unwrap(), recording.episode(same.index).unwrap());
        assert_eq!(one.qpos(one.steps()), other.qpos(other.steps()));
        assert_eq!(one.acting_distractor(), other.acting_distractor());
        assert!(
            one.pixels(0).is_empty() && one.background(0).is_some(),
            "what was seen is written down without pictures"
        );
    }
}
