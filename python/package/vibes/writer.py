"""Recordings from one's own policy.

In: an environment of this package and a policy, or whole episodes of anything as arrays. Out: a recording that ``vibes-collect``, ``vibes-train`` and
``vibes-analyze`` read.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _vibes
from .world import World, checked_number, checked_seed

TYPES = {"qpos": np.float64, "qvel": np.float64, "pixels": np.uint8}
"""Columns that are not float32."""


class Writer:
    """A recording that grows; each episode is there whole or not at all. Use it in a ``with`` block, or ``close`` it.

    With an environment of this package every episode that begins from now on and is played to its end is kept, with its physics and distractors, so
    that ``vibes-collect verify`` simulates and draws it again::

        env = vibes.make("reacher-easy", seed=3)
        with vibes.Writer("recordings/mine", env) as writer:
            writer.record(lambda observation: env.action_space.sample(), episodes=10)

    Without one, ``spec`` says what a row holds, and ``write`` takes whole episodes::

        spec = {"task": "mine", "action_low": [-1], "action_high": [1], "observation": {"position": 3}, "size": 64, "control_timestep": 0.02}
        with vibes.Writer("recordings/mine", spec=spec) as writer:
            writer.write(action=actions, reward=rewards, observation=observations, pixels=pictures)

    Args:
        path: the recording's folder; one that was begun with the same options goes on.
        env: an environment from ``make``, ``make_dm``, ``make_vec``, or a ``World``.
        spec: task (a name), action_low and action_high (numbers), observation (parts with their sizes), and where there are any: size (pixels), qpos,
            qvel (counts), control_timestep (seconds, 1 unless given), action_repeat (1 unless given).
        mcap: whether an MCAP log is written beside every Arrow table.

    Raises:
        vibes.Error: another recording is there, or the spec is of no recording.
    """

    def __init__(
        self, path: str | os.PathLike[str], env: Any = None, *, spec: dict[str, Any] | None = None, mcap: bool = True
    ) -> None:
        if (env is None) == (spec is None):
            raise _vibes.Error("a Writer takes an environment of this package, or the spec of another; give one of the two")
        self._env = env
        self._world = None if env is None else world_of(env)
        if self._world is not None:
            self._native = _vibes.Writer.of_world(path, self._world._native, self._world.seed, mcap)
            self._world.keep(self)
        else:
            self._native = _vibes.Writer.of_spec(path, row_spec(spec or {}), 0, mcap)

    @property
    def path(self) -> Path:
        """Where the recording lies."""
        return Path(self._native.path)

    def __len__(self) -> int:
        return len(self._native)

    def next_episode(self) -> int:
        """The first number that no episode has yet."""
        number = 0
        while self._native.has(number):
            number += 1
        return number

    def record(self, policy: Callable[[Any], ArrayLike], episodes: int = 1) -> list[float]:
        """Plays and keeps whole episodes of an environment from ``make``, from the first number that is free; returns their returns.

        Args:
            policy: from an observation, as the environment gives it, to an action ``[action]``.
            episodes: how many.
        """
        env = getattr(self._env, "unwrapped", None)
        if env is None or not hasattr(env, "action_space") or self._world is None or self._world.environments != 1:
            raise _vibes.Error("record plays an environment from vibes.make; others are kept while they are stepped")
        returns = []
        for _ in range(episodes):
            observation, _ = env.reset(options={"episode": self.next_episode()})
            total, is_over = 0.0, False
            while not is_over:
                observation, reward, terminated, truncated, _ = env.step(np.asarray(policy(observation), np.float32))
                total, is_over = total + reward, terminated or truncated
            returns.append(total)
        return returns

    def write(self, *, is_terminal: bool = False, policy: str = "python", seed: int = 0, index: int | None = None, **columns: ArrayLike) -> int:
        """Writes one whole episode of T actions; returns its number.

        Args:
            action: ``[T, action]``. reward: ``[T]``. discount: ``[T]``, ones unless given.
            observation: ``[T + 1, observation]``. pixels: uint8 ``[T + 1, size, size, 3]``. qpos, qvel: ``[T + 1, …]``. Those that the spec names.
            is_terminal: whether the last row is worth 0 from there.
            policy: what acted, for the manifest.
            seed: of the episode, for the manifest.
            index: its number; the first free one unless given.

        Raises:
            vibes.Error: a column of another length, or a reward that is not finite; nothing is written then.
        """
        number = self.next_episode() if index is None else checked_number(index)
        known = ("action", "reward", "discount", "observation", "pixels", "qpos", "qvel", "colors")
        if unknown := set(columns) - set(known):
            raise _vibes.Error(f"unknown columns {sorted(unknown)}; known are {', '.join(known)}")
        arrays = {name: as_type(name, values) for name, values in columns.items()}
        self._native.write(number, arrays, is_terminal=bool(is_terminal), policy=str(policy), seed=checked_seed(seed))
        return number

    def close(self) -> None:
        """Completes the manifest."""
        if self._world is not None:
            try:
                self._world.keep(None)
            except _vibes.Error:
                # A world that is closed keeps nothing any more.
                pass
        self._native.close()

    def __enter__(self) -> Writer:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()


def world_of(env: Any) -> World:
    """The world inside an environment of this package, whatever is wrapped around it."""
    inner = env if isinstance(env, World) else getattr(getattr(env, "unwrapped", env), "world", None)
    if not isinstance(inner, World):
        raise _vibes.Error(f"{type(env).__name__} is no environment of this package; give a spec instead")
    return inner


def as_type(name: str, values: ArrayLike) -> Any:
    """A column as the format keeps it. Pictures must be bytes already: a silent cast would wrap or darken them."""
    array = np.asarray(values)
    if name == "pixels" and array.dtype != np.uint8:
        raise _vibes.Error(f"pixels of type {array.dtype}; pictures are uint8, 0 to 255")
    return np.ascontiguousarray(array, TYPES.get(name, np.float32))


def row_spec(spec: dict[str, Any]) -> dict[str, Any]:
    """A user's short spec as the manifest's."""
    known = {"task", "action_low", "action_high", "observation", "size", "qpos", "qvel", "control_timestep", "action_repeat"}
    if unknown := set(spec) - known:
        raise _vibes.Error(f"unknown keys of the spec {sorted(map(str, unknown))}; known are {', '.join(sorted(known))}")
    if missing := {"task", "action_low", "action_high"} - set(spec):
        raise _vibes.Error(f"the spec has no {', '.join(sorted(missing))}; it names at least task, action_low and action_high")
    size = spec.get("size")
    return {
        "task": str(spec["task"]),
        "action": {"min": np.ravel(spec["action_low"]).astype(float).tolist(), "max": np.ravel(spec["action_high"]).astype(float).tolist()},
        "observation": [{"name": str(name), "len": checked_number(count)} for name, count in dict(spec.get("observation", {})).items()],
        "qpos": checked_number(spec.get("qpos", 0)),
        "qvel": checked_number(spec.get("qvel", 0)),
        "pixels": None if size is None else {"height": checked_number(size), "width": checked_number(size)},
        "materials": [],
        "control_timestep": float(spec.get("control_timestep", 1.0)),
        "action_repeat": checked_number(spec.get("action_repeat", 1)),
    }
