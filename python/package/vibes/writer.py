"""Recordings from one's own policy.

In: an environment of this package and a policy, or whole episodes of anything as arrays. Out: a recording that ``vibes-collect``, ``vibes-train`` and
``vibes-analyze`` read.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _vibes
from .checks import checked_array, checked_flag, checked_name, checked_number, checked_real, checked_seed
from .recordings import Recording
from .world import World

TYPES = {"qpos": np.float64, "qvel": np.float64, "pixels": np.uint8}
"""Columns that are not float32."""


class Writer:
    """A recording that grows; each episode is there whole or not at all. Use it in a ``with`` block, or ``close`` it.

    With an environment of this package every episode that begins from now on and is played to its end is kept, with its physics and distractors, so
    that ``vibes-collect verify`` simulates and draws it again::

        env = vibes.make("reacher-easy", seed=3)
        with vibes.Writer("recordings/mine", env) as writer:
            writer.record(lambda observation: env.action_space.sample(), episodes=10)

    With ``grid=(states, distractors)`` it is a grid: every state trajectory under every distractor trajectory, so that one physics is there in many
    pictures. ``record`` lets the policy act once for a state trajectory and draws its other cells; whoever steps an environment plays the cells of one
    row with the same actions (``env.reset(options={"state": i, "distractor": j})``).

    Whatever is wrapped around the environment stays there: ``record`` plays through the wrappers, and what is kept are the actions that were executed, with
    the environment's own observations and rewards. Outside a grid the recording says that pictures were acted by (``acting_distractor``) where the
    environment's observations have some.

    Without an environment, ``spec`` says what a row holds, and ``write`` takes whole episodes::

        spec = {"task": "mine", "action_low": [-1], "action_high": [1], "observation": {"position": 3}, "size": 64, "control_timestep": 0.02}
        with vibes.Writer("recordings/mine", spec=spec) as writer:
            writer.write(action=actions, reward=rewards, observation=observations, pixels=pictures)

    Args:
        path: the recording's folder; one that was begun with the same options goes on.
        env: an environment from ``make``, ``make_dm``, ``make_vec``, or a ``World``.
        spec: task (a name), action_low and action_high (numbers), observation (parts with their sizes), and where there are any: size (pixels), qpos,
            qvel (counts), control_timestep (seconds, 1 unless given), action_repeat (1 unless given).
        grid: numbers of state and of distractor trajectories, where the recording is a grid.
        mcap: whether an MCAP log is written beside every Arrow table.

    Raises:
        vibes.Error: another recording is there, or the spec is of no recording.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        env: Any = None,
        *,
        spec: dict[str, Any] | None = None,
        grid: tuple[int, int] | None = None,
        mcap: bool = True,
    ) -> None:
        if (env is None) == (spec is None):
            raise _vibes.Error("a Writer takes an environment of this package, or the spec of another; give one of the two")
        mcap = checked_flag(mcap, "mcap")
        self._env = env
        self._grid = None if grid is None else checked_grid(grid)
        self._world = None if env is None else world_of(env)
        self._sees_pictures = self._world is not None and self._grid is None and observes_pictures(env)
        """Whether actions are chosen by pictures, unless somebody says otherwise. In a grid only ``record`` knows under which distractor they are."""
        if self._world is not None:
            self._native = _vibes.Writer.of_world(path, self._world._native, self._world.seed, mcap, self._grid)
            self._world.keep(self)
        else:
            self._native = _vibes.Writer.of_spec(path, row_spec({} if spec is None else spec), 0, mcap, self._grid)

    @property
    def path(self) -> Path:
        """Where the recording lies."""
        return Path(self._native.path)

    def __len__(self) -> int:
        return len(self._native)

    @property
    def grid(self) -> tuple[int, int] | None:
        """Numbers of state and of distractor trajectories; None of a recording that is no grid."""
        return self._grid

    def next_episode(self) -> int:
        """The first number that no episode has yet; in a grid that of state i under distractor j is i times the number of distractors, plus j."""
        number = 0
        while self._has(number):
            number += 1
        return number

    def record(self, policy: Callable[[Any], ArrayLike], episodes: int | None = None) -> list[float]:
        """Plays and keeps whole episodes of an environment from ``make``, from the first number that is free; returns their returns, as they are kept.

        In a grid an episode is a state trajectory with all its cells. A policy that sees pictures acts under the distractor trajectory of the same
        number, as ``vibes-collect`` lets it, and the actions that were executed are played again under the others.

        Args:
            policy: from an observation to an action ``[action]``, both as the environment has them with whatever is wrapped around it.
            episodes: how many; 1 unless given, in a grid all that are not there yet.

        Raises:
            vibes.Error: an environment that is none of ``make``'s, or a wrapper that ends episodes early: a recording keeps whole ones.
        """
        inner = getattr(self._env, "unwrapped", None)
        if self._world is None or not hasattr(inner, "_taken"):
            raise _vibes.Error("record plays an environment from vibes.make; others are kept while they are stepped")
        episodes = None if episodes is None else checked_number(episodes, "episodes")
        try:
            if self._grid is not None:
                rows = [row for row in range(self._grid[0]) if self._missing(row)]
                return [self._record_row(inner, policy, row) for row in rows[:episodes]]
            self._keep(inner)
            count = range(1 if episodes is None else episodes)
            return [played(self._env, policy, {"episode": self.next_episode()})[0] for _ in count]
        finally:
            self._world.keep(self)

    def write(
        self,
        *,
        is_terminal: bool = False,
        policy: str = "python",
        seed: int = 0,
        index: int | None = None,
        cell: tuple[int, int] | None = None,
        **columns: ArrayLike,
    ) -> int:
        """Writes one whole episode of T actions; returns its number.

        Args:
            action: ``[T, action]``. reward: ``[T]``. discount: ``[T]``; unless given ones, and 0 for the last step before a terminal row.
            observation: ``[T + 1, observation]``. pixels: uint8 ``[T + 1, size, size, 3]``. qpos, qvel: ``[T + 1, …]``. Those that the spec names.
            is_terminal: whether the last row is worth 0 from there.
            policy: what acted, for the manifest.
            seed: of the episode, for the manifest.
            index: its number; the first free one unless given.
            cell: state and distractor trajectory, in a grid, in place of the number.

        Raises:
            vibes.Error: a column of another shape or length, or a reward that is not finite; nothing is written then.
        """
        if cell is not None and (self._grid is None or index is not None):
            raise _vibes.Error("a cell is of a Writer with a grid, and stands in place of the index; give one of the two")
        number = self.next_episode() if index is None else checked_number(index, "index")
        place = self._place(number) if cell is None else pair(cell, "a cell")
        known = ("action", "reward", "discount", "observation", "pixels", "qpos", "qvel", "colors")
        if unknown := set(columns) - set(known):
            raise _vibes.Error(f"unknown columns {sorted(unknown)}; known are {', '.join(known)}")
        arrays = {name: as_type(name, values) for name, values in columns.items() if values is not None}
        is_terminal, policy = checked_flag(is_terminal, "is_terminal"), checked_name(policy, "policy")
        self._native.write(place, arrays, is_terminal=is_terminal, policy=policy, seed=checked_seed(seed))
        return number if self._grid is None else place[0] * self._grid[1] + place[1]

    def _place(self, number: int) -> tuple[int, int]:
        return (number, number) if self._grid is None else divmod(number, self._grid[1])

    def _has(self, number: int) -> bool:
        if self._grid is not None and number >= self._grid[0] * self._grid[1]:
            return False
        return self._native.has(*self._place(number))

    def _missing(self, row: int) -> list[int]:
        columns = 0 if self._grid is None else self._grid[1]
        return [column for column in range(columns) if not self._native.has(row, column)]

    def _keep(self, inner: Any) -> None:
        assert self._world is not None
        self._world.keep(self, acts_by_pictures=inner.observes_pictures)

    def _record_row(self, inner: Any, policy: Callable[[Any], ArrayLike], row: int) -> float:
        """One state trajectory under every distractor trajectory that is missing: acted once, or as its other cells say."""
        assert self._world is not None
        missing = self._missing(row)
        _, columns = self._grid or (0, 0)
        there = [column for column in range(columns) if column not in missing]
        if there:
            actions = list(Recording(self.path).episode(row * columns + there[0]).action)
            earned = 0.0
        else:
            # Kept where the column of the row's own number is in the grid.
            self._keep(inner) if row < columns else self._world.keep(None)
            earned, actions = played(self._env, policy, {"state": row, "distractor": row})
        self._keep(inner)
        for column in self._missing(row):
            earned = replayed(inner, actions, {"state": row, "distractor": column})
        return earned

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


