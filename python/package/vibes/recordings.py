"""Recordings: episodes as arrays over the files themselves, and the windows that the trainer draws.

In: the path of a recording. Out: an :class:`Episode`, whose columns are read-only arrays over the memory-mapped file where the file holds them as they
are; and batches of windows ``[batch, time, …]``.
"""

from __future__ import annotations

import operator
import os
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _vibes
from .checks import checked_number, checked_seed

Batch = dict[str, NDArray[Any]]
"""Windows by name: ``pixels`` uint8 ``[batch, time, height, width, 3]`` (where there are pictures), ``observation`` float32 ``[batch, time,
observation]``, ``action`` and ``previous_action`` float32 ``[batch, time, action]`` in the task's own units (the action taken at a row, and the one
before it; zeros where ``is_first``), ``reward`` float32 ``[batch, time]`` (what the row's action earned, summed over the action repeat), ``is_first``
bool ``[batch, time]``, and ``episode`` and ``step`` int64 ``[batch]``: where each window begins."""

Paths = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]
"""The path of one recording, or of several."""


def open(path: str | os.PathLike[str]) -> Recording:  # noqa: A001 - what users of recordings look for
    """Opens a recording. One that is still growing, or was killed, opens with its finished episodes.

    Raises:
        vibes.Error: no recording is there, or its manifest is damaged.
    """
    return Recording(path)


class Episode:
    """One episode of T actions. Row t holds the observation, the action taken there and the reward that action earned; row T has no action.

    Arrays are read-only. Those that the file holds as they are share its memory-mapped pages; ``camera``, ``video`` and ``frame`` are made. numpy refuses
    to write to them, but PyTorch does not ask: ``torch.from_numpy(episode.reward)`` warns, and changing that tensor in place ends the process. Take a
    copy to write to, as ``torch.tensor(episode.reward)`` makes one.
    """

    def __init__(self, native: _vibes.Episode) -> None:
        self._native = native
        self.entry: dict[str, Any] = native.entry()
        """What the manifest says: index, cell, steps, return, policy, seed, model_overrides, files."""

    @property
    def index(self) -> int:
        """The episode's number."""
        return self.entry["index"]

    @property
    def cell(self) -> tuple[int, int] | None:
        """Its place in the grid: (state trajectory, distractor trajectory)."""
        cell = self.entry["cell"]
        return None if cell is None else (cell["state"], cell["distractor"])

    @property
    def steps(self) -> int:
        """Number of actions, T."""
        return self._native.steps

    @property
    def is_terminal(self) -> bool:
        """Whether the last row is terminal (worth 0 from there), not only the last recorded."""
        return self._native.is_terminal

    @cached_property
    def action(self) -> NDArray[np.float32]:
        """``[T, action]``, in the task's own units."""
        return self._column("action")

    @cached_property
    def reward(self) -> NDArray[np.float32]:
        """``[T]``, summed over the action repeat."""
        return self._column("reward")

    @cached_property
    def discount(self) -> NDArray[np.float32]:
        """``[T]``, 0 where the task ended."""
        return self._column("discount")

    @cached_property
    def observation(self) -> NDArray[np.float32]:
        """``[T + 1, observation]``: the task's vector, in dm_control's order."""
        return self._column("observation")

    @cached_property
    def qpos(self) -> NDArray[np.float64]:
        """``[T + 1, qpos]``: generalised positions, metres and radians."""
        return self._column("qpos")

    @cached_property
    def qvel(self) -> NDArray[np.float64]:
        """``[T + 1, qvel]``: generalised velocities, per second."""
        return self._column("qvel")

    @cached_property
    def pixels(self) -> NDArray[np.uint8]:
        """``[T + 1, height, width, 3]``, RGB: the file's pages, read-only; copy what is to be changed."""
        return self._column("pixels")

    @cached_property
    def has_pixels(self) -> NDArray[np.bool_]:
        """``[T + 1]``: which rows have a picture."""
        return self._native.has_pixels()

    @cached_property
    def colors(self) -> NDArray[np.float32]:
        """``[T + 1, materials, 3]``: RGB of every material, 0 to 1."""
        return self._column("colors")

    @cached_property
    def camera(self) -> NDArray[np.float64]:
        """``[T + 1, 4]``: distance in metres, azimuth, inclination and roll in radians."""
        return self._native.camera()

    @cached_property
    def video(self) -> NDArray[np.int64]:
        """``[T + 1]``: which of the manifest's videos is shown, -1 for the task's own sky."""
        return self._native.counts("video")

    @cached_property
    def frame(self) -> NDArray[np.int64]:
        """``[T + 1]``: which frame of it, -1 for the task's own sky."""
        return self._native.counts("frame")

    def release(self) -> None:
        """Gives the memory of the rows seen so far back to the system until they are looked at again."""
        self._native.release()

    def _column(self, name: str) -> NDArray[Any]:
        column = self._native.column(name)
        if column is None:
            raise _vibes.Error(f"this recording has no {name}")
        return column

    def __repr__(self) -> str:
        return f"<vibes.Episode {self.index}: {self.steps} steps, return {self.entry['return']:.1f}>"


