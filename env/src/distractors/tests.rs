//! Laws over every axis, difficulty, and dynamic or static.

use std::f64::consts::{FRAC_PI_2, PI};

use super::background::{BackgroundReset, BackgroundWalk};
use super::camera::CameraBounds;
use super::*;

/// Start poses of the kinds the suite has: at the pole, seen from the side, and low behind.
fn starts() -> [CameraStart; 3] {
    let start = |r, h, v, upper_quadrant| CameraStart { pose: CameraPose { r, h, v, roll: 0.0 }, upper_quadrant };
    [start(0.75, 0.0, 0.0, false), start(1.2806, -FRAC_PI_2, 0.8961, true), start(3.0039, -1.5834, 1.5212, true)]
}

const COLORS: [f32; 6] = [0.05, 0.5, 0.95, 0.0, 1.0, 0.3];
const FRAMES: [usize; 4] = [12, 1, 60, 7];

fn undistracted(camera: CameraStart) -> Undistracted {
    Undistracted { camera, colors: COLORS.to_vec(), video_frames: FRAMES.to_vec() }
}

fn every_settings() -> impl Iterator<Item = DistractorSettings> {
    let levels = Difficulty::ALL.into_iter().flat_map(|difficulty| [(difficulty, false), (difficulty, true)]);
    levels.map(|(difficulty, dynamic)| DistractorSettings { axes: Axes::ALL, difficulty, dynamic })
}

fn trajectory(settings: &DistractorSettings, start: CameraStart, seed: u64) -> DistractorTrajectory {
    DistractorTrajectory::generate(settings, &undistracted(start), 200, 2, AxisSeeds::from(seed))
}

#[test]
fn rows_and_lengths() {
    for settings in every_settings() {
        let trajectory = trajectory(&settings, starts()[0], 1);
        assert_eq!((trajectory.rows(), trajectory.backgrounds.len(), trajectory.colors.len()), (201, 201, 201 * 6));
    }
}

#[test]
fn the_camera_stays_in_its_bounds() {
    for settings in every_settings() {
        for start in starts() {
            for seed in 0..5 {
                let delta = FRAC_PI_2 * settings.difficulty.scale() + 1e-12;
                let (near, far) = (1.0 - 0.5 * settings.difficulty.scale(), 1.0 + 1.5 * settings.difficulty.scale());
                for pose in trajectory(&settings, start, seed).cameras {
                    let own = start.pose;
                    assert!(
                        (pose.h - own.h).abs() <= delta && (pose.v - own.v).abs() <= delta && pose.roll.abs() <= delta
                    );
                    assert!(pose.r >= own.r * near - 1e-12 && pose.r <= own.r * far + 1e-12);
                    if start.upper_quadrant {
                        assert!((0.0..=FRAC_PI_2).contains(&pose.v) && (-PI..=0.0).contains(&pose.h));
                    }
                }
            }
        }
    }
}

#[test]
fn the_camera_is_no_faster_than_allowed() {
    for settings in every_settings().filter(|settings| settings.dynamic) {
        let start = starts()[2];
        let ranges = CameraRanges::new(settings.difficulty, true);
        let trajectory = DistractorTrajectory::generate(&settings, &undistracted(start), 500, 1, AxisSeeds::from(3));
        let limit = ranges.max_velocity * start.pose.r / 4.0 + 1e-12;
        let bounds = CameraBounds::new(&start, &ranges);
        // A wall in spherical coordinates may push the camera a little farther.
        let is_free = |pose: &CameraPose| {
            [(pose.r, bounds.r), (pose.h, bounds.h), (pose.v, bounds.v)]
                .iter()
                .all(|(x, (low, high))| low < x && x < high)
        };
        for pair in trajectory.cameras.windows(2) {
            let at = |pose: &CameraPose| camera::spherical_to_cartesian([pose.r, pose.h, pose.v]);
            let (before, after) = (at(&pair[0]), at(&pair[1]));
            let moved = camera::norm(std::array::from_fn(|i| after[i] - before[i]));
            assert!(!is_free(&pair[1]) || moved <= limit, "{moved} > {limit}");
            assert!((pair[1].roll - pair[0].roll).abs() <= ranges.max_roll_velocity + 1e-12);
        }
    }
}

