"""The environments play what the collector records, and are what Gymnasium and dm_env expect."""

import multiprocessing
import os
import re
import threading
import unittest
import warnings

import dm_env.test_utils
import gymnasium
import numpy as np
import pytest
import vibes
from conftest import films, forked
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


@pytest.mark.parametrize(("difficulty", "count"), [("easy", 2), ("hard", None)])
def test_the_films_of_a_plain_folder_are_the_collectors_and_held_out_ones_stay_so(difficulty, count, recorded, tmp_path):
    folder = films(tmp_path / "films", 6)
    shown = {}
    for video_set in ["train", "val"]:
        options = {"difficulty": difficulty, "size": 16, "videos": folder, "video_set": video_set, "video_count": count}
        words = ["--difficulty", difficulty, "--size", "16", "--videos", str(folder), "--video-set", video_set]
        words += [] if count is None else ["--video-count", str(count)]
        recording = vibes.open(recorded("--episodes", "1", "--steps", "2", "--seed", "4", *words))
        world = vibes.World(**options)
        assert world.videos == recording.manifest["videos"]
        shown[video_set] = {video["name"] for video in world.videos}
        env = vibes.make(**options, seed=4, observation="both")
        assert_same_row(recording[0], 0, **env.reset()[0])
    assert len(shown["train"]) == len(shown["val"]) == (count or 3)
    assert not shown["train"] & shown["val"]


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


def played_by(env, steps):
    """Which episodes an environment of many plays, and in what states, from here on."""
    for _ in range(steps):
        states, _, _, _, info = env.step(np.zeros(env.action_space.shape))
        yield info["episode_number"].tolist(), states.tolist()


def test_seeds_of_their_own_are_those_of_all_following_episodes():
    """As Gymnasium's own vector environments keep them: an environment plays what a single one of its seed does, episode after episode."""
    options = {"observation": "state", "action_repeat": 500}
    many = vibes.make_vec("cartpole-swingup", 3, seed=3, **options)
    first, info = many.reset(seed=[10, 11, None])
    history = [(info["episode_number"].tolist(), first.tolist()), *played_by(many, 8)]
    singles = [vibes.make("cartpole-swingup", seed=seed, **options) for seed in (10, 11, 3)]
    for i, (single, numbers) in enumerate(zip(singles, [[0, 1, 2], [0, 1, 2], [2, 5, 8]])):
        for episode, number in enumerate(numbers):
            observation, _ = single.reset(options={"episode": number})
            for t in range(3):
                assert history[3 * episode + t][0][i] == number
                assert history[3 * episode + t][1][i] == observation.tolist()
                if t < 2:
                    observation, *_ = single.step([0])
    assert many.world.seed == 3
    # Only those that are reset are given their seed.
    many.reset(seed=[20, 21, 22], options={"reset_mask": np.array([True, False, True])})
    keys, _ = many.world._course.ahead(np.ones(3, bool))
    assert keys == [(20, 1, 1), (11, 3, 3), (22, 1, 1)]
    many.reset(seed=5)
    assert many.world._course.ahead(np.ones(3, bool))[0] == [(5, 3, 3), (5, 4, 4), (5, 5, 5)]


def test_what_is_refused_uses_up_no_episode(tmp_path):
    many = vibes.make_vec("cartpole-swingup", 2, observation="state", action_repeat=500)
    many.reset()
    for _ in range(2):
        _, _, _, over, _ = many.step(np.zeros((2, 1)))
    assert over.all()
    # Only the second begins its next episode.
    many._over = np.array([False, True])
    for _ in range(3):
        with pytest.raises(vibes.Error, match="the episode is over"):
            many.step(np.zeros((2, 1)))
        assert many.world.episodes.tolist() == [0, 1]
    many._over = np.array([True, True])
    assert many.step(np.zeros((2, 1)))[4]["episode_number"].tolist() == [2, 3]
    with pytest.raises(vibes.Error, match="right is a whole number"):
        many.reset(seed=[7, "eight"])
    assert many.world.seed == 0 and many.reset()[1]["episode_number"].tolist() == [4, 5]
    env = vibes.make("cartpole-swingup", observation="state", action_repeat=1000)
    with vibes.Writer(tmp_path / "mine", env, mcap=False) as writer:
        env.reset()
        env.step([0])
        for wrong in ({"seed": 5}, {"seed": 0}, {"options": {"episode": 0}}):
            with pytest.raises(vibes.Error):
                env.reset(**wrong)
            assert env.world.seed == 0
        assert env.reset()[1]["episode_number"] == 1


