"""Recordings from Python are recordings: the collector verifies them, and they hold what was played."""

import gymnasium
import numpy as np
import polars
import pytest
import vibes
from conftest import collect, films, forked


def test_what_is_played_is_recorded_and_verified(tmp_path, recorded):
    env = vibes.make("reacher-easy", size=32, seed=5, action_repeat=250)
    rng = np.random.default_rng(0)
    played = []

    def policy(observation):
        action = rng.uniform(-1, 1, 2).astype(np.float32)
        played.append((observation, action))
        return action

    with vibes.Writer(tmp_path / "mine", env) as writer:
        returns = writer.record(policy, episodes=2)
        assert len(writer) == 2 and writer.next_episode() == 2
    recording = vibes.open(tmp_path / "mine")
    assert [episode.entry["return"] for episode in recording] == pytest.approx(returns, rel=1e-6)
    rows = [(episode.pixels[t], episode.action[t]) for episode in recording for t in range(episode.steps)]
    assert len(rows) == len(played) == 8
    for (pixels, action), (seen, done) in zip(rows, played):
        np.testing.assert_array_equal(pixels, seen)
        np.testing.assert_array_equal(action, done)
    said = collect("verify", tmp_path / "mine")
    assert "sound" in said and "recorded elsewhere" not in said
    with vibes.Writer(tmp_path / "mine", env) as writer:
        writer.record(policy, episodes=1)
    assert vibes.open(tmp_path / "mine").indices == [0, 1, 2]


def test_a_folder_of_videos_is_named_from_the_recording(tmp_path, monkeypatch):
    """As in the collector's and the trainer's recordings: it is found from any folder, and after both were moved together."""
    films(tmp_path / "films", 2)
    monkeypatch.chdir(tmp_path)
    options = {"size": 16, "action_repeat": 500, "distract": "background", "video_count": 1, "seed": 3}
    env = vibes.make(videos="films", **options)
    with vibes.Writer("recordings/mine", env) as writer:
        writer.record(lambda observation: env.action_space.sample())
    manifest = vibes.open("recordings/mine").manifest
    assert manifest["options"]["videos"] == {"folder": "../../films"}
    assert manifest["videos"] == env.world.videos
    monkeypatch.chdir("films")
    env = vibes.make(videos=tmp_path / "films", **options)
    with vibes.Writer(tmp_path / "recordings" / "mine", env) as writer:
        assert len(writer) == 1, "the same recording goes on, whatever its folder of videos is called from here"
        writer.record(lambda observation: env.action_space.sample())
    (tmp_path / "moved").mkdir()
    for name in ["films", "recordings"]:
        (tmp_path / name).rename(tmp_path / "moved" / name)
    monkeypatch.chdir(tmp_path)
    assert "sound" in collect("verify", tmp_path / "moved" / "recordings" / "mine")


def test_many_environments_are_kept_while_they_are_stepped(tmp_path):
    many = vibes.make_vec("cartpole-swingup", 3, size=16, action_repeat=500, seed=2)
    with vibes.Writer(tmp_path / "many", many, mcap=False) as writer:
        many.reset()
        for _ in range(5):
            many.step(many.action_space.sample())
        assert len(writer) == 6
    assert vibes.open(tmp_path / "many").indices == [0, 1, 2, 3, 4, 5]
    assert "sound" in collect("verify", tmp_path / "many")