/// Every pose of reacher's camera, which starts at the pole, ends on the +x side: the suite's round trip through Cartesian coordinates.
#[test]
fn at_the_pole_the_camera_ends_on_one_side() {
    for settings in every_settings() {
        for pose in trajectory(&settings, starts()[0], 11).cameras {
            assert!(pose.v >= 0.0);
        }
    }
}

#[test]
fn colours_stay_in_their_bounds() {
    for settings in every_settings() {
        let beta = settings.difficulty.scale() as f32;
        for row in trajectory(&settings, starts()[0], 4).colors.chunks(COLORS.len()) {
            for (now, own) in row.iter().zip(COLORS) {
                assert!((0.0..=1.0).contains(now) && (now - own).abs() <= beta + 1e-6);
            }
        }
    }
}

#[test]
fn frames_exist_and_move_by_one_at_most() {
    for settings in every_settings() {
        for seed in 0..20 {
            let trajectory =
                DistractorTrajectory::generate(&settings, &undistracted(starts()[0]), 300, 1, AxisSeeds::from(seed));
            let frames: Vec<BackgroundFrame> = trajectory.backgrounds.into_iter().flatten().collect();
            assert_eq!(frames.len(), 301);
            assert!(frames.iter().all(|frame| (frame.frame as usize) < FRAMES[frame.video as usize]));
            assert!(
                frames
                    .windows(2)
                    .all(|pair| pair[0].video == pair[1].video && pair[0].frame.abs_diff(pair[1].frame) <= 1)
            );
        }
    }
}

#[test]
fn a_video_runs_back_and_forth() {
    let reset = BackgroundReset { video: 0, start: 2, forwards: true };
    let mut walk = BackgroundWalk::reset(&reset, 4, true);
    let shown: Vec<u32> = std::iter::repeat_with(|| (walk.frame().frame, walk.advance()).0).take(12).collect();
    // The last frame twice, the first once.
    assert_eq!(shown, [2, 3, 3, 2, 1, 0, 1, 2, 3, 3, 2, 1]);
}

#[test]
fn static_distractors_keep_still() {
    for settings in every_settings().filter(|settings| !settings.dynamic) {
        for start in starts() {
            let trajectory = trajectory(&settings, start, 5);
            // The pose may move once, by the clip of the round trip, inside the reset.
            let moved = |a: f64, b: f64| (a - b).abs() > 1e-12;
            let (first, rest) = trajectory.cameras.split_first().unwrap();
            assert!(!rest.iter().any(|pose| moved(pose.r, first.r)
                || moved(pose.h, first.h)
                || moved(pose.v, first.v)
                || moved(pose.roll, first.roll)));
            assert!(trajectory.backgrounds.iter().all(|frame| *frame == trajectory.backgrounds[0]));
            assert!(trajectory.colors.chunks(COLORS.len()).all(|row| row == trajectory.colors(0)));
        }
    }
}

#[test]
fn dynamic_distractors_move() {
    for settings in every_settings().filter(|settings| settings.dynamic) {
        let trajectory = trajectory(&settings, starts()[1], 5);
        assert!(trajectory.cameras[0] != trajectory.cameras[100] && trajectory.colors(0) != trajectory.colors(100));
    }
}

#[test]
fn a_seed_makes_one_trajectory() {
    for settings in every_settings() {
        let start = starts()[1];
        assert_eq!(trajectory(&settings, start, 6), trajectory(&settings, start, 6));
        let (one, other) = (trajectory(&settings, start, 6), trajectory(&settings, start, 7));
        assert!(one.cameras != other.cameras && one.colors != other.colors);
    }
}

