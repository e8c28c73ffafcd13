"""The environments play what the collector records, and are what Gymnasium and dm_env expect."""

import multiprocessing
import os
import threading
import unittest
import warnings

import dm_env.test_utils
import gymnasium
import numpy as np
import pytest
import vibes
from gymnasium.utils.env_checker import check_env

TASKS = ["ball_in_cup-catch", "cartpole-swingup", "cheetah-run", "finger-spin", "reacher-easy", "walker-walk", "swimmer-6"]


def assert_same_row(episode, row, pixels, state):
    np.testing.assert_array_equal(pixels, episode.pixels[row])
    np.testing.assert_array_equal(state, episode.observation[row])


@pytest.mark.parametrize("task", TASKS)
def test_episodes_are_those_of_a_recording_frame_by_frame(task, recorded):
    path = recorded("--task", task, "--episodes", "3", "--steps", "6", "--size", "32", "--seed", "5", "--difficulty", "medium")
    env = vibes.make(task, difficulty="medium", size=32, seed=5, observation="both")
    for episode in vibes.open(path):
        observation, info = env.reset()
        assert info["episode_number"] == episode.index
        assert_same_row(episode, 0, **observation)
        for t, action in enumerate(episode.action):
            observation, reward, terminated, truncated, _ = env.step(action)
            assert_same_row(episode, t + 1, **observation)
            assert np.float32(reward) == episode.reward[t] and not terminated and not truncated


def test_a_cell_of_a_grid_can_be_played(recorded):
    path = recorded("--grid", "2x3", "--steps", "4", "--size", "32", "--seed", "9", "--render", "suite")
    env = vibes.make(size=32, render="suite", observation="both")
    for episode in vibes.open(path):
        state, distractor = episode.cell
        observation, _ = env.reset(seed=9, options={"state": state, "distractor": distractor})
        assert_same_row(episode, 0, **observation)
        for t, action in enumerate(episode.action):
            assert_same_row(episode, t + 1, **env.step(action)[0])


def test_seeds_of_axes_and_static_distractors_are_the_collectors(recorded):
    path = recorded("--episodes", "2", "--steps", "3", "--size", "32", "--static", "--distract", "camera,color", "--camera-seed", "7", "--seed", "1")
    env = vibes.make(size=32, dynamic=False, distract="camera,color", camera_seed=7, seed=1, observation="both")
    for episode in vibes.open(path):
        assert_same_row(episode, 0, **env.reset()[0])
        for t, action in enumerate(episode.action):
            assert_same_row(episode, t + 1, **env.step(action)[0])


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_many_environments_play_what_single_ones_do_whatever_the_threads(threads):
    many = vibes.make_vec("reacher-easy", 5, threads=threads, size=24, observation="both", action_repeat=125, seed=3)
    single = vibes.make("reacher-easy", size=24, observation="both", action_repeat=125, seed=3)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, (20, 5, 2)).astype(np.float32)
    seen, info = many.reset()
    history = [(seen, None, None, info["episode_number"])]
    for step in actions:
        seen, reward, terminated, truncated, info = many.step(step)
        assert not terminated.any()
        history.append((seen, reward, truncated, info["episode_number"]))
    assert history[-1][3].tolist() == [10, 11, 12, 13, 14], "8 steps and a reset an episode"
    for i in range(5):
        number, over = i, True
        for t, (seen, reward, truncated, numbers) in enumerate(history):
            assert numbers[i] == (number if not over or t == 0 else number + 5)
            if over:
                number = numbers[i]
                observation, _ = single.reset(options={"episode": int(number)})
                over, earned = False, 0.0
            else:
                observation, earned, _, over, _ = single.step(actions[t - 1, i])
            np.testing.assert_array_equal(seen["pixels"][i], observation["pixels"])
            np.testing.assert_array_equal(seen["state"][i], observation["state"])
            assert reward is None or reward[i] == earned
            assert truncated is None or truncated[i] == over


@pytest.mark.parametrize("observation", ["pixels", "state", "both"])
def test_gymnasiums_own_checker_is_content(observation):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Vectors of positions and velocities have no bounds; the checker would rather they had.
        warnings.filterwarnings("ignore", message=".*A Box observation space m(ax|in)imum value is -?infinity.*")
        warnings.filterwarnings("ignore", message=".*Not able to test alternative render modes.*")
        env = gymnasium.make(
            "vibes/cartpole-swingup-v0", size=32, observation=observation, render_mode="rgb_array", disable_env_checker=True
        )
        check_env(env.unwrapped)


def test_gymnasium_knows_every_task_by_its_id():
    named = vibes._vibes.example_tasks()
    assert set(TASKS) <= set(named) and all(any(name.startswith(task.removesuffix("N")) for name in named) for task in vibes.tasks())
    for task in named:
        env = gymnasium.make(f"vibes/{task}-v0", observation="state")
        env.reset(seed=0)
        observation, *_ = env.step(env.action_space.sample())
        assert env.observation_space.contains(observation)
        env.close()
    many = gymnasium.make_vec("vibes/reacher-easy-v0", num_envs=2, vectorization_mode="vector_entry_point", size=16)
    observation, _ = many.reset(seed=1)
    assert many.observation_space.contains(observation)


def test_an_episode_is_1000_control_steps():
    env = vibes.make("cartpole-swingup", observation="state", action_repeat=300)
    env.reset()
    over = [env.step(env.action_space.sample())[3] for _ in range(4)]
    assert over == [False, False, False, True]
    with pytest.raises(vibes.Error, match="the episode is over"):
        env.step(env.action_space.sample())
    env.reset()
    env.step(env.action_space.sample())