def test_a_policy_acts_through_what_is_wrapped_around_its_environment(tmp_path):
    options = {"observation": "state", "action_repeat": 250, "seed": 4}
    seen = []

    def policy(observation):
        seen.append(observation)
        return np.array([50.0], np.float32)

    def wrapped():
        env = gymnasium.wrappers.FrameStackObservation(vibes.make("cartpole-swingup", **options), 3)
        return gymnasium.wrappers.RescaleAction(env, np.float32(-100), np.float32(100))

    with vibes.Writer(tmp_path / "mine", wrapped(), mcap=False) as writer:
        returns = writer.record(policy)
    (episode,) = vibes.open(tmp_path / "mine")
    assert [observation.shape for observation in seen] == [(3, 5)] * 4
    np.testing.assert_allclose(episode.action, 0.5, rtol=1e-6, err_msg="as executed, in the task's own units")
    np.testing.assert_array_equal(seen[-1][-1], episode.observation[-2])
    assert episode.entry["return"] == pytest.approx(returns[0], rel=1e-6)
    # In a grid the other cells are the same physics; the third row's own distractor is no column of it.
    with vibes.Writer(tmp_path / "grid", wrapped(), grid=(3, 2), mcap=False) as writer:
        returns = writer.record(policy)
    cells = list(vibes.open(tmp_path / "grid"))
    assert len(cells) == 6 and all((cell.action == episode.action).all() for cell in cells)
    assert [cell.entry["return"] for cell in cells[1::2]] == pytest.approx(returns, rel=1e-6)
    assert "sound" in collect("verify", tmp_path / "grid")


def test_a_wrapper_that_ends_episodes_early_is_named(tmp_path):
    env = gymnasium.wrappers.TimeLimit(vibes.make("cartpole-swingup", observation="state", action_repeat=250), 3)
    with vibes.Writer(tmp_path / "mine", env, mcap=False) as writer:
        with pytest.raises(vibes.Error, match="TimeLimit ended an episode after 3 of 4 steps"):
            writer.record(lambda observation: [0.0])
        assert len(writer) == 0
    many = vibes.make_vec("cartpole-swingup", 1, observation="state", action_repeat=500)
    with vibes.Writer(tmp_path / "many", many, mcap=False) as writer:
        with pytest.raises(vibes.Error, match="record plays an environment from vibes.make"):
            writer.record(lambda observation: [0.0])


def acting(path):
    """The acting distractor of every episode of a recording."""
    tables = [polars.read_ipc(file) for file in sorted((path / "episodes").glob("*.arrow"))]
    return [table["acting_distractor"][0] for table in tables]


def test_the_acting_distractor_is_named_where_pictures_are_observed(tmp_path):
    for observation, expected in [("pixels", [0, 1]), ("state", [None, None])]:
        # Pictures that are drawn for somebody else to look at are no observations.
        options = {"size": 16, "action_repeat": 500, "observation": observation}
        env = vibes.make("cartpole-swingup", render_mode="rgb_array", **options)
        with vibes.Writer(tmp_path / f"one-{observation}", env, mcap=False) as writer:
            env.reset()
            for _ in range(2):
                env.step([0.5])
            writer.record(lambda observation: [0.5])
        assert acting(tmp_path / f"one-{observation}") == expected
        many = vibes.make_vec("cartpole-swingup", 2, **options)
        with vibes.Writer(tmp_path / f"many-{observation}", many, mcap=False):
            many.reset()
            for _ in range(2):
                many.step(np.full((2, 1), 0.5))
        assert acting(tmp_path / f"many-{observation}") == expected
        assert "sound" in collect("verify", tmp_path / f"many-{observation}")
    world = vibes.World("cartpole-swingup", size=16, action_repeat=1000)
    with vibes.Writer(tmp_path / "world", world, mcap=False) as writer:
        for acts in (None, False):
            world.keep(writer, acts_by_pictures=acts)
            world.reset()
            world.step([[0.5]])
    assert acting(tmp_path / "world") == [0, None]
    env = vibes.make("cartpole-swingup", size=16, action_repeat=1000)
    with vibes.Writer(tmp_path / "grid", env, grid=(1, 2), mcap=False):
        env.reset(options={"state": 0, "distractor": 1})
        env.step([0.5])
    assert acting(tmp_path / "grid") == [None], "nobody has said which one was looked at"


def test_a_world_is_kept_by_the_writers_that_were_made_with_it(tmp_path):
    """Another world's episodes would stand in a recording that names the options of its own."""
    world, other = (vibes.World("cartpole-swingup", size=None, action_repeat=1000, seed=0, difficulty=difficulty) for difficulty in ("easy", "hard"))
    with vibes.Writer(tmp_path / "mine", world, mcap=False) as writer:
        with pytest.raises(vibes.Error, match=r"not made with this world; right is vibes.Writer\(path, world\): .*mine"):
            other.keep(writer)
        world.keep(writer)


