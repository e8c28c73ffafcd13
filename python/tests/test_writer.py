"""Recordings from Python are recordings: the collector verifies them, and they hold what was played."""

import numpy as np
import pytest
import vibes
from conftest import collect


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


def test_many_environments_are_kept_while_they_are_stepped(tmp_path):
    many = vibes.make_vec("cartpole-swingup", 3, size=16, action_repeat=500, seed=2)
    with vibes.Writer(tmp_path / "many", many, mcap=False) as writer:
        many.reset()
        for _ in range(5):
            many.step(many.action_space.sample())
        assert len(writer) == 6
    assert vibes.open(tmp_path / "many").indices == [0, 1, 2, 3, 4, 5]
    assert "sound" in collect("verify", tmp_path / "many")


def test_only_the_recordings_own_episodes_are_kept(tmp_path):
    env = vibes.make(size=16, action_repeat=1000)
    with vibes.Writer(tmp_path / "one", env) as writer:
        with pytest.raises(vibes.Error, match="those of seed 0"):
            env.reset(seed=3)
        env.reset(seed=0)
        env.step([0, 0])
        with pytest.raises(vibes.Error, match="in the recording already"):
            env.reset(seed=0)
        with pytest.raises(vibes.Error, match="one number for both"):
            env.reset(options={"state": 1, "distractor": 2})
    env.reset(seed=3)
    with pytest.raises(vibes.Error, match="closed"):
        writer.record(lambda observation: [0, 0])
    with pytest.raises(vibes.Error, match="another recording is here"):
        vibes.Writer(tmp_path / "one", vibes.make(size=24))


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


def test_wrong_episodes_are_refused_and_leave_nothing(tmp_path):
    good = {"action": np.zeros((5, 2)), "reward": np.zeros(5), "observation": np.zeros((6, 3)), "pixels": np.zeros((6, 8, 8, 3), np.uint8)}
    with vibes.Writer(tmp_path / "foreign", spec=spec()) as writer:
        wrong = [
            ({"reward": np.zeros(4)}, "episode 0"),
            ({"reward": [0, 0, np.nan, 0, 0]}, "finite"),
            ({"pixels": np.zeros((6, 8, 8, 3))}, "uint8"),
            ({"observation": np.zeros((5, 3))}, "observation"),
            ({"sound": np.zeros(5)}, "known are"),
        ]
        for change, words in wrong:
            with pytest.raises(vibes.Error, match=words):
                writer.write(**good | change)
        writer.write(**good)
        with pytest.raises(vibes.Error, match="there already"):
            writer.write(**good, index=0)
    assert vibes.open(tmp_path / "foreign").indices == [0]
    for wrong, words in [({"size": 0}, "picture side"), ({"action_low": []}, "bounds"), ({"pixels": 3}, "known are"), ({"control_timestep": -1}, "timestep")]:
        with pytest.raises(vibes.Error, match=words):
            vibes.Writer(tmp_path / "wrong", spec=spec(**wrong))
    with pytest.raises(vibes.Error, match="give one of the two"):
        vibes.Writer(tmp_path / "wrong")
    assert not (tmp_path / "wrong").exists()
