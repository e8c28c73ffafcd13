//! Laws that hold for every registered task, so that a new task is tested without new tests.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::HashSet;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use vibes_data::{About, Quantity};
use vibes_env::{
    Environment, EnvironmentOptions, Eyes, HeldRandom, KNOWN_SLIDE, Planner, PlannerSettings, Policy, Random,
    SingleRandom, Snapshot, Start, StateTrajectory, all_example_tasks, example_tasks, known_reward,
    large_example_tasks, rollout, suite_tasks, symmetric_tasks, task_help, task_names,
};

/// Every task, and the one that is for tests.
fn tasks() -> Vec<&'static str> {
    example_tasks().into_iter().chain([KNOWN_SLIDE]).collect()
}

fn environment(task: &str) -> Environment {
    Environment::new(task, EnvironmentOptions::default()).unwrap()
}

fn random_rollout(task: &str, steps: u32, seed: u64) -> StateTrajectory {
    rollout(&mut Eyes::blind(environment(task)).unwrap(), &mut Random, steps, seed.into()).unwrap()
}

#[test]
fn specs_are_sensible_and_observations_fit_them() {
    for task in tasks() {
        let environment = environment(task);
        let parts = environment.observation_spec();
        let names: HashSet<&str> = parts.iter().map(|part| part.name.as_str()).collect();
        assert_eq!(names.len(), parts.len(), "{task}: two parts of one name");
        let bounds = environment.action_spec();
        assert_eq!(bounds.min.len(), environment.action_len(), "{task}");
        assert!(
            bounds.min.iter().zip(&bounds.max).all(|(low, high)| low.is_finite() && high.is_finite() && low < high)
        );
        let len: usize = parts.iter().map(|part| part.len).sum();
        let trajectory = random_rollout(task, 3, 0);
        assert!(trajectory.observations.iter().all(|observation| observation.len() == len), "{task}: {len} numbers");
    }
}

/// Values of a task's quantities in the present state, by name.
fn quantities(environment: &Environment) -> Vec<(String, About, f64)> {
    let mut observation = Vec::new();
    environment.observe(&mut observation);
    let observation: Vec<f32> = observation.iter().map(|&x| x as f32).collect();
    let (qpos, qvel) = (environment.physics().qpos(), environment.physics().qvel());
    let value = |quantity: &Quantity| quantity.formula.value(&observation, qpos, qvel);
    environment.quantities().iter().map(|q| (q.name.clone(), q.about, value(q))).collect()
}

/// Every task names its numbers, so that what is read from a latent can be understood: each of the task's own moves during an episode, and whoever looks for
/// `velocity` finds some.
#[test]
fn every_task_names_its_quantities() {
    for task in tasks() {
        let mut environment = environment(task);
        environment.reset(&mut ChaCha8Rng::seed_from_u64(2)).unwrap();
        let first = quantities(&environment);
        let names: HashSet<&str> = first.iter().map(|(name, ..)| name.as_str()).collect();
        assert_eq!(names.len(), first.len(), "{task}: two quantities of one name");
        assert!(names.iter().any(|name| name.contains("velocity")), "{task}: {names:?}");
        assert!(names.iter().all(|name| !name.contains(['[', '/', '_'])), "{task}: no place for an index: {names:?}");
        let mut moved = vec![false; first.len()];
        for step in 0..8 {
            let action = (0..environment.action_len()).map(|axis| if (step / 2 + axis) % 2 == 0 { 0.9 } else { -0.6 });
            environment.step(&action.collect::<Vec<f64>>()).unwrap();
            for ((moved, before), (name, about, now)) in moved.iter_mut().zip(&first).zip(quantities(&environment)) {
                assert!(now.is_finite() && about != About::Distractor, "{task}: {name} is {now}");
                *moved |= (before.2 - now).abs() > 1e-9;
            }
        }
        for (moved, (name, _, before)) in moved.iter().zip(&first) {
            // The finger's spinner rests until it is touched.
            let rests = name.starts_with("touch") || name.starts_with("spinner");
            assert!(*moved || rests, "{task}: {name} stays at {before}");
        }
    }
}