def test_a_fork_that_drops_a_writer_leaves_its_lock(tmp_path):
    held = [vibes.Writer(tmp_path / "mine", spec=spec(), mcap=False)]
    assert forked(lambda: (held.clear(), "dropped")[1]) == "dropped"
    assert (tmp_path / "mine" / ".lock").exists()
    with pytest.raises(vibes.Error, match="process"):
        vibes.Writer(tmp_path / "mine", spec=spec(), mcap=False)
    held[0].close()
    assert not (tmp_path / "mine" / ".lock").exists()


def test_only_the_recordings_own_episodes_are_kept(tmp_path):
    env = vibes.make(size=16, action_repeat=1000)
    with vibes.Writer(tmp_path / "one", env) as writer:
        with pytest.raises(vibes.Error, match="those of seed 0"):
            env.reset(seed=3)
        env.reset(seed=0)
        env.step([0, 0])
        with pytest.raises(vibes.Error, match="in the recording already.*env.world.seek") as refused:
            env.reset(seed=0)
        assert "writer.next_episode()" in str(refused.value)
        env.world.seek(writer.next_episode())
        assert env.reset()[1]["episode_number"] == 1
        with pytest.raises(vibes.Error, match="one number for both"):
            env.reset(options={"state": 1, "distractor": 2})
    env.reset(seed=3)
    with pytest.raises(vibes.Error, match="closed"):
        writer.record(lambda observation: [0, 0])
    with pytest.raises(vibes.Error, match="another recording is here"):
        vibes.Writer(tmp_path / "one", vibes.make(size=24))


def test_a_policy_fills_a_grid_with_one_physics_a_row(tmp_path):
    env = vibes.make("reacher-easy", size=24, action_repeat=250, seed=6, observation="both")
    rng = np.random.default_rng(0)
    acted = []

    def policy(observation):
        acted.append(observation["pixels"])
        return rng.uniform(-1, 1, 2)

    with vibes.Writer(tmp_path / "grid", env, grid=(4, 3)) as writer:
        first = writer.record(policy, episodes=1)
        assert len(writer) == 3 and writer.grid == (4, 3) and writer.next_episode() == 3
        returns = first + writer.record(policy)
        assert len(writer) == 12
    assert len(returns) == 4 and len(acted) == 4 * 4, "the policy acts once for a state trajectory"
    recording = vibes.open(tmp_path / "grid")
    assert recording.manifest["grid"] == {"states": 4, "distractors": 3}
    assert [episode.cell for episode in recording] == [(i, j) for i in range(4) for j in range(3)]
    for i in range(4):
        row = [recording.episode(3 * i + j) for j in range(3)]
        for cell in row:
            np.testing.assert_array_equal(cell.qpos, row[0].qpos)
            np.testing.assert_array_equal(cell.action, row[0].action)
            assert cell.entry["return"] == pytest.approx(returns[i], rel=1e-6)
        assert (row[0].pixels != row[1].pixels).any()
        if i < 3:
            np.testing.assert_array_equal(row[i].pixels[:4], acted[4 * i : 4 * i + 4], "it acted under the distractor of its own number")
    said = collect("verify", tmp_path / "grid")
    assert "sound" in said and "recorded elsewhere" not in said
    assert vibes.measures.variance_shares(vibes.measures.Table(np.concatenate([e.observation for e in recording]), recording=recording))


def test_a_grid_that_was_stopped_goes_on_with_the_same_actions(tmp_path):
    env = vibes.make("cartpole-swingup", observation="state", action_repeat=200)
    rng = np.random.default_rng(1)
    with vibes.Writer(tmp_path / "grid", env, grid=(2, 2), mcap=False) as writer:
        env.reset(options={"state": 0, "distractor": 1})
        actions = [env.action_space.sample() for _ in range(5)]
        for action in actions:
            env.step(action)
        with pytest.raises(vibes.Error, match="cells are below 2 and 2"):
            env.reset(options={"state": 0, "distractor": 2})
        env.reset(options={"state": 1, "distractor": 1})
    with vibes.Writer(tmp_path / "grid", env, grid=(2, 2), mcap=False) as writer:
        writer.record(lambda observation: rng.uniform(-1, 1, 1))
    recording = vibes.open(tmp_path / "grid")
    assert recording.indices == [0, 1, 2, 3]
    np.testing.assert_array_equal(recording.episode(0).action, np.array(actions, np.float32))
    assert "sound" in collect("verify", tmp_path / "grid")


