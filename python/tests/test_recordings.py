"""Recordings as arrays: aligned, read-only, over the files' own memory; windows that are the trainer's."""

import json
import pickle

import numpy as np
import pytest
import vibes


def test_a_recording_is_a_sequence_of_episodes(sample):
    recording = vibes.open(sample)
    manifest = json.loads((sample / "manifest.json").read_text())
    assert len(recording) == len(manifest["episodes"]) and recording.task == manifest["spec"]["task"]
    assert recording.manifest["episodes"] == manifest["episodes"]
    assert [episode.index for episode in recording] == recording.indices
    assert recording[-1].index == recording.indices[-1] and len(recording[1:3]) == 2
    with pytest.raises(IndexError):
        recording[len(recording)]
    assert "reacher-easy" in repr(recording) and "steps" in repr(recording[0])


def test_columns_have_their_shapes_and_add_up(sample):
    recording = vibes.open(sample)
    size = recording.spec["pixels"]
    for episode in recording:
        t = episode.steps
        assert episode.action.shape == (t, 2) and episode.reward.shape == (t,) and episode.discount.shape == (t,)
        assert episode.pixels.shape == (t + 1, size["height"], size["width"], 3) and episode.has_pixels.all()
        assert episode.observation.shape == (t + 1, 6) and episode.qpos.shape == (t + 1, 2) and episode.qvel.shape == (t + 1, 2)
        assert episode.colors.shape == (t + 1, len(recording.spec["materials"]), 3) and episode.camera.shape == (t + 1, 4)
        assert episode.video.shape == (t + 1,) and episode.frame.shape == (t + 1,)
        assert float(episode.reward.astype(float).sum()) == pytest.approx(episode.entry["return"])
        assert not episode.is_terminal and episode.cell is not None
        # reacher's observation begins with its joint angles.
        np.testing.assert_array_equal(episode.observation[:, :2], episode.qpos.astype(np.float32))


def test_large_columns_are_the_files_own_memory_and_cannot_be_written(sample):
    episode = vibes.open(sample)[0]
    for name in ["pixels", "action", "reward", "observation", "qpos", "qvel", "colors"]:
        array = getattr(episode, name)
        assert array.base is not None and not array.flags.owndata and not array.flags.writeable
        with pytest.raises(ValueError):
            array[...] = 0
        with pytest.raises(ValueError):
            array.flags.writeable = True
    again = vibes.open(sample)[0].pixels
    before = again.copy()
    episode.release()
    np.testing.assert_array_equal(episode.pixels, before)
    del episode
    np.testing.assert_array_equal(again, before)


def test_windows_are_rows_of_their_episodes(sample):
    recording = vibes.open(sample)
    windows = recording.windows(length=5, batch=7, seed=3)
    batch = windows[11]
    for name, values in batch.items():
        assert values.shape[0] == 7 and (values.ndim == 1 or values.shape[1] == 5), name
    for b in range(7):
        episode = recording.episode(int(batch["episode"][b]))
        start = int(batch["step"][b])
        rows = slice(start, start + 5)
        for name, column in [("pixels", episode.pixels), ("observation", episode.observation), ("action", episode.action), ("reward", episode.reward)]:
            np.testing.assert_array_equal(batch[name][b], column[rows], err_msg=name)
        before = np.concatenate([np.zeros((1, 2), np.float32), episode.action])[rows]
        np.testing.assert_array_equal(batch["previous_action"][b], before)
        assert batch["is_first"][b].tolist() == [start + t == 0 for t in range(5)]


def test_windows_follow_from_seed_and_update_alone(sample):
    recording = vibes.open(sample)
    one, other = recording.windows(length=4, batch=3, seed=1), recording.windows(length=4, batch=3, seed=1)
    first = [batch["step"].tolist() + batch["episode"].tolist() for batch, _ in zip(one, range(4))]
    assert [other[u]["step"].tolist() + other[u]["episode"].tolist() for u in range(4)] == first
    assert recording.windows(length=4, batch=3, seed=2)[0]["step"].tolist() + [] != first[0][:3] or first[0] != first[1]
    again = pickle.loads(pickle.dumps(one))
    np.testing.assert_array_equal(again[2]["pixels"], one[2]["pixels"])
    one.release()
    np.testing.assert_array_equal(again[2]["pixels"], one[2]["pixels"])


def test_the_windows_of_several_recordings_are_mixed(sample, recorded):
    size = vibes.open(sample).spec["pixels"]["height"]
    path = recorded("--episodes", "4", "--steps", "30", "--size", size, "--distract", "none")
    both = vibes.windows([sample, path], length=4, batch=64, seed=0)
    assert both.count == vibes.windows([sample], length=4).count + vibes.windows([path], length=4).count
    plain = vibes.open(path)
    stills = {(e.index, t): e.observation[t].tobytes() for e in plain for t in range(e.steps)}
    batch = both[0]
    found = sum(stills.get((int(e), int(t))) == batch["observation"][b, 0].tobytes() for b, (e, t) in enumerate(zip(batch["episode"], batch["step"])))
    assert 0 < found < 64


def test_one_recording_is_named_by_its_path_alone(sample):
    listed = vibes.windows([sample], length=4, batch=3, seed=2)
    for path in [sample, str(sample)]:
        one = vibes.windows(path, length=4, batch=3, seed=2)
        assert one.count == listed.count
        np.testing.assert_array_equal(one[1]["observation"], listed[1]["observation"])
        assert len(vibes.WindowDataset(path, length=4)) == listed.count
        assert pickle.loads(pickle.dumps(one)).count == listed.count


def test_every_window_can_be_had_by_its_number(sample):
    recording = vibes.open(sample)
    dataset = recording.dataset(length=6)
    assert len(dataset) == sum(max(episode.steps - 5, 0) for episode in recording)
    seen = {(int(dataset[i]["episode"]), int(dataset[i]["step"])) for i in range(len(dataset))}
    assert len(seen) == len(dataset)
    assert dataset[0]["pixels"].shape[0] == 6 and dataset[-1]["reward"].shape == (6,)
    np.testing.assert_array_equal(dataset[np.int64(2)]["action"], dataset[2]["action"])
    for number in (1.7, 1.0, "1", None):
        with pytest.raises(TypeError):
            dataset[number]
    with pytest.raises(IndexError):
        dataset[len(dataset)]
    assert len(pickle.loads(pickle.dumps(dataset))) == len(dataset)
    before = dataset[0]["pixels"].copy()
    dataset.release()
    np.testing.assert_array_equal(dataset[0]["pixels"], before)


def test_errors_name_what_would_be_right(sample, tmp_path):
    with pytest.raises(vibes.Error, match="manifest.json"):
        vibes.open(tmp_path)
    recording = vibes.open(sample)
    with pytest.raises(vibes.Error, match="no episode 99"):
        recording.episode(99)
    with pytest.raises(vibes.Error, match="the longest has"):
        recording.windows(length=10_000)
    with pytest.raises(vibes.Error, match="at least 1"):
        recording.windows(length=0)
    with pytest.raises(vibes.Error, match="more than memory holds"):
        recording.windows(batch=2**31)
    with pytest.raises(vibes.Error, match="no recording"):
        vibes.windows([])