/// Where a state can be turned without physics and reward noticing, the task's own quantities do not notice either, and those it calls superfluous do.
#[test]
fn quantities_of_a_turned_state_are_the_same_but_for_the_superfluous() {
    let mut turned = Vec::new();
    for task in tasks() {
        let mut environment = environment(task);
        let mut start = environment.reset(&mut ChaCha8Rng::seed_from_u64(3)).unwrap();
        let before = quantities(&environment);
        if environment.rotate(&mut start, 0.7).is_err() {
            assert!(before.iter().all(|(_, about, _)| *about == About::Task), "{task} has no symmetry");
            continue;
        }
        environment.reset_to(&start).unwrap();
        for ((name, about, before), (_, _, after)) in before.iter().zip(quantities(&environment)) {
            let same = (before - after).abs() < 1e-6;
            assert_eq!(same, *about == About::Task, "{task}: {name} was {before} and is {after}");
        }
        assert!(before.iter().any(|(_, about, _)| *about == About::Symmetry), "{task}: what a turn changes");
        turned.push(task);
    }
    assert_eq!(turned, symmetric_tasks(), "the registry's word for it");
    let error = environment(KNOWN_SLIDE).rotate(&mut Start::default(), 0.7).unwrap_err().to_string();
    assert!(turned.iter().all(|task| error.contains(task)), "{error}");
}

/// What the registry asks of a task's file, so that nothing else has to be told of a new task.
#[test]
fn a_task_says_everything_itself() {
    let names = task_names();
    assert_eq!(names.iter().collect::<HashSet<_>>().len(), names.len(), "two tasks of one name");
    assert!(names.iter().all(|name| task_help().contains(name)), "{}", task_help());
    assert!(!names.contains(&KNOWN_SLIDE), "the task for tests is not listed");
    let all = all_example_tasks();
    assert!(example_tasks().iter().chain(&large_example_tasks()).all(|task| all.contains(task)), "{all:?}");
    for task in all {
        assert_eq!(environment(task).name(), task);
    }
    for task in tasks() {
        let environment = environment(task);
        assert_eq!(environment.name(), task, "a task is loaded under the name it was asked for");
        let PlannerSettings { horizon, knots, samples, kept, fresh, widest } = environment.planner_settings();
        assert!(
            horizon >= 2 && knots >= 2 && kept >= 1 && samples > kept,
            "{task}: {:?}",
            environment.planner_settings()
        );
        assert!((0.0..1.0).contains(&fresh) && widest > 0.0, "{task}");
        assert!((0.0..=1.0).contains(&environment.scenery().ground_alpha), "{task}");
    }
}

/// So that what was trained on one name goes on with recordings of the other.
#[test]
fn a_swimmer_has_one_name() {
    assert_eq!(environment("swimmer-swimmer6").name(), "swimmer-6");
    assert!(tasks().into_iter().all(|task| environment(task).name() == task));
}

/// What the help promises is what MuJoCo loads: its reader of XML takes no more links, each of which lies within the one before it.
#[test]
fn the_longest_swimmer_moves_and_a_longer_one_is_no_task() {
    assert!(task_help().contains("3 to 496"), "{}", task_help());
    let mut longest = environment("swimmer-496");
    longest.reset(&mut ChaCha8Rng::seed_from_u64(0)).unwrap();
    assert_eq!(longest.physics().qpos().len(), 3 + 495, "a place and an angle of the head, and the joints");
    assert!(longest.control_step(&[0.0; 4]).unwrap().is_finite());
    let error = Environment::new("swimmer-497", EnvironmentOptions::default()).unwrap_err().to_string();
    assert!(error.contains("unknown task swimmer-497") && error.contains("3 to 496"), "{error}");
}

/// With its task's own settings the planner acts, and keeps to the bounds.
#[test]
fn the_planner_acts_on_every_task() {
    for task in tasks() {
        let options = EnvironmentOptions::default();
        let mut planner = Planner::new(task, options, 0.0).unwrap();
        let trajectory = rollout(&mut Eyes::blind(environment(task)).unwrap(), &mut planner, 2, 1.into()).unwrap();
        let bounds = environment(task).action_spec();
        for action in &trajectory.actions {
            let mut inside = action.iter().zip(bounds.min.iter().zip(&bounds.max));
            assert!(inside.all(|(number, (low, high))| (low..=high).contains(&number)), "{task}: {action:?}");
        }
    }
}

