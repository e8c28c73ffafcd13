"""Many environments for Gymnasium, drawn on all cores by threads inside the library.

In: actions ``[environments, action]``. Out: batches of observations and rewards. An environment whose episode is over begins the next one at the next
step (Gymnasium's ``AutoresetMode.NEXT_STEP``), whose action is not looked at and whose reward is 0.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from .checks import checked_choice, checked_options
from .environment import action_space, observation_space
from .world import open_world


class VectorEnvironment(VectorEnv[Any, Any, Any]):
    """``num_envs`` environments of one task; see :func:`vibes.make_vec` for the arguments."""

    metadata = {"render_modes": ["rgb_array"], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        task: str = "reacher-easy",
        num_envs: int = 1,
        *,
        observation: str = "pixels",
        render_mode: str | None = None,
        threads: int | None = None,
        **options: Any,
    ) -> None:
        self.world = open_world(task, observation, render_mode, environments=num_envs, threads=threads, **options)
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.single_observation_space = observation_space(self.world, observation)
        self.single_action_space = action_space(self.world)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._kind = observation
        self._draw = self.observes_pictures = observation != "state"
        """Whether observations have pictures."""
        self._over = np.zeros(num_envs, bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begins the next episode of every environment.

        Args:
            seed: of the recording whose episodes 0, 1, … the environments begin with, and which they go on with together. Or one seed for each, of a
                recording that it goes through by itself from its episode 0 on; where it is None an environment goes on as it is.
            options: ``{"reset_mask": [environments]}`` resets only some.

        Returns:
            The observations, and ``{"episode_number": [environments]}``.
        """
        options = checked_options(options, ("reset_mask",))
        mask = checked_choice("reset_mask", options.get("reset_mask"), self.num_envs)
        with self.world._unless_refused():
            if seed is not None:
                self.world.seek(0, seed=of_chosen(seed, mask))
            rows = self.world.reset(mask, draw=self._draw)
        self._over[mask] = False
        return self._observation(rows), {"episode_number": self.world.episodes}

    def step(self, actions: Any) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """One agent step of every environment, ``[environments, action]``.

        Returns:
            Observations, rewards, terminated (never), truncated (after 1000 control steps), and the numbers of the episodes.
        """
        rows = self.world.step(actions, self._over, draw=self._draw)
        self._over = rows["is_last"].copy()
        info = {"episode_number": self.world.episodes}
        return self._observation(rows), rows["reward"], np.zeros(self.num_envs, bool), rows["is_last"], info

    def render(self) -> tuple[NDArray[np.uint8], ...] | None:
        """The present pictures; None unless made with ``render_mode="rgb_array"``."""
        pictures = self.world.pictures() if self.render_mode == "rgb_array" else None
        return None if pictures is None else tuple(pictures)

    def close_extras(self, **kwargs: Any) -> None:
        """Ends the threads."""
        self.world.close()

    def _observation(self, rows: dict[str, NDArray[Any]]) -> Any:
        if self._kind == "both":
            return {"pixels": rows["pixels"], "state": rows["state"]}
        return rows[self._kind]


def of_chosen(seed: Any, chosen: NDArray[np.bool_]) -> Any:
    """Of seeds for each environment those of the chosen ones; anything else as it is."""
    if not isinstance(seed, Iterable) or isinstance(seed, (str, bytes)) or np.ndim(seed) == 0:
        return seed
    seeds = list(seed)
    return [value if begins else None for value, begins in zip(seeds, chosen)] if len(seeds) == len(chosen) else seeds
