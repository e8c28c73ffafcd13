"""Nothing a caller passes ends the interpreter: every call returns or raises an ordinary exception.

The calls run in this process; were one to abort, the tests would not end. Panics of the library would be vibes.Error with "a mistake inside vibes".
"""

import math

import numpy as np
import pytest
import vibes
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

settings.register_profile("vibes", deadline=None, max_examples=60, suppress_health_check=list(HealthCheck))
settings.load_profile("vibes")

numbers = st.one_of(
    st.integers(-(2**70), 2**70),
    st.integers(-3, 40),
    st.floats(allow_nan=True, allow_infinity=True),
    st.sampled_from([2**31, 2**32, 2**63, 2**64 - 1, 2**64, None, True, "seven", b"7", (), [1]]),
)
words = st.one_of(st.text(max_size=8), st.sampled_from(["easy", "reacher-easy", "all", "none", "fast", "swimmer-", "swimmer-3", "swimmer-99999999"]), numbers)
arrays = st.one_of(
    hnp.arrays(st.sampled_from([np.float32, np.float64, np.int64, np.uint8, np.bool_, np.complex64]), hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=5)),
    st.lists(st.floats(width=32), max_size=4),
    numbers,
)


def tried(call):
    """Whether the call returned; an ordinary exception with words is as good, a mistake inside the library is not."""
    try:
        call()
    except Exception as error:
        assert "a mistake inside vibes" not in str(error), error
        return False
    return True


@given(st.dictionaries(st.sampled_from(["task", "difficulty", "distract", "video_set", "render", "observation", "render_mode", "videos"]), words, max_size=2), st.dictionaries(st.sampled_from(["action_repeat", "seed", "dynamic", "raw_torques", "camera_seed"]), numbers, max_size=2))
def test_options_of_an_environment(texts, counts):
    def call():
        env = vibes.make(**{"observation": "state", "size": 8} | texts | counts)
        env.reset()
        env.step(env.action_space.sample())
        env.close()

    tried(call)


@given(numbers)
def test_sizes(size):
    tried(lambda: vibes.World(size=size, video_count=1, distract="none").close())


@given(numbers, numbers)
def test_numbers_of_environments(environments, threads):
    if isinstance(environments, int) and 64 < environments <= 1024:
        environments = 64
    tried(lambda: vibes.World(size=None, environments=environments, threads=threads).close())


@pytest.fixture(scope="module")
def env():
    env = vibes.make(size=8, observation="both", distract="none")
    env.reset()
    return env


@given(action=arrays)
def test_actions(env, action):
    if not tried(lambda: env.step(action)):
        tried(env.reset)


@given(action=st.lists(st.floats(width=32, allow_nan=False, allow_infinity=False), min_size=2, max_size=2))
def test_actions_of_any_size_are_stepped_or_refused(env, action):
    tried(lambda: env.reset(seed=0))
    for _ in range(5):
        tried(lambda: env.step(action))
    env.reset()
    _, reward, *_ = env.step([0, 0])
    assert math.isfinite(reward)


@given(st.sampled_from(["cartpole-swingup", "cheetah-run", "walker-walk", "swimmer-3", "finger-spin", "ball_in_cup-catch"]), st.floats(width=32, allow_nan=False, allow_infinity=False))
@settings(max_examples=20)
def test_huge_actions_in_every_task(task, size):
    world = vibes.World(task, size=None)
    world.reset()
    action = np.full((1, len(world.action_bounds[0])), size, np.float32)
    for _ in range(5):
        tried(lambda: world.step(action))


@given(seed=numbers, options=st.one_of(st.none(), st.dictionaries(st.sampled_from(["episode", "state", "distractor", "other"]), numbers, max_size=3), numbers))
def test_resets(env, seed, options):
    tried(lambda: env.reset(seed=seed, options=options))
    env.reset(seed=0)


@given(actions=arrays, reset=arrays, keys=st.one_of(st.none(), st.lists(st.one_of(st.none(), st.tuples(numbers, numbers, numbers)), max_size=3)))
def test_worlds(env, actions, reset, keys):
    world = env.world
    tried(lambda: world.step(actions, reset))
    tried(lambda: world.reset(reset))
    tried(lambda: world.reset_to(keys))
    tried(lambda: world.seek(actions, seed=keys))
    env.reset(seed=0)


@given(length=numbers, batch=numbers, seed=numbers, update=numbers)
def test_windows(sample, length, batch, seed, update):
    if isinstance(batch, int) and batch > 1000 and batch < 2**31:
        batch = 1000
    recording = vibes.open(sample)
    tried(lambda: recording.windows(length=length, batch=batch, seed=seed)[update])
    tried(lambda: recording.dataset(length=length)[update])
    tried(lambda: recording.episode(update))


@given(st.text(max_size=20))
def test_paths(path):
    tried(lambda: vibes.open(path))


@given(st.dictionaries(st.sampled_from(["action", "reward", "observation", "pixels", "discount", "qpos", "colors", "other"]), arrays, max_size=5), numbers, numbers)
def test_written_columns(tmp_path_factory, columns, index, seed):
    spec = {"task": "any", "action_low": [-1], "action_high": [1], "observation": {"x": 1}}
    with vibes.Writer(tmp_path_factory.mktemp("any"), spec=spec, mcap=False) as writer:
        tried(lambda: writer.write(**columns, index=index, seed=seed))


@given(st.dictionaries(st.sampled_from(["task", "action_low", "action_high", "observation", "size", "qpos", "control_timestep", "action_repeat"]), st.one_of(numbers, arrays, st.dictionaries(st.text(max_size=3), numbers, max_size=2))))
def test_specs(tmp_path_factory, spec):
    tried(lambda: vibes.Writer(tmp_path_factory.mktemp("any"), spec=spec, mcap=False).close())


@given(st.binary(max_size=200), st.sampled_from(["manifest.json", "episodes/000000.arrow"]))
def test_damaged_recordings(tmp_path_factory, sample, contents, name):
    import shutil

    folder = tmp_path_factory.mktemp("damaged") / "recording"
    shutil.copytree(sample, folder, ignore=shutil.ignore_patterns("*.mcap"))
    (folder / name).write_bytes(contents)
    tried(lambda: [episode.pixels.sum() for episode in vibes.open(folder)])