#[test]
fn action_repeats_and_episode_lengths_are_those_of_the_distracting_control_suite() {
    let expected = [
        ("ball_in_cup-catch", 4, 250, 0.02),
        ("cartpole-swingup", 8, 125, 0.01),
        ("cheetah-run", 4, 250, 0.01),
        ("finger-spin", 2, 500, 0.02),
        ("reacher-easy", 4, 250, 0.02),
        ("walker-walk", 2, 500, 0.025),
        ("swimmer-3", 10, 100, 0.03),
    ];
    let of_the_suite: Vec<(&str, u32)> = expected[..6].iter().map(|&(task, repeat, ..)| (task, repeat)).collect();
    assert_eq!(suite_tasks(), of_the_suite);
    for (task, action_repeat, steps, control_timestep) in expected {
        let environment = environment(task);
        assert_eq!((environment.action_repeat(), environment.episode_steps()), (action_repeat, steps), "{task}");
        assert!((environment.control_timestep() - control_timestep).abs() < 1e-12, "{task}");
    }
}

#[test]
fn numbers_are_finite_and_rewards_of_a_control_step_are_in_0_to_1() {
    for task in tasks() {
        let options = EnvironmentOptions { action_repeat: Some(1), raw_torques: false };
        let mut eyes = Eyes::blind(Environment::new(task, options).unwrap()).unwrap();
        let trajectory = rollout(&mut eyes, &mut Random, 300, 3.into()).unwrap();
        assert!(trajectory.observations.iter().flatten().all(|number| number.is_finite()), "{task}");
        assert!(trajectory.rewards.iter().all(|reward| (0.0..=1.0).contains(reward)), "{task}");
    }
}