def test_arrays_fill_the_cells_of_a_grid(tmp_path):
    columns = {"action": np.zeros((5, 2)), "reward": np.zeros(5), "observation": np.zeros((6, 3)), "pixels": np.zeros((6, 8, 8, 3), np.uint8)}
    with vibes.Writer(tmp_path / "foreign", spec=spec(), grid=(2, 3)) as writer:
        assert writer.write(**columns, cell=(1, 1)) == 4
        assert writer.write(**columns) == 0
        with pytest.raises(vibes.Error, match="there already"):
            writer.write(**columns, cell=(1, 1))
        with pytest.raises(vibes.Error, match="cells are below 2 and 3"):
            writer.write(**columns, cell=(2, 0))
        with pytest.raises(vibes.Error, match="in place of the index"):
            writer.write(**columns, cell=(0, 1), index=1)
    assert [episode.cell for episode in vibes.open(tmp_path / "foreign")] == [(0, 0), (1, 1)]
    for grid in [(0, 3), (2**20, 2**20), "ab", 3]:
        with pytest.raises(vibes.Error):
            vibes.Writer(tmp_path / "wrong", spec=spec(), grid=grid)
    assert not (tmp_path / "wrong").exists()


def spec(**more):
    return {"task": "mine", "action_low": [-1, -2], "action_high": [1, 2], "observation": {"position": 3}, "size": 8} | more


def test_episodes_of_anything_can_be_written(tmp_path):
    rng = np.random.default_rng(0)
    columns = {
        "action": rng.normal(size=(5, 2)),
        "reward": rng.normal(size=5),
        "observation": rng.normal(size=(6, 3)),
        "pixels": rng.integers(0, 256, (6, 8, 8, 3), np.uint8),
    }
    with vibes.Writer(tmp_path / "foreign", spec=spec(), mcap=True) as writer:
        assert writer.write(**columns, is_terminal=True, policy="mine", seed=7) == 0
        assert writer.write(**columns) == 1
    recording = vibes.open(tmp_path / "foreign")
    episode = recording[0]
    assert episode.is_terminal and not recording[1].is_terminal and episode.entry["policy"] == "mine"
    for name, values in columns.items():
        np.testing.assert_array_equal(getattr(episode, name), np.asarray(values).astype(getattr(episode, name).dtype))
    assert "sound" in collect("verify", tmp_path / "foreign")
    assert recording.windows(length=3, batch=2)[0]["pixels"].shape == (2, 3, 8, 8, 3)


def test_a_policy_may_write_all_its_actions_into_one_array(tmp_path):
    env = vibes.make("reacher-easy", size=16, action_repeat=250, seed=6, observation="state")
    rng, out = np.random.default_rng(0), np.zeros(2, np.float32)

    def policy(_observation):
        out[:] = rng.uniform(-1, 1, 2)
        return out

    with vibes.Writer(tmp_path / "grid", env, grid=(1, 2)) as writer:
        writer.record(policy)
    first, second = vibes.open(tmp_path / "grid")
    assert len({tuple(action) for action in first.action}) == 4
    np.testing.assert_array_equal(first.action, second.action)


def test_what_comes_after_a_terminal_row_is_worth_nothing(tmp_path):
    columns = {"action": np.zeros((3, 2)), "reward": np.ones(3), "observation": np.zeros((4, 3)), "pixels": np.zeros((4, 8, 8, 3), np.uint8)}
    with vibes.Writer(tmp_path / "foreign", spec=spec()) as writer:
        writer.write(**columns, is_terminal=True)
        writer.write(**columns)
    ended, cut = vibes.open(tmp_path / "foreign")
    assert list(ended.discount) == [1, 1, 0] and list(cut.discount) == [1, 1, 1]