@pytest.mark.parametrize("threads", [1, 2])
def test_a_step_that_is_refused_moves_no_environment(threads):
    options = {"observation": "state", "action_repeat": 500, "threads": threads}
    many, twin = (vibes.make_vec("cartpole-swingup", 2, **options) for _ in range(2))
    for one in (many, twin):
        one.reset()
    for actions in ([[0.1], [0.2]], [[0.5], [-0.5]]):
        for wrong, fact in [([[0.3], [np.nan]], r"environment 1: action\[0\] is NaN"), ([[np.inf], [0.3]], r"environment 0: action\[0\] is inf")]:
            with pytest.raises(vibes.Error, match=fact):
                many.step(wrong)
        (seen, rewards, _, over, _), (expected, earned, _, ended, _) = many.step(actions), twin.step(actions)
        np.testing.assert_array_equal(seen, expected)
        np.testing.assert_array_equal(rewards, earned)
        assert over.tolist() == ended.tolist()
    # The end of an episode is not lost, and the actions of environments that begin another are not looked at.
    assert over.all()
    assert many.step([[np.nan], [np.nan]])[4]["episode_number"].tolist() == [2, 3]


def test_one_environment_that_is_over_or_has_not_begun_holds_the_others():
    world = vibes.World("cartpole-swingup", environments=2, size=None, action_repeat=500)
    world.reset([True, False])
    with pytest.raises(vibes.Error, match="environment 1: no episode is being played; call reset first"):
        world.step([[0.1], [0.1]])
    world.reset_to([None, (0, 1, 1)])
    assert world.step([[0.1], [0.1]])["is_last"].tolist() == [False, False]
    world.reset([False, True])
    assert world.step([[0.1], [0.1]])["is_last"].tolist() == [True, False]
    for _ in range(2):
        with pytest.raises(vibes.Error, match="environment 0: the episode is over; call reset"):
            world.step([[0.1], [0.1]])
    assert world.step([[0.1], [0.1]], reset=[True, False])["is_last"].tolist() == [False, True]


def test_a_reset_that_is_refused_moves_no_environment(tmp_path):
    world = vibes.World("cartpole-swingup", environments=2, size=None, action_repeat=500)
    with vibes.Writer(tmp_path / "mine", world, mcap=False) as writer:
        for _ in range(2):
            world.reset()
            world.step([[0.1], [0.1]])
            if len(writer) == 0:
                world.step([[0.1], [0.1]])
        with pytest.raises(vibes.Error, match="environment 1: episode 1 is in the recording already"):
            world.reset_to([(0, 7, 7), (0, 1, 1)])
        assert world.episodes.tolist() == [2, 3]
        assert world.step([[0.1], [0.1]])["is_last"].tolist() == [True, True]
    assert vibes.open(tmp_path / "mine").indices == [0, 1, 2, 3]


def test_how_many_environments_there_are_is_no_option():
    """One that is shown and five that are played, or two that are named and five that are."""
    for make in (
        lambda: vibes.make_dm("cartpole-swingup", observation="state", environments=5),
        lambda: vibes.make_vec("cartpole-swingup", 2, observation="state", environments=5),
        lambda: gymnasium.make("vibes/cartpole-swingup-v0", observation="state", environments=5),
    ):
        with pytest.raises(TypeError, match="environments"):
            make()