def test_pictures_are_rendered_and_seeds_repeat():
    env = vibes.make(size=48, render_mode="rgb_array")
    first, _ = env.reset(seed=4)
    np.testing.assert_array_equal(env.render(), first)
    second, _ = env.reset()
    again, _ = env.reset(seed=4)
    np.testing.assert_array_equal(first, again)
    assert (first != second).any()
    other, _ = env.reset(seed=5)
    assert (first != other).any()


def test_distractors_differ_and_states_do_not_along_a_row_of_the_grid():
    env = vibes.make(observation="both", size=32)
    one, _ = env.reset(seed=0, options={"state": 1, "distractor": 1})
    two, _ = env.reset(options={"state": 1, "distractor": 2})
    np.testing.assert_array_equal(one["state"], two["state"])
    assert (one["pixels"] != two["pixels"]).any()


def test_state_alone_asks_for_no_pictures():
    env = vibes.make("walker-walk", observation="state")
    assert env.world.spec["pixels"] is None and env.render() is None
    with pytest.raises(vibes.Error, match="size"):
        vibes.make(size=None)


class Conformance(dm_env.test_utils.EnvironmentTestMixin):
    """dm_env's own conformance test."""

    observation = "pixels"

    def make_object_under_test(self):
        return vibes.make_dm("cartpole-swingup", size=16, observation=self.observation, action_repeat=50)


class TestDmPixels(Conformance, unittest.TestCase):
    pass


class TestDmState(Conformance, unittest.TestCase):
    observation = "state"


class TestDmBoth(Conformance, unittest.TestCase):
    observation = "both"


@pytest.mark.parametrize(
    "observation, names", [("pixels", ["pixels"]), ("state", ["position", "velocity"]), ("both", ["position", "velocity", "pixels"])]
)
def test_dm_observations_have_dm_controls_names(observation, names):
    env = vibes.make_dm("cartpole-swingup", size=16, observation=observation, action_repeat=400)
    assert list(env.observation_spec()) == names == list(env.reset().observation)
    steps = [env.step(np.zeros(1)) for _ in range(4)]
    assert [step.last() for step in steps] == [False, False, True, False]
    assert steps[2].discount == 1.0 and steps[3].first()


def test_dm_parts_have_dm_controls_shapes():
    env = vibes.make_dm("walker-walk", observation="state", action_repeat=500)
    # As dm_control's suite.load("walker", "walk") says them.
    shapes = {"orientations": (14,), "height": (), "velocity": (9,)}
    assert {name: spec.shape for name, spec in env.observation_spec().items()} == shapes
    assert {name: part.shape for name, part in env.reset().observation.items()} == shapes


def test_errors_name_what_would_be_right():
    wrong = [
        (dict(task="reacher-hard"), "reacher-easy"),
        (dict(difficulty="harder"), "easy, medium, hard"),
        (dict(distract=["sound"]), "background, camera, color"),
        (dict(video_set="test"), "train, val"),
        (dict(render="nice"), "suite, fast"),
        (dict(size=0), "1 to 2048"),
        (dict(size=4096), "1 to 2048"),
        (dict(action_repeat=0), "1 to 1000"),
        (dict(videos="/nowhere"), "/nowhere"),
        (dict(seed=-1), "2\\*\\*64"),
        (dict(observation="sound"), "pixels, state, both"),
        (dict(render_mode="human"), "rgb_array"),
    ]
    for arguments, words in wrong:
        with pytest.raises(vibes.Error, match=words):
            vibes.make(**arguments)
    env = vibes.make(size=16)
    with pytest.raises(vibes.Error, match="call reset"):
        env.step([0, 0])
    env.reset()
    with pytest.raises(vibes.Error, match=r"right is \[1, 2\]"):
        env.step([0, 0, 0])
    with pytest.raises(vibes.Error, match=r"action\[1\] is NaN"):
        env.step([0, np.nan])
    env.step([0, 0])
    for options in ({"distractor": 5}, {"episode": 12, "state": 3}):
        with pytest.raises(vibes.Error, match="an episode alone"):
            env.reset(options=options)
    env.close()
    env.close()
    with pytest.raises(vibes.Error, match="closed"):
        env.step([0, 0])


def test_environments_may_be_used_from_any_thread():
    env = vibes.make(size=24)
    seen = []
    for _ in range(3):
        thread = threading.Thread(target=lambda: seen.append(env.reset(seed=1)[0]))
        thread.start()
        thread.join()
    assert (seen[0] == seen[2]).all()


def test_the_interpreters_lock_is_free_while_environments_work():
    many = vibes.make_vec("cheetah-run", 4, size=64)
    many.reset()
    ticks, done = [], threading.Event()

    def tick():
        while not done.wait(0.001):
            ticks.append(None)

    thread = threading.Thread(target=tick)
    thread.start()
    # One call of a second or so.
    many.world._native.roll(60, True)
    count = len(ticks)
    done.set()
    thread.join()
    assert count > 20


def _step_after_fork(env, answers):
    try:
        env.step([0, 0])
    except vibes.Error as error:
        answers.put(str(error))


def test_a_fork_raises_instead_of_waiting_for_ever():
    env = vibes.make(size=16)
    env.reset()
    context = multiprocessing.get_context("fork")
    answers = context.Queue()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        child = context.Process(target=_step_after_fork, args=(env, answers))
        child.start()
    assert "another process" in answers.get(timeout=60)
    child.join(60)
    assert child.exitcode == 0
    env.step([0, 0])
    assert os.getpid() != child.pid