def played(env: Any, policy: Callable[[Any], ArrayLike], options: dict[str, int]) -> tuple[float, list[NDArray[np.float32]]]:
    """Plays the episode that the options of a reset name to its end, through whatever is wrapped around the environment: the return and the actions
    that the environment inside has, which a recording keeps."""
    inner = env.unwrapped
    inner._taken = []
    try:
        observation, _ = env.reset(options=options)
        asked, begun = options.get("episode", options.get("state")), int(inner.world.episodes[0])
        if begun != asked:
            raise _vibes.Error(f"{type(env).__name__} began episode {begun} where {asked} was asked for; its reset must pass its options on")
        is_over = False
        while not is_over:
            observation, _, terminated, truncated, _ = env.step(policy(observation))
            is_over = terminated or truncated
        taken = inner._taken
    finally:
        inner._taken = None
    if len(taken) < inner.world.episode_steps:
        raise _vibes.Error(
            f"{type(env).__name__} ended an episode after {len(taken)} of {inner.world.episode_steps} steps; a recording keeps whole ones, so take off "
            "the wrapper that ends them"
        )
    return sum(reward for _, reward in taken), [action for action, _ in taken]


def replayed(inner: Any, actions: list[NDArray[np.float32]], options: dict[str, int]) -> float:
    """Plays the episode that the options of a reset name with these actions of the environment's own: its return."""
    inner.reset(options=options)
    return sum(inner.step(action)[1] for action in actions)