def test_pictures_are_shown_at_one_a_second_at_least():
    for repeat, frames in [(1, 100), (100, 1), (1000, 1)]:
        assert vibes.make("cartpole-swingup", observation="state", action_repeat=repeat).metadata["render_fps"] == frames


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


def test_the_swimmers_that_are_named_are_those_that_there_are():
    fewest, most = map(int, re.search(r"swimmer-N stands for (\d+) to (\d+) links", vibes.tasks.__doc__).groups())
    for links in [fewest, most]:
        vibes.World(f"swimmer-{links}", size=None).close()
    for links in [fewest - 1, most + 1]:
        with pytest.raises(vibes.Error):
            vibes.World(f"swimmer-{links}", size=None)


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
        (dict(render_mode=np.array([1, 2])), "rgb_array"),
    ]
    for arguments, words in wrong:
        with pytest.raises(vibes.Error, match=words):
            vibes.make(**arguments)
    env = vibes.make(size=16)
    with pytest.raises(vibes.Error, match="call reset"):
        env.step([0, 0])
    env.reset()
    with pytest.raises(vibes.Error, match=r"action of shape \[3\]; right is \[2\]"):
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


WRONG_OPTIONS = [
    (dict(environments=-1), "-1 environments; 1 to 1024"),
    (dict(environments=0), "0 environments; 1 to 1024"),
    (dict(environments="three"), "environments 'three'; right is a whole number"),
    (dict(environments=2**70), "environments [0-9]+; right is a whole number"),
    (dict(environments=True), "environments True"),
    (dict(threads=-1), "-1 threads; at least one"),
    (dict(threads=0.5), "threads 0.5; right is a whole number"),
    (dict(size=-1), "a size of -1; right is 1 to 2048"),
    (dict(size="big"), "size 'big'; right is a whole number"),
    (dict(size=(64, 64)), r"size \(64, 64\); right is a whole number"),
    (dict(action_repeat=-1), "an action repeat of -1; right is 1 to 1000"),
    (dict(video_count=-1), "a video count of -1; right is 1 to 10000"),
    (dict(video_count=1.5), "video_count 1.5; right is a whole number"),
    (dict(task=3), "task 3; right is a name"),
    (dict(difficulty=None), "difficulty None; right is a name"),
    (dict(distract=5), "distract 5; right is some of background, camera and color"),
    (dict(distract=[1]), r"distract \[1\]; right is some of"),
    (dict(distract=0), "distract 0; right is some of"),
    (dict(distract=False), "distract False; right is some of"),
    (dict(dynamic="no"), "dynamic of type <U2; right is True or False"),
    (dict(dynamic=None), "dynamic None; right is True or False"),
    (dict(raw_torques=2), "raw_torques 2; right is True or False"),
    (dict(seed=0.5), r"the seed 0.5; right is a whole number from 0 to 2\*\*64 - 1"),
    (dict(camera_seed=-1), "camera_seed -1; right is a whole number"),
]


@pytest.mark.parametrize(("options", "words"), WRONG_OPTIONS, ids=str)
def test_a_wrong_option_is_named_with_what_would_be_right(options, words):
    with pytest.raises(vibes.Error, match=words):
        vibes.World(**{"size": None} | options)


