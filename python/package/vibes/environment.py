"""One environment for Gymnasium.

In: actions ``[action]`` in the task's own units. Out: observations, rewards summed over the action repeat. The suite's tasks never end by themselves:
after 1000 control steps ``truncated`` is true.
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from . import _vibes
from .checks import checked_number, checked_options, checked_seed, checked_shape
from .world import World, open_world


def observation_space(world: World, observation: str) -> spaces.Space[Any]:
    """Pixels uint8 ``[size, size, 3]``, the task's vector float32 ``[observation]``, or both under those names."""
    state = spaces.Box(-np.inf, np.inf, (world.state_size,), np.float32)
    if observation == "state":
        return state
    size = world.spec["pixels"]
    pixels = spaces.Box(0, 255, (size["height"], size["width"], 3), np.uint8)
    return pixels if observation == "pixels" else spaces.Dict({"pixels": pixels, "state": state})


def action_space(world: World) -> spaces.Box:
    """The task's own bounds, float32 ``[action]``."""
    low, high = world.action_bounds
    return spaces.Box(low, high, dtype=np.float32)


class Environment(gymnasium.Env[Any, Any]):
    """A task of the Distracting Control Suite; see :func:`vibes.make` for the arguments."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 25}

    def __init__(
        self, task: str = "reacher-easy", *, observation: str = "pixels", render_mode: str | None = None, **options: Any
    ) -> None:
        self.world = open_world(task, observation, render_mode, environments=1, **options)
        self.render_mode = render_mode
        self.observation_space = observation_space(self.world, observation)
        self.action_space: spaces.Space[Any] = action_space(self.world)
        spec = self.world.spec
        self.metadata = self.metadata | {"render_fps": max(1, round(1 / (spec["control_timestep"] * spec["action_repeat"])))}
        self._kind = observation
        self._draw = self.observes_pictures = observation != "state"
        """Whether observations have pictures."""
        self._taken: list[tuple[NDArray[np.float32], float]] | None = None
        """Actions of this episode with their rewards, for a Writer that plays it through whatever is wrapped around the environment."""

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begins the next episode; with ``seed`` episode 0 of a recording of that seed.

        Args:
            seed: of the recording; the episodes after this one are its next ones.
            options: ``{"episode": i}`` begins episode i; ``{"state": i, "distractor": j}`` state trajectory i under distractor trajectory j, as the
                cell of a grid.

        Returns:
            The observation, and ``{"episode_number": i}``.
        """
        super().reset(seed=None if seed is None else checked_seed(seed))
        options = checked_options(options, ("episode", "state", "distractor"))
        if "distractor" in options and "state" not in options or "episode" in options and "state" in options:
            raise _vibes.Error(f"reset options {sorted(options)}; right is an episode alone, or a state with or without its distractor")
        with self.world._unless_refused():
            if seed is not None:
                self.world.seek(0, seed=seed)
            if "episode" in options:
                self.world.seek(checked_number(options["episode"], "the episode"))
            if "state" in options:
                state = checked_number(options["state"], "the state trajectory")
                rows = self.world.reset_to([(self.world.seed, state, options.get("distractor", state))], draw=self._draw)
            else:
                rows = self.world.reset(draw=self._draw)
        if self._taken is not None:
            self._taken = []
        return self._observation(rows), {"episode_number": int(self.world.episodes[0])}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """One agent step: the action ``[action]``, cut to its bounds, is held for the action repeat.

        Returns:
            The observation, the reward summed over the repeat, terminated (never), truncated (after 1000 control steps), ``{}``.
        """
        numbers = checked_shape("action", action, (self.world.action_size,))
        rows = self.world.step(numbers[None], draw=self._draw)
        reward = float(rows["reward"][0])
        if self._taken is not None:
            # A copy, since a policy may write its next action into the same array.
            self._taken.append((numbers.copy(), reward))
        return self._observation(rows), reward, False, bool(rows["is_last"][0]), {}

    def render(self) -> NDArray[np.uint8] | None:
        """The present picture, uint8 ``[size, size, 3]``; None unless made with ``render_mode="rgb_array"``."""
        pictures = self.world.pictures() if self.render_mode == "rgb_array" else None
        return None if pictures is None else pictures[0]

    def close(self) -> None:
        """Ends the environment's thread."""
        self.world.close()

    def _observation(self, rows: dict[str, NDArray[Any]]) -> Any:
        if self._kind == "both":
            return {"pixels": rows["pixels"][0], "state": rows["state"][0]}
        return rows[self._kind][0]