class Recording(Sequence[Episode]):
    """A folder of episodes: ``len(recording)``, ``recording[i]`` (the i-th that is there), ``for episode in recording``."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._native = _vibes.Recording(path)
        self.indices: list[int] = self._native.indices()
        """The numbers of the episodes that are there, rising."""

    @property
    def path(self) -> Path:
        """Where it lies."""
        return Path(self._native.path)

    @cached_property
    def manifest(self) -> dict[str, Any]:
        """What was asked for (``options``, ``seed``), versions, spec, grid, videos and the list of episodes; see data/README.md."""
        return self._native.manifest()

    @property
    def spec(self) -> dict[str, Any]:
        """The shape of a row: task, action bounds, parts of the observation, control timestep in seconds, action repeat."""
        return self.manifest["spec"]

    @property
    def task(self) -> str:
        """The task's name."""
        return self.spec["task"]

    def episode(self, index: int) -> Episode:
        """The episode of this number."""
        return Episode(self._native.episode(checked_number(index, "the episode")))

    def windows(self, *, length: int = 32, batch: int = 16, seed: int = 0) -> Windows:
        """The batches of windows that a training run with this seed draws; see :class:`Windows`."""
        return Windows([self.path], length=length, batch=batch, seed=seed)

    def dataset(self, *, length: int = 32) -> WindowDataset:
        """Every window of ``length`` rows by its number; see :class:`WindowDataset`."""
        return WindowDataset([self.path], length=length)

    def __len__(self) -> int:
        return len(self.indices)

    def __getitem__(self, place: Any) -> Any:
        if isinstance(place, slice):
            return [self.episode(index) for index in self.indices[place]]
        return self.episode(self.indices[place])

    def __reduce__(self) -> Any:
        return Recording, (self.path,)

    def __repr__(self) -> str:
        return f"<vibes.Recording of {len(self)} episodes of {self.task}: {self.path}>"


def windows(paths: Paths, *, length: int = 32, batch: int = 16, seed: int = 0) -> Windows:
    """Windows from one recording or several of one spec, every window of every recording equally likely; see :class:`Windows`."""
    return Windows(paths, length=length, batch=batch, seed=seed)


class Windows:
    """Random windows as ``vibes-train offline`` draws them: batch ``u`` is what update ``u`` of a run with this seed sees.

    A window never crosses an episode, and every one of its rows has an action and a reward. ``windows[u]`` is batch u; iteration goes on for ever. With
    ``torch.utils.data.DataLoader(windows, batch_size=None, sampler=range(updates))`` workers gather ahead.

    Args:
        paths: recordings of one spec; the path of one, or several.
        length: rows a window, ``time``.
        batch: windows a batch.
        seed: of the training run.

    Raises:
        vibes.Error: no episode is that long, recordings of other shapes, more than memory holds.
    """

    def __init__(self, paths: Paths, *, length: int = 32, batch: int = 16, seed: int = 0) -> None:
        self._paths = one_or_more(paths)
        sizes = checked_number(length, "length"), checked_number(batch, "batch")
        self._native = _vibes.Windows([_vibes.Recording(path) for path in self._paths], *sizes)
        self.length, self.batch, self.seed = int(length), int(batch), checked_seed(seed)

    @property
    def count(self) -> int:
        """How many different windows there are."""
        return self._native.count

    def __getitem__(self, update: int) -> Batch:
        return batch_first(self._native.of_update(self.seed, checked_seed(update, "the update")))

    def __iter__(self) -> Iterator[Batch]:
        update = 0
        while True:
            yield self[update]
            update += 1

    def release(self) -> None:
        """Gives the memory of the pages seen so far back to the system until they are looked at again."""
        self._native.release()

    def __reduce__(self) -> Any:
        return _windows_again, (self._paths, self.length, self.batch, self.seed)


class WindowDataset:
    """Every window by its number, ``[time, …]`` each: what ``torch.utils.data.DataLoader(dataset, batch_size=16, shuffle=True)`` takes as it is.

    Args:
        paths: recordings of one spec; the path of one, or several.
        length: rows a window, ``time``.
    """

    def __init__(self, paths: Paths, *, length: int = 32) -> None:
        self._paths = one_or_more(paths)
        self._native = _vibes.Windows([_vibes.Recording(path) for path in self._paths], checked_number(length, "length"), 1)
        self.length = int(length)

    def __len__(self) -> int:
        return self._native.count

    def __getitem__(self, number: int) -> Batch:
        place = operator.index(number)
        if not -len(self) <= place < len(self):
            raise IndexError(f"no window {place}; there are {len(self)}")
        rows = batch_first(self._native.numbered(place % len(self)))
        return {name: values[0] for name, values in rows.items()}

    def release(self) -> None:
        """Gives the memory of the pages seen so far back to the system until they are looked at again."""
        self._native.release()

    def __reduce__(self) -> Any:
        return _dataset_again, (self._paths, self.length)


def _windows_again(paths: list[str], length: int, batch: int, seed: int) -> Windows:
    return Windows(paths, length=length, batch=batch, seed=seed)


def _dataset_again(paths: list[str], length: int) -> WindowDataset:
    return WindowDataset(paths, length=length)


def one_or_more(paths: Paths) -> list[str]:
    """Paths one by one, from the path of one recording or from several."""
    several: Sequence[str | os.PathLike[str]] = [paths] if isinstance(paths, (str, os.PathLike)) else paths
    return [os.fspath(path) for path in several]


def batch_first(rows: Batch) -> Batch:
    """``[time, batch, …]``, as the trainer gathers them, as views ``[batch, time, …]``."""
    return {name: values if values.ndim < 2 else values.swapaxes(0, 1) for name, values in rows.items()}