def test_wrong_episodes_are_refused_and_leave_nothing(tmp_path):
    good = {"action": np.zeros((5, 2)), "reward": np.zeros(5), "observation": np.zeros((6, 3)), "pixels": np.zeros((6, 8, 8, 3), np.uint8)}
    with vibes.Writer(tmp_path / "foreign", spec=spec()) as writer:
        wrong = [
            ({"reward": np.zeros(4)}, "episode 0"),
            ({"reward": [0, 0, np.nan, 0, 0]}, "finite"),
            ({"pixels": np.zeros((6, 8, 8, 3))}, "uint8"),
            ({"observation": np.zeros((5, 3))}, "observation"),
            ({"sound": np.zeros(5)}, "known are"),
            ({"reward": "abcde"}, r"reward of type <U5; right is numbers \[rows, …\]"),
            ({"is_terminal": "no"}, "is_terminal of type <U2; right is True or False"),
            ({"is_terminal": np.array([True, False])}, r"is_terminal array.*; right is True or False"),
            ({"policy": None}, "policy None; right is a name"),
            ({"action": np.zeros((2, 5))}, r"right is \[rows, 2\]"),
            ({"pixels": np.zeros((6, 3, 8, 8), np.uint8)}, r"right is \[rows, 8, 8, 3\]"),
            ({"qpos": np.zeros((6, 2))}, "qpos, of which this recording's spec says nothing; name it there, or leave it out"),
            ({"colors": np.zeros((6, 2, 3))}, "colors, of which this recording's spec says nothing; leave them out"),
        ]
        for change, words in wrong:
            with pytest.raises(vibes.Error, match=words):
                writer.write(**good | change)
        writer.write(**good, discount=None, is_terminal=np.True_)
        with pytest.raises(vibes.Error, match="there already"):
            writer.write(**good, index=0)
    assert vibes.open(tmp_path / "foreign")[0].discount.tolist() == [1, 1, 1, 1, 0], "None is a column that is left out"
    assert vibes.open(tmp_path / "foreign").indices == [0]
    with vibes.Writer(tmp_path / "blind", spec=spec(size=None)) as writer:
        with pytest.raises(vibes.Error, match="pixels, of which this recording's spec says nothing; name their size there, or leave them out"):
            writer.write(**good)
    for wrong, words in [({"size": 0}, "picture side"), ({"action_low": []}, "bounds"), ({"pixels": 3}, "known are"), ({"control_timestep": -1}, "timestep"), ({"action_low": [-np.inf, -1]}, "bounds")]:
        with pytest.raises(vibes.Error, match=words):
            vibes.Writer(tmp_path / "wrong", spec=spec(**wrong))
    kinds = [
        ({"control_timestep": "fast"}, "the spec's control_timestep 'fast'; right is a number"),
        ({"control_timestep": True}, "the spec's control_timestep True; right is a number"),
        ({"control_timestep": np.True_}, "the spec's control_timestep .*True.*; right is a number"),
        ({"size": (64, 64)}, r"the spec's size, one side of its square pictures, \(64, 64\); right is a whole number"),
        ({"qpos": 0.5}, "the spec's qpos 0.5; right is a whole number"),
        ({"action_repeat": "2"}, "the spec's action_repeat '2'; right is a whole number"),
        ({"action_low": "low"}, r"the spec's action_low of type <U3; right is numbers \[action\]"),
        ({"observation": 3}, "the spec's observation 3; right is a dictionary"),
        ({"observation": {"position": -3}}, "the spec's observation 'position' -3; right is a whole number"),
    ]
    for wrong, words in kinds:
        with pytest.raises(vibes.Error, match=words):
            vibes.Writer(tmp_path / "wrong", spec=spec(**wrong))
    with pytest.raises(vibes.Error, match="mcap of type <U2; right is True or False"):
        vibes.Writer(tmp_path / "wrong", spec=spec(), mcap="no")
    with pytest.raises(vibes.Error, match="the spec 3; right is a dictionary"):
        vibes.Writer(tmp_path / "wrong", spec=3)
    with pytest.raises(vibes.Error, match="give one of the two"):
        vibes.Writer(tmp_path / "wrong")
    assert not (tmp_path / "wrong").exists()