def observes_pictures(env: Any) -> bool:
    """Whether whoever acts in this environment is shown pictures: a world's rows have them wherever it draws, others say it."""
    said = getattr(getattr(env, "unwrapped", env), "observes_pictures", None)
    return world_of(env).spec["pixels"] is not None if said is None else bool(said)


def pair(numbers: Any, what: str) -> tuple[int, int]:
    """Two numbers of trajectories, or what would be two."""
    try:
        state, distractor = numbers
    except (TypeError, ValueError):
        raise _vibes.Error(f"{what} {numbers!r}; right is (state, distractor), two whole numbers") from None
    return checked_number(state, f"the state of {what}"), checked_number(distractor, f"the distractor of {what}")


def checked_grid(grid: Any) -> tuple[int, int]:
    """Numbers of state and of distractor trajectories."""
    return pair(grid, "a grid")


def world_of(env: Any) -> World:
    """The world inside an environment of this package, whatever is wrapped around it."""
    inner = env if isinstance(env, World) else getattr(getattr(env, "unwrapped", env), "world", None)
    if not isinstance(inner, World):
        raise _vibes.Error(f"{type(env).__name__} is no environment of this package; give a spec instead")
    return inner


def as_type(name: str, values: ArrayLike) -> Any:
    """A column as the format keeps it. Pictures must be bytes already: a silent cast would wrap or darken them."""
    array = checked_array(name, values, "numbers [rows, …]")
    if name == "pixels" and array.dtype != np.uint8:
        raise _vibes.Error(f"pixels of type {array.dtype}; pictures are uint8, 0 to 255")
    return np.ascontiguousarray(checked_array(name, array, "numbers [rows, …]", TYPES.get(name, np.float32)))


def row_spec(spec: dict[str, Any]) -> dict[str, Any]:
    """A user's short spec as the manifest's."""
    if not isinstance(spec, Mapping):
        raise _vibes.Error(f"the spec {spec!r}; right is a dictionary that names at least task, action_low and action_high")
    known = {"task", "action_low", "action_high", "observation", "size", "qpos", "qvel", "control_timestep", "action_repeat"}
    if unknown := set(spec) - known:
        raise _vibes.Error(f"unknown keys of the spec {sorted(map(str, unknown))}; known are {', '.join(sorted(known))}")
    if missing := {"task", "action_low", "action_high"} - set(spec):
        raise _vibes.Error(f"the spec has no {', '.join(sorted(missing))}; it names at least task, action_low and action_high")
    size, parts = spec.get("size"), spec.get("observation", {})
    if not isinstance(parts, Mapping):
        raise _vibes.Error(f"the spec's observation {parts!r}; right is a dictionary of parts with their sizes, as {{'position': 3}}")
    side = None if size is None else checked_number(size, "the spec's size, one side of its square pictures,")
    bounds = {name: checked_array(f"the spec's {name}", spec[name], "numbers [action]", float) for name in ("action_low", "action_high")}
    return {
        "task": checked_name(spec["task"], "the spec's task"),
        "action": {"min": np.ravel(bounds["action_low"]).tolist(), "max": np.ravel(bounds["action_high"]).tolist()},
        "observation": [{"name": str(name), "len": checked_number(count, f"the spec's observation {name!r}")} for name, count in parts.items()],
        "qpos": checked_number(spec.get("qpos", 0), "the spec's qpos"),
        "qvel": checked_number(spec.get("qvel", 0), "the spec's qvel"),
        "pixels": None if side is None else {"height": side, "width": side},
        "materials": [],
        "control_timestep": checked_real(spec.get("control_timestep", 1.0), "the spec's control_timestep"),
        "action_repeat": checked_number(spec.get("action_repeat", 1), "the spec's action_repeat"),
    }
