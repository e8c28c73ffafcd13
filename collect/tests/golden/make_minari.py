"""Writes the datasets in minari/ with Minari 0.5.4: MINARI_DATASETS_PATH=minari python make_minari.py

Every number is a known function of episode and row, which the tests know too.
"""
import gymnasium as gym
import minari
import numpy as np
from minari.data_collector.episode_buffer import EpisodeBuffer

COMMON = dict(algorithm_name="by hand", author={"nobody"}, code_permalink="none")


def episode(number):
    steps = 3 + number
    t = np.arange(steps + 1)
    eye = (t[:, None, None, None] * 7 + number + np.arange(48).reshape(4, 4, 3)) % 256
    return EpisodeBuffer(
        id=None,
        seed=40 + number,
        observations={"vec": np.stack([t + 10.0 * number, t * 0.5], 1), "eye": eye.astype(np.uint8)},
        actions=np.stack([t[:-1] * 0.1, -t[:-1] * 0.1], 1).astype(np.float32),
        rewards=list(t[:-1] + 0.25 * number),
        terminations=[False] * (steps - 1) + [number == 1],
        truncations=[False] * (steps - 1) + [number != 1],
        infos={"qpos": np.zeros((steps + 1, 3))},
    )


space = gym.spaces.Dict({"vec": gym.spaces.Box(-np.inf, np.inf, (2,), np.float64), "eye": gym.spaces.Box(0, 255, (4, 4, 3), np.uint8)})
for format in ["hdf5", "arrow"]:
    minari.create_dataset_from_buffers(
        dataset_id=f"{format}-v0", buffer=[episode(0), episode(1)], observation_space=space,
        action_space=gym.spaces.Box(-1, 1, (2,), np.float32), data_format=format, **COMMON)
# Pictures of 32 pixels and more become JPEGs; actions are choices.
choices = EpisodeBuffer(
    id=None, seed=1, observations=np.full((3, 32, 32, 3), [200, 100, 50], np.uint8), actions=np.array([1, 0]), rewards=[1.0, 2.0],
    terminations=[False, True], truncations=[False, False], infos={})
minari.create_dataset_from_buffers(
    dataset_id="jpeg-v0", buffer=[choices], observation_space=gym.spaces.Box(0, 255, (32, 32, 3), np.uint8),
    action_space=gym.spaces.Discrete(2), data_format="arrow", **COMMON)