#[test]
fn an_axis_switched_off_leaves_the_others_alone() {
    for settings in every_settings() {
        let start = starts()[1];
        let all = trajectory(&settings, start, 8);
        let with = |axes| trajectory(&DistractorSettings { axes, ..settings }, start, 8);
        let off = with(Axes { camera: false, ..Axes::ALL });
        assert!(off.cameras.iter().all(|pose| *pose == start.pose));
        assert_eq!((&off.backgrounds, &off.colors), (&all.backgrounds, &all.colors));
        let off = with(Axes { background: false, ..Axes::ALL });
        assert!(off.backgrounds.iter().all(Option::is_none));
        assert_eq!((&off.cameras, &off.colors), (&all.cameras, &all.colors));
        let off = with(Axes { color: false, ..Axes::ALL });
        assert!(off.colors.chunks(COLORS.len()).all(|row| row == COLORS));
        assert_eq!((&off.cameras, &off.backgrounds), (&all.cameras, &all.backgrounds));
    }
}

#[test]
fn each_axis_has_its_own_seed() {
    let settings = DistractorSettings::default();
    let make = |seeds| DistractorTrajectory::generate(&settings, &undistracted(starts()[1]), 50, 1, seeds);
    let (one, other) = (make(AxisSeeds::from(1)), make(AxisSeeds { camera: 2, ..AxisSeeds::from(1) }));
    assert_ne!(one.cameras, other.cameras);
    assert_eq!((one.backgrounds, one.colors), (other.backgrounds, other.colors));
}

/// Inside an action repeat the distractors go on, though nothing is drawn.
#[test]
fn an_action_repeat_skips_rows_of_the_same_walk() {
    let settings = DistractorSettings::default();
    let make = |steps, repeat| {
        DistractorTrajectory::generate(&settings, &undistracted(starts()[2]), steps, repeat, AxisSeeds::from(9))
    };
    let (fine, coarse) = (make(40, 1), make(10, 4));
    for row in 0..=10 {
        assert_eq!(coarse.cameras[row], fine.cameras[4 * row]);
        assert_eq!(coarse.backgrounds[row], fine.backgrounds[4 * row]);
        assert_eq!(coarse.colors(row), fine.colors(4 * row));
    }
}

#[test]
fn names_are_read_as_they_are_printed() {
    for difficulty in Difficulty::ALL {
        assert_eq!(difficulty.to_string().parse::<Difficulty>().unwrap(), difficulty);
    }
    for bits in 0..8 {
        let axes = Axes { background: bits & 1 > 0, camera: bits & 2 > 0, color: bits & 4 > 0 };
        assert_eq!(axes.to_string().parse::<Axes>().unwrap(), axes);
    }
    let message = "fog".parse::<Axes>().unwrap_err().to_string();
    assert!(message.contains("fog") && message.contains("camera"), "{message}");
    assert!("harder".parse::<Difficulty>().unwrap_err().to_string().contains("easy, medium, hard"));
}

/// The table of `distracting_control/suite_utils.py` and `camera.py`: opacity of the ground, and whether the camera keeps to the upper quadrant.
#[test]
fn every_task_of_the_suite_has_the_suites_scenery() {
    let table = [
        ("ball_in_cup-catch", 0.3, true),
        ("cartpole-swingup", 0.3, true),
        ("cheetah-run", 1.0, true),
        ("finger-spin", 0.3, true),
        ("reacher-easy", 0.0, false),
        ("walker-walk", 1.0, true),
    ];
    for (task, ground_alpha, upper_quadrant) in table {
        let environment = crate::Environment::new(task, crate::EnvironmentOptions::default()).unwrap();
        assert_eq!(environment.scenery(), Scenery { upper_quadrant, ground_alpha }, "{task}");
    }
    let mut tasks: Vec<&str> = crate::suite_tasks().into_iter().map(|(task, _)| task).collect();
    tasks.sort_unstable();
    assert_eq!(tasks, table.map(|(task, ..)| task), "all of them");
}