def test_a_wrong_call_is_named_with_what_would_be_right():
    env = vibes.make(observation="state")
    dm = vibes.make_dm(observation="state")
    many = vibes.make_vec(num_envs=2, observation="state")
    world = vibes.World(environments=2, size=None)
    for thing in (env, dm, many, world):
        thing.reset()
    wrong = [
        (lambda: env.step(0.5), r"action of shape \[\]; right is \[2\]"),
        (lambda: env.step([[0, 0]]), r"action of shape \[1, 2\]; right is \[2\]"),
        (lambda: env.step(["0", "0"]), r"action of type <U1; right is numbers \[2\]"),
        (lambda: env.step([0j, 0]), r"action of type complex128; right is numbers \[2\]"),
        (lambda: env.step([0, [1]]), r"action .*right is numbers \[2\]"),
        (lambda: env.step(None), "action"),
        (lambda: env.step({}), "action"),
        (lambda: env.reset(options=3), "reset options 3; right is a dictionary"),
        (lambda: env.reset(options={"state": 0.5}), "the state trajectory 0.5; right is a whole number"),
        (lambda: env.reset(options={"episode": -1}), "the episode -1; right is a whole number"),
        (lambda: dm.step(0.5), r"action of shape \[\]; right is \[2\]"),
        (lambda: many.step([0, 0]), r"actions of shape \[2\]; right is \[2, 2\]"),
        (lambda: many.reset(seed=0.5), "the seed 0.5; right is a whole number"),
        (lambda: many.reset(seed=[1]), "1 seeds for 2 environments"),
        (lambda: many.reset(options={"reset_mask": [True]}), r"reset_mask .*right is truth values \[2\]"),
        (lambda: world.step(0.5), r"actions of shape \[\]; right is \[2, 2\]"),
        (lambda: world.step(np.zeros((2, 2)), reset=[True]), r"reset .*right is truth values \[2\]"),
        (lambda: world.step(np.zeros((2, 2)), reset=3), r"reset .*right is truth values \[2\]"),
        (lambda: world.reset([0, 1]), r"which of type int64 .*right is truth values \[2\]"),
        (lambda: world.reset_to([(0, 1), None]), r"the key \(0, 1\) of an episode; right is \(seed, state trajectory, distractor trajectory\)"),
        (lambda: world.reset_to([5, None]), "the key 5 of an episode"),
        (lambda: world.reset_to([(0, 1, 2)]), "for each of the 2 environments"),
        (lambda: world.reset_to(5), "keys 5; right is one of"),
        (lambda: world.reset_to([(0, 1, 0.5), None]), "the distractor trajectory 0.5; right is a whole number"),
        (lambda: world.seek("a"), "first 'a'; right is a whole number"),
        (lambda: world.keep(3), "writer 3; right is a vibes.Writer"),
        (lambda: world.keep(None, acts_by_pictures=True), "acts_by_pictures without a writer"),
        (lambda: world.reset(draw="no"), "draw of type <U2; right is True or False"),
        (lambda: world.step(np.zeros((2, 2)), draw=[True, False]), r"draw \[True, False\]; right is True or False"),
    ]
    for call, words in wrong:
        with pytest.raises(vibes.Error, match=words):
            call()
    # A call that was refused leaves everything as it was.
    for thing in (env, dm):
        thing.step([0, 0])
    for thing in (many, world):
        thing.step([[0, 0], [0, 0]])


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


def test_a_fork_of_a_process_that_drew_is_told_how_to_start_instead():
    vibes.make(size=16).close()
    said = forked(lambda: vibes.make(size=16).reset())
    assert "forked from" in said and "spawn or forkserver" in said and "vibes.make_vec" in said
    # What draws nothing can be made there, and what belongs to the parent can be closed.
    env = vibes.make(size=16)
    assert forked(lambda: vibes.make("cartpole-swingup", observation="state").reset()[0].shape) == (5,)
    assert forked(lambda: (env.close(), "closed")[1]) == "closed"
    env.reset()


def test_gymnasiums_processes_draw_when_they_are_spawned():
    vibes.make(size=16).close()
    # As docs/python.md and the error of a fork have it.
    words = {"vectorization_mode": "async", "vector_kwargs": {"context": "spawn"}}
    many = gymnasium.make_vec("vibes/reacher-easy-v0", num_envs=2, size=16, **words)
    try:
        pictures, _ = many.reset(seed=3)
        np.testing.assert_array_equal(pictures[0], vibes.make(size=16, seed=3).reset()[0])
    finally:
        many.close()