#[test]
fn a_trajectory_of_t_actions_has_t_plus_1_rows() {
    for task in tasks() {
        let trajectory = random_rollout(task, 4, 1);
        assert_eq!([trajectory.actions.len(), trajectory.rewards.len()], [4, 4], "{task}");
        let rows = [trajectory.observations.len(), trajectory.qpos.len(), trajectory.qvel.len()];
        assert_eq!(rows, [5, 5, 5], "{task}");
        assert_eq!(trajectory.qpos[0], trajectory.start.qpos, "{task}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_seed_another_start() {
    for task in tasks() {
        let first = random_rollout(task, 25, 11);
        assert_eq!(first, random_rollout(task, 25, 11), "{task}");
        let other = random_rollout(task, 25, 12);
        assert_ne!(first.observations[0], other.observations[0], "{task}: the start");
        assert_ne!(first.actions, other.actions, "{task}: the actions");
    }
}

/// Single precision draws other numbers, and its actions are executed as they are drawn.
#[test]
fn uniform_actions_of_either_precision_stay_within_the_bounds() {
    for task in tasks() {
        let mut eyes = Eyes::blind(environment(task)).unwrap();
        let [double, single] = [&mut Random as &mut dyn Policy, &mut SingleRandom]
            .map(|policy| rollout(&mut eyes, policy, 25, 11.into()).unwrap());
        assert_eq!(double.start, single.start, "{task}");
        assert_ne!(double.actions, single.actions, "{task}");
        let bounds = environment(task).action_spec();
        for action in double.actions.iter().chain(&single.actions) {
            let mut pairs = action.iter().zip(bounds.min.iter().zip(&bounds.max));
            assert!(pairs.all(|(number, (low, high))| (low..=high).contains(&number)), "{task}: {action:?}");
        }
    }
}

/// A held action is the same for so many steps and then another, also in an episode after one that ended amid a hold.
#[test]
fn a_held_random_action_changes_when_its_steps_are_over() {
    let mut policy = HeldRandom::new(4);
    for seed in [3, 4] {
        let mut eyes = Eyes::blind(environment("reacher-easy")).unwrap();
        let actions = rollout(&mut eyes, &mut policy, 10, seed.into()).unwrap().actions;
        let held = rollout(&mut eyes, &mut HeldRandom::new(1), 10, seed.into()).unwrap().actions;
        assert_eq!(held, rollout(&mut eyes, &mut Random, 10, seed.into()).unwrap().actions);
        for (step, pair) in actions.windows(2).enumerate() {
            assert_eq!(pair[0] != pair[1], (step + 1) % 4 == 0, "{step}");
        }
    }
}

#[test]
fn no_observation_is_constant() {
    for task in tasks() {
        let rows: Vec<Vec<f64>> = (0..6)
            .flat_map(|seed| random_rollout(task, environment(task).episode_steps() / 2, seed).observations)
            .collect();
        for place in 0..rows[0].len() {
            assert!(
                rows.iter().any(|row| row[place] != rows[0][place]),
                "{task}: number {place} is {}",
                rows[0][place]
            );
        }
    }
}

#[test]
fn an_episode_can_be_simulated_again_from_its_start() {
    for task in tasks() {
        let trajectory = random_rollout(task, 40, 5);
        let mut environment = environment(task);
        environment.reset_to(&trajectory.start).unwrap();
        for (step, action) in trajectory.actions.iter().enumerate() {
            assert_eq!(environment.step(action).unwrap(), trajectory.rewards[step], "{task}: reward {step}");
            assert_eq!(environment.physics().qpos(), trajectory.qpos[step + 1], "{task}: qpos {}", step + 1);
        }
    }
}

/// Forces belong to the step before, and a state alone does not say what they were.
const NOT_OF_THE_STATE: [(&str, &str); 1] = [("finger-spin", "touch")];

#[test]
fn the_stored_state_gives_the_observation_again() {
    for task in tasks() {
        let trajectory = random_rollout(task, 30, 8);
        let mut environment = environment(task);
        let parts = environment.observation_spec();
        let mut observation = Vec::new();
        for row in [0, 7, 30] {
            let mut state = trajectory.start.clone();
            (state.qpos, state.qvel) = (trajectory.qpos[row].clone(), trajectory.qvel[row].clone());
            environment.reset_to(&state).unwrap();
            environment.observe(&mut observation);
            let mut place = 0;
            for part in &parts {
                let range = place..place + part.len;
                place += part.len;
                if NOT_OF_THE_STATE.contains(&(task, part.name.as_str())) {
                    continue;
                }
                let pairs = observation[range.clone()].iter().zip(&trajectory.observations[row][range]);
                // Every pair by itself: the largest of differences would pass over one that is none.
                for (got, expected) in pairs {
                    assert!((got - expected).abs() < 1e-12, "{task}: {} of row {row}: {got}, {expected}", part.name);
                }
            }
        }
    }
}

#[test]
fn a_restored_simulation_goes_on_bit_for_bit() {
    for task in tasks() {
        let mut environment = environment(task);
        environment.reset(&mut ChaCha8Rng::seed_from_u64(2)).unwrap();
        let actions = random_rollout(task, 20, 2).actions;
        for action in &actions[..8] {
            environment.step(action).unwrap();
        }
        let mut snapshot = Snapshot::default();
        environment.save(&mut snapshot);
        let go_on = |environment: &mut Environment| -> Vec<(f64, Vec<f64>)> {
            let mut step = |action: &Vec<f64>| {
                let reward = environment.step(action).unwrap();
                let mut observation = Vec::new();
                environment.observe(&mut observation);
                (reward, observation)
            };
            actions[8..].iter().map(&mut step).collect()
        };
        let first = go_on(&mut environment);
        environment.restore(&snapshot);
        let mut observation = Vec::new();
        environment.observe(&mut observation);
        assert_eq!(first, go_on(&mut environment), "{task}");
    }
}

/// A planner goes on from its snapshot after a plan that broke the simulation, and the next plan may break it too.
#[test]
fn a_simulation_that_breaks_again_without_a_reset_says_so_again() {
    for task in tasks() {
        let mut environment = environment(task);
        environment.reset(&mut ChaCha8Rng::seed_from_u64(2)).unwrap();
        let mut snapshot = Snapshot::default();
        environment.save(&mut snapshot);
        let rest = vec![0.0; environment.action_len()];
        for time in 1..=3 {
            environment.physics_mut().qvel_mut()[0] = f64::NAN;
            let error = environment.control_step(&rest).unwrap_err().to_string();
            assert!(error.contains("became unstable") && error.contains("bad q"), "{task}, time {time}: {error}");
            environment.restore(&snapshot);
        }
        environment.control_step(&rest).unwrap();
    }
}

#[test]
fn a_row_holds_the_action_taken_there_and_the_reward_it_earned() {
    for action_repeat in [1, 2, 5] {
        let options = EnvironmentOptions { action_repeat: Some(action_repeat), raw_torques: false };
        let mut eyes = Eyes::blind(Environment::new(KNOWN_SLIDE, options).unwrap()).unwrap();
        let trajectory = rollout(&mut eyes, &mut Random, 60, 4.into()).unwrap();
        for step in 0..trajectory.steps() {
            let reward = |row: usize, action: usize| {
                let [position, velocity] = trajectory.observations[row][..] else { panic!("two numbers") };
                known_reward([position, velocity], trajectory.actions[action][0], action_repeat)
            };
            assert!((trajectory.rewards[step] - reward(step, step)).abs() < 1e-12, "step {step}");
            // The formula tells neighbouring rows apart, or this test would prove nothing.
            assert!((trajectory.rewards[step] - reward(step + 1, step)).abs() > 1e-9, "step {step}: the next row");
        }
    }
}

#[test]
fn an_unknown_task_lists_the_known_ones() {
    for name in ["", "reacher", "reacher-hard", "swimmer-2", "swimmer-x", "swimmer-", "swimmer-9999999"] {
        let error = Environment::new(name, EnvironmentOptions::default()).unwrap_err().to_string();
        assert!(error.contains("reacher-easy") && error.contains("swimmer-N"), "{name}: {error}");
    }
}

#[test]
fn wrong_lengths_are_errors_and_change_nothing() {
    let mut environment = environment("reacher-easy");
    let start = environment.reset(&mut ChaCha8Rng::seed_from_u64(0)).unwrap();
    assert!(environment.step(&[0.0; 3]).unwrap_err().to_string().contains("an action has 3 numbers"));
    let mut short = start.clone();
    short.qpos.pop();
    assert!(environment.reset_to(&short).unwrap_err().to_string().contains("qpos has 1 numbers"));
    assert_eq!(environment.physics().qpos(), start.qpos);
}

#[test]
fn model_overrides_are_checked_applied_and_taken_back() {
    let mut environment = environment("reacher-easy");
    let mut start = environment.reset(&mut ChaCha8Rng::seed_from_u64(0)).unwrap();
    let target = environment.physics().geom("target").unwrap();
    start.model_overrides.set("geom_pos", "target", &[0.1, -0.1, 0.01]);
    start.model_overrides.set("mat_rgba", "self", &[0.0, 0.25, 1.0, 1.0]);
    environment.reset_to(&start).unwrap();
    assert_eq!(environment.physics().model().geom_pos()[target], [0.1, -0.1, 0.01]);
    let mut observation = Vec::new();
    environment.observe(&mut observation);
    let wrong = [
        ("geom_place", "target", &[0.0; 3][..], "the fields are"),
        ("geom_pos", "goal", &[0.0; 3], "no geom named goal"),
        ("geom_pos", "target", &[0.0; 2], "takes 3"),
        ("geom_pos", "target", &[f64::NAN, 0.0, 0.0], "not finite"),
    ];
    for (field, object, numbers, said) in wrong {
        let mut wrong = start.clone();
        wrong.model_overrides.set(field, object, numbers);
        let error = environment.reset_to(&wrong).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
    let drawn = environment.reset(&mut ChaCha8Rng::seed_from_u64(1)).unwrap();
    let materials = environment.physics().model().mat_rgba();
    assert!(!materials.contains(&[0.0, 0.25, 1.0, 1.0]), "the colour is the model's own again");
    assert_eq!(
        environment.physics().model().geom_pos()[target],
        drawn.model_overrides.get("geom_pos", "target").unwrap()
    );
}
