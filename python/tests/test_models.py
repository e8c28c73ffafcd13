"""Trained models encode and act as the programs do."""

import subprocess
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import polars
import pytest
import vibes
from conftest import ROOT, forked, program

CHECKPOINT = ROOT / "checkpoints" / "cartpole-swingup"


@pytest.fixture(scope="module")
def model():
    return vibes.load(CHECKPOINT)


def test_it_says_what_it_is(model):
    assert model.task == "cartpole-swingup" and model.kind == "pixels"
    assert (model.checkpoint / "model.safetensors").is_file() and "cartpole" in repr(model)


def test_latents_are_those_of_vibes_train_encode(model, recorded, tmp_path):
    path = recorded("--task", "cartpole-swingup", "--grid", "2x2", "--steps", "9", "--seed", "3")
    done = subprocess.run([program("vibes-train"), "encode", CHECKPOINT, path, "-o", tmp_path / "latents.arrow"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    theirs = np.stack(polars.read_ipc(tmp_path / "latents.arrow")["latent"].to_list())
    recording = vibes.open(path)
    ours = model.encode_recording(recording)
    np.testing.assert_allclose(ours, theirs, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(ours, axis=1), 1, atol=1e-5)
    vibes.measures.variance_shares(vibes.measures.Table(ours, recording=recording))


def test_episodes_are_encoded_row_by_row_or_at_once(model):
    env = vibes.make("cartpole-swingup", seed=2)
    observation, _ = env.reset()
    pictures, actions = [observation], []
    for _ in range(4):
        actions.append(env.action_space.sample())
        pictures.append(env.step(actions[-1])[0])
    whole = model.encode(np.stack(pictures), np.stack(actions))
    assert whole.shape == (5, model.config["latent"]) and whole.dtype == np.float32
    np.testing.assert_allclose(model.encode(np.stack(pictures[:3]), np.stack(actions[:2])), whole[:3], atol=1e-5)
    assert (model.encode(np.stack(pictures), -np.stack(actions)) != whole).any(), "past actions matter"


def test_the_child_of_a_fork_encodes_too(model):
    """Rayon's threads stay in the parent. Several of Python's threads at once, because those that wait for a part of their work take up another's."""
    pictures = np.random.default_rng(0).integers(0, 256, (40, 64, 64, 3), np.uint8)
    actions = np.zeros((39, 1), np.float32)

    def encoded():
        with ThreadPoolExecutor(4) as threads:
            return [latents.tolist() for latents in threads.map(lambda _: model.encode(pictures, actions), range(8))]

    here = encoded()
    assert forked(encoded) == here
    assert forked(lambda: vibes.load(CHECKPOINT).encode(pictures, actions).tolist()) == here[0]


def test_pictures_may_lie_in_any_order_in_memory(model):
    pictures = np.random.default_rng(0).integers(0, 256, (3, 3, 64, 64), np.uint8).transpose(0, 2, 3, 1)
    np.testing.assert_array_equal(model.encode(pictures, np.zeros((2, 1))), model.encode(pictures.copy("C"), np.zeros((2, 1))))
    np.testing.assert_array_equal(model.encode(np.asfortranarray(pictures), np.zeros((2, 1))), model.encode(pictures.copy("C"), np.zeros((2, 1))))


def test_a_recording_of_another_task_is_encoded_with_a_warning(model, recorded):
    # One number in an action and pictures of the same size, as cartpole-swingup has them.
    other = vibes.open(recorded("--task", "known-slide", "--episodes", "1", "--steps", "2", "--distract", "none"))
    with pytest.warns(UserWarning, match="a recording of known-slide, and a model that was trained on cartpole-swingup"):
        assert model.encode_recording(other).shape == (3, model.config["latent"])


TINY = (
    "--task known-slide --no-pixels --distract none --preset tiny --steps 40 --rows-per-step 16 --prefill 3 --first-updates 20 "
    "--checkpoint-every 40 --evaluate-every 400 --evaluation-episodes 2 --final-episodes=2 --control-steps 480"
)


def test_it_acts_as_in_the_collector(recorded, tmp_path):
    run = tmp_path / "run"
    done = subprocess.run([program("vibes-train"), "online", *TINY.split(), "--quiet", "-o", run], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    path = recorded("--task", "known-slide", "--policy", str(run), "--no-pixels", "--episodes", "2", "--steps", "12")
    agent = vibes.load(run)
    assert agent.acts and agent.kind == "vector"
    for episode in vibes.open(path):
        agent.begin()
        for observation, action in zip(episode.observation, episode.action):
            np.testing.assert_allclose(agent.act(observation), action, atol=1e-6)
    agent.begin(seed=1)
    sampled = [agent.act(observation, executed=[0.5], sample=True) for observation in episode.observation]
    agent.begin(seed=1)
    again = [agent.act(observation, executed=[0.5], sample=True) for observation in episode.observation]
    np.testing.assert_array_equal(sampled, again)
    low, high = agent.config["action_min"], agent.config["action_max"]
    assert (np.array(low) <= sampled).all() and (sampled <= np.array(high)).all()
    with pytest.raises(vibes.Error, match="an executed action of 3 numbers; right is 1"):
        agent.act(episode.observation[0], executed=[0.1, 0.2, 0.3])
    # A number that is not finite would come out as an action of NaN, and so would every one after it.
    for number in (np.nan, np.inf):
        blind = np.full_like(episode.observation[0], number)
        with pytest.raises(vibes.Error, match="in the observations; right is finite numbers"):
            agent.act(blind)
        with pytest.raises(vibes.Error, match="in the executed action; right is finite numbers"):
            agent.act(episode.observation[0], executed=[number])
        with pytest.raises(vibes.Error, match="in the observations; right is finite numbers"):
            agent.encode(np.stack([episode.observation[0], blind]), episode.action[:1])
        with pytest.raises(vibes.Error, match="in the actions; right is finite numbers"):
            agent.encode(episode.observation[:2], np.full_like(episode.action[:1], number))
    with pytest.raises(vibes.Error, match="observation of type <U3"):
        agent.act("abc")
    assert np.isfinite(agent.act(episode.observation[0])).all(), "what was refused is not remembered"


MODEL_FREE = (
    "--task known-slide --distract none --size 24 --agent sac --steps 20 --prefill 3 --save-every 2 --evaluate-every 0 --final-episodes 1 --control-steps 200"
)


@pytest.mark.parametrize(("system", "transitions"), [("sac-drq", 4), ("sar", 4), ("core", 32)])
def test_a_run_without_a_world_model_encodes_and_acts(system, transitions, recorded, tmp_path):
    run = tmp_path / "run"
    words = [*MODEL_FREE.split(), "--system", system, "--transitions", str(transitions)]
    done = subprocess.run([program("vibes-train"), "online", *words, "--quiet", "-o", run], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    agent = vibes.load(run)
    assert agent.acts and agent.kind == "pixels" and agent.task == "known-slide"
    path = recorded("--task", "known-slide", "--policy", str(run), "--size", "24", "--distract", "none", "--episodes", "1", "--steps", "8")
    (episode,) = vibes.open(path)
    agent.begin()
    for observation, action in zip(episode.pixels, episode.action):
        np.testing.assert_allclose(agent.act(observation), action, atol=1e-6)
    latents = agent.encode(episode.pixels, episode.action)
    assert latents.shape == (9, agent.config["latent"]) and np.isfinite(latents).all()
    assert (latents[1:] != latents[:-1]).any()


def test_what_is_given_and_not_looked_at_is_refused(model, sample, tmp_path):
    picture = np.zeros((1, 64, 64, 3), np.uint8)
    with pytest.raises(vibes.Error, match="right is the episode alone, which has its own"):
        model.encode(vibes.open(sample)[0], np.zeros((12, 1)))
    with pytest.raises(vibes.Error, match=r"actions of shape \(4, 7\); right is \[0, 1\]"):
        model.encode(picture, np.zeros((4, 7)))
    np.testing.assert_array_equal(model.encode(picture, np.zeros((1, 1))), model.encode(picture))
    spec = {"task": "mine", "action_low": [-1], "action_high": [1], "size": 64}
    vibes.Writer(tmp_path / "empty", spec=spec, mcap=False).close()
    with pytest.raises(vibes.Error, match="the recording has no finished episode; right is at least one: .*empty"):
        model.encode_recording(vibes.open(tmp_path / "empty"))


def test_errors_name_what_would_be_right(model, tmp_path):
    with pytest.raises(vibes.Error, match="vibes-train"):
        vibes.load(tmp_path)
    with pytest.raises(vibes.Error, match="no actor"):
        model.act(np.zeros((64, 64, 3), np.uint8))
    with pytest.raises(vibes.Error, match=r"uint8 \[rows, 64, 64, 3\]"):
        model.encode(np.zeros((1, 32, 32, 3), np.uint8))
    with pytest.raises(vibes.Error, match=r"right is \[2, 1\]"):
        model.encode(np.zeros((3, 64, 64, 3), np.uint8), np.zeros((1, 1)))
    (tmp_path / "model.safetensors").write_bytes(b"nonsense")
    with pytest.raises(vibes.Error):
        vibes.load(tmp_path)
    with pytest.raises(vibes.Error):
        model.encode(np.zeros((0, 64, 64, 3), np.uint8))
