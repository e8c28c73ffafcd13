"""One environment for dm_env, with the names and parts of observations that dm_control gives them.

In: actions ``[action]``. Out: time steps. An episode ends with discount 1 after 1000 control steps; the next ``step`` begins another.
"""

from __future__ import annotations

from typing import Any

import dm_env
import numpy as np
from dm_env import specs
from numpy.typing import NDArray

from .checks import checked_shape
from .world import open_world


class DmEnvironment(dm_env.Environment):
    """A task of the Distracting Control Suite; see :func:`vibes.make` for the arguments."""

    def __init__(self, task: str = "reacher-easy", *, observation: str = "pixels", **options: Any) -> None:
        self.world = open_world(task, observation, None, environments=1, **options)
        self._kind = observation
        self._draw = self.observes_pictures = observation != "state"
        """Whether observations have pictures."""
        self._is_over = True

    def reset(self) -> dm_env.TimeStep:
        """Begins the next episode of the recording of this seed."""
        rows = self.world.reset(draw=self._draw)
        self._is_over = False
        return dm_env.restart(self._observation(rows))

    def step(self, action: Any) -> dm_env.TimeStep:
        """One agent step: the action is held for the action repeat, rewards are summed over it. After an episode's last step it resets."""
        if self._is_over:
            return self.reset()
        rows = self.world.step(checked_shape("action", action, (self.world.action_size,))[None], draw=self._draw)
        reward, observation = float(rows["reward"][0]), self._observation(rows)
        self._is_over = bool(rows["is_last"][0])
        return dm_env.truncation(reward, observation) if self._is_over else dm_env.transition(reward, observation)

    def observation_spec(self) -> dict[str, specs.Array]:
        """The task's own parts in dm_control's order, float32, and ``pixels`` uint8 ``[size, size, 3]``."""
        parts: dict[str, specs.Array] = {}
        if self._kind != "pixels":
            for part in self.world.spec["observation"]:
                parts[part["name"]] = specs.Array(shape_of(part), np.float32, part["name"])
        if self._draw:
            size = self.world.spec["pixels"]
            parts["pixels"] = specs.BoundedArray((size["height"], size["width"], 3), np.uint8, 0, 255, "pixels")
        return parts

    def action_spec(self) -> specs.BoundedArray:
        """The task's own bounds, float32 ``[action]``."""
        low, high = self.world.action_bounds
        return specs.BoundedArray(low.shape, np.float32, low, high, "action")

    def close(self) -> None:
        """Ends the environment's thread."""
        self.world.close()

    def _observation(self, rows: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
        parts: dict[str, NDArray[Any]] = {}
        if self._kind != "pixels":
            start, state = 0, rows["state"][0]
            for part in self.world.spec["observation"]:
                parts[part["name"]] = state[start : start + part["len"]].reshape(shape_of(part))
                start += part["len"]
        if self._draw:
            parts["pixels"] = rows["pixels"][0]
        return parts


def shape_of(part: dict[str, Any]) -> tuple[int, ...]:
    """A part of one number is a scalar in dm_control, as the walker's height."""
    return () if part["len"] == 1 else (part["len"],)
