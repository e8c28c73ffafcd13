"""Trained models: what ``vibes-train`` has learned, as numpy in and out.

In: a run's folder, observations and actions. Out: latents ``[rows, latent]`` (the posterior's mean, of unit norm, as ``vibes-train encode`` writes it) and
actions ``[action]`` in the task's own units.
"""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _vibes
from .checks import checked_array, checked_episodes, checked_flag, checked_seed
from .recordings import Episode

if TYPE_CHECKING:
    from .recordings import Recording


def load(path: str | os.PathLike[str]) -> Model:
    """The newest checkpoint of a run, on the CPU.

    Args:
        path: the run's folder, as in "runs/reacher", or the folder of one of its checkpoints.

    Raises:
        vibes.Error: no checkpoint is there, or it is damaged.
    """
    return Model(path)


class Model:
    """A trained encoder, and an agent where the run has an actor."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._native = _vibes.Model(path)
        self.config: dict[str, Any] = self._native.config()
        """Task, observation, action bounds and sizes, as the checkpoint keeps them."""

    @property
    def checkpoint(self) -> Path:
        """The checkpoint's folder."""
        return Path(self._native.checkpoint)

    @property
    def task(self) -> str:
        """The task it was trained on."""
        return self.config["task"]

    @property
    def kind(self) -> str:
        """What it looks at: pixels or vector."""
        return self.config["observation"]["kind"]

    @property
    def acts(self) -> bool:
        """Whether it has an actor."""
        return self._native.acts

    def encode(self, observations: ArrayLike | Episode, actions: ArrayLike | None = None) -> NDArray[np.float32]:
        """Latents of an episode's rows, from its first on.

        Args:
            observations: ``[rows, …]`` of the kind the model looks at: uint8 ``[rows, height, width, 3]`` or float32 ``[rows, observation]``; or a whole
                episode of a recording.
            actions: ``[rows - 1, action]`` or more, in the task's own units: action t was executed after row t. Not with an episode.

        Returns:
            ``[rows, latent]``.

        Raises:
            vibes.Error: observations or actions of another kind or shape, actions beside an episode, or a number that is not finite.
        """
        if isinstance(observations, Episode):
            if actions is not None:
                raise _vibes.Error("an episode of a recording and actions; right is the episode alone, which has its own, or its rows and the actions")
            episode = observations
            seen: Any = episode.pixels if self.kind == "pixels" else episode.observation
            taken = episode.action
        else:
            seen = self._seen("observations", observations)
            taken = checked_array("actions", [] if actions is None else actions, "numbers [rows - 1, action]", np.float32)
        width = len(self.config["action_min"])
        rows = len(seen) if seen.ndim else 0
        # Of a single row no action is needed, and one of another shape is a mistake all the same.
        if (rows > 1 or (rows == 1 and taken.size)) and (taken.ndim != 2 or len(taken) < rows - 1 or taken.shape[1] != width):
            raise _vibes.Error(f"actions of shape {taken.shape}; right is [{rows - 1}, {width}]")
        before = np.zeros((rows, width), np.float32)
        if rows > 1:
            before[1:] = taken[: rows - 1]
        return self._native.encode(seen, before)

    def encode_recording(self, recording: Recording) -> NDArray[np.float32]:
        """Latents of every row of a recording, episode after episode: ``[rows, latent]``, as ``vibes.measures.Table`` takes them.

        Warns of a recording of another task than the model was trained on: where pictures and actions have the same sizes it can be encoded, too.
        """
        checked_episodes(recording)
        if recording.task != self.task:
            told = f"a recording of {recording.task}, and a model that was trained on {self.task}; latents of another task say little: {recording.path}"
            warnings.warn(told, stacklevel=2)
        return np.concatenate([self.encode(episode) for episode in recording])

    def begin(self, seed: int = 0) -> None:
        """Begins an episode: everything of the one before is forgotten. ``seed`` is that of sampled actions."""
        self._native.begin(checked_seed(seed))

    def act(self, observation: ArrayLike, *, executed: ArrayLike | None = None, sample: bool = False) -> NDArray[np.float32]:
        """The action for the next observation of the episode.

        Args:
            observation: one of the kind the model looks at, as the environment gives it.
            executed: the action that was executed before it, if it was not the one this returned.
            sample: a drawn action instead of the distribution's mode.

        Returns:
            ``[action]``, in the task's own units.

        Raises:
            vibes.Error: the model has no actor or looks at something else, or a number is not finite.
        """
        seen = self._seen("observation", observation)
        before = None if executed is None else np.ravel(checked_array("executed", executed, "numbers [action]", np.float32))
        return self._native.act(seen[None], before, checked_flag(sample, "sample"))

    def _seen(self, what: str, observations: ArrayLike) -> NDArray[Any]:
        # Pictures keep their type, because only bytes are pictures; vectors are taken in single precision.
        return checked_array(what, observations, f"what the model looks at, {self.kind}", None if self.kind == "pixels" else np.float32)

    def __repr__(self) -> str:
        return f"<vibes.Model of {self.task}: {self.checkpoint}>"
