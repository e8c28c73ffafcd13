"""The toolkit's measures on numpy arrays: one definition of every number, the same that ``vibes-train evaluate`` and ``vibes-analyze`` print.

In: latents ``[rows, dims]`` of any model with the key of every row (:class:`Table`). Out: plain dictionaries under the names that the programs print, which
measure/README.md defines. Wherever a number has an interval, it is a dictionary of ``estimate``, ``low`` and ``high``, the 95% interval over state and
distractor trajectories (not a number where there are too few to say), mostly with ``chance`` beside them: what latents that say nothing would give.

    table = vibes.measures.Table(latents, recording=recording)
    vibes.measures.variance_shares(table)["distractor_share"]["estimate"]
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _vibes
from .checks import checked_array, checked_episodes, checked_finite, checked_name, checked_number, checked_real, checked_seed

if TYPE_CHECKING:
    from .recordings import Recording

Numbers = dict[str, Any]


class Table:
    """Latents with the key of every row, and on a grid the row's cell.

    Args:
        latents: ``[rows, dims]``, float32; every value finite.
        recording: the recording whose rows these are, all episodes one after the other with all their T + 1 rows. Gives the keys and the cells.
        episode, step: ``[rows]`` each; instead of ``recording``.
        state, distractor: ``[rows]`` each, the row's cell in the grid; both left out, or -1 in rows that have none. Not with ``recording``.

    Raises:
        vibes.Error: columns of other lengths, no rows, a value that is not finite, two rows of one episode and step, a state without a distractor, a
            recording and keys beside it.
    """

    def __init__(
        self,
        latents: ArrayLike,
        *,
        recording: Recording | None = None,
        episode: ArrayLike | None = None,
        step: ArrayLike | None = None,
        state: ArrayLike | None = None,
        distractor: ArrayLike | None = None,
    ) -> None:
        self.latents: NDArray[np.float32] = checked_array("latents", latents, "numbers [rows, dims]", np.float32)
        if self.latents.ndim != 2:
            raise _vibes.Error(f"latents of shape {self.latents.shape}; right is [rows, dims]")
        self._recording = recording
        keys: dict[str, Any] = {"episode": episode, "step": step, "state": state, "distractor": distractor}
        check_keys(recording, keys)
        if recording is not None:
            keys = row_keys(recording)
            if len(keys["step"]) != len(self.latents):
                there = f"the recording has {len(keys['step'])} ({len(recording)} episodes, each with its T + 1 rows)"
                raise _vibes.Error(f"latents of {len(self.latents)} rows; {there}: {recording.path}")
        self.episode, self.step = counts("episode", keys["episode"]), counts("step", keys["step"])
        grid = None
        if keys["state"] is not None and keys["distractor"] is not None:
            grid = (cells("state", keys["state"]), cells("distractor", keys["distractor"]))
        self._native = _vibes.Table(self.latents, self.episode, self.step, grid)

    def __len__(self) -> int:
        return len(self.latents)

    @cached_property
    def _views(self) -> tuple[NDArray[np.int64], NDArray[np.int64]] | None:
        """The state and distractor trajectory of every row where episodes of the recording are views of one state trajectory without cells, as
        ``vibes-collect merge`` leaves them. Asked for by the probes alone, because every episode's actions are read for it."""
        if self._recording is None:
            return None
        entries = self._recording.manifest["episodes"]
        if all(entry["cell"] for entry in entries):
            return None
        rows = [entry["steps"] + 1 for entry in entries]
        state, distractor = (np.repeat(numbers, rows) for numbers in self._recording._native.trajectories())
        return state, distractor


def check_keys(recording: Recording | None, keys: Mapping[str, Any]) -> None:
    """That rows are told apart by a recording alone, or by columns of which none lacks the one that belongs to it."""
    given = [name for name, column in keys.items() if column is not None]
    if recording is not None and given:
        raise _vibes.Error(f"recording and {', '.join(given)}; a recording says the keys of its rows itself, so give one or the other")
    if recording is None and ("episode" not in given or "step" not in given):
        raise _vibes.Error("a table needs the key of every row; give recording, or episode and step")
    if len(cell := [name for name in given if name in ("state", "distractor")]) == 1:
        raise _vibes.Error(f"{cell[0]} alone; right is state and distractor, the row's cell in a grid, or neither")


def row_keys(recording: Recording) -> dict[str, Any]:
    """``episode``, ``step``, ``state`` and ``distractor`` of every row of a recording, episode after episode; the last two None without a grid."""
    checked_episodes(recording)
    entries = recording.manifest["episodes"]
    rows = [entry["steps"] + 1 for entry in entries]
    cells = [entry["cell"] or {"state": -1, "distractor": -1} for entry in entries]
    has_grid = any(entry["cell"] for entry in entries)
    return {
        "episode": np.repeat([entry["index"] for entry in entries], rows),
        "step": np.concatenate([np.arange(count) for count in rows]),
        "state": np.repeat([cell["state"] for cell in cells], rows) if has_grid else None,
        "distractor": np.repeat([cell["distractor"] for cell in cells], rows) if has_grid else None,
    }


def counts(name: str, values: ArrayLike) -> NDArray[np.uint32]:
    """Whole numbers from 0 as the tables keep them."""
    array = checked_array(name, values, "whole numbers [rows]")
    if array.ndim != 1 or array.dtype.kind not in "iu" or (array.size and (array.min() < 0 or array.max() >= 2**32)):
        raise _vibes.Error(f"{name} of type {array.dtype} and shape {array.shape}; right is [rows], whole numbers from 0 to 2**32 - 1")
    return array.astype(np.uint32)


def cells(name: str, values: ArrayLike) -> NDArray[np.int64]:
    """Numbers of trajectories, -1 in rows of no cell, as the tables keep them."""
    array = checked_array(name, values, "whole numbers [rows]")
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise _vibes.Error(f"{name} of type {array.dtype} and shape {array.shape}; right is [rows], whole numbers, -1 in rows of no cell")
    if array.size and (int(array.min()) < -1 or int(array.max()) >= 2**32):
        raise _vibes.Error(f"{name} from {array.min()} to {array.max()}; right is whole numbers from 0 to 2**32 - 1, -1 in rows of no cell")
    return array.astype(np.int64)


def grid_numbers(
    table: Table, *, past_actions: Table | None = None, k: Sequence[int] = (1, 5), tolerance: int = 2, queries: int = 2000, seed: int = 0
) -> dict[str, Numbers]:
    """All numbers of a grid by name: retrieval_same_step@k, retrieval_any_step@k, state_share, distractor_share, interaction_share,
    within_state_share, denoising_factor and effective_rank.

    Each is a dictionary of estimate, low, high, ``chance`` (latents that say nothing) and ``past_actions`` (the same number of the action-only control).

    Args:
        table: latents of a grid.
        past_actions: features of past actions as another table of the same rows; see :func:`past_actions_table`.
        k: neighbours looked at by the retrievals.
        tolerance: retrieval_any_step: steps that a neighbour of the same state may be away.
        queries: retrieval_any_step: most rows to ask for.
        seed: of what is drawn.
    """
    control = None if past_actions is None else past_actions._native
    if not isinstance(k, Iterable):
        raise _vibes.Error(f"k {k!r}; right is whole numbers, as (1, 5)")
    counted = [checked_number(number, "k") for number in k]
    words = (checked_number(tolerance, "tolerance"), checked_number(queries, "queries"), checked_seed(seed))
    return table._native.grid_numbers(control, counted, *words)


def variance_shares(table: Table) -> Numbers:
    """How much of the latents' variance the state explains, the distractor, and neither alone.

    Returns:
        ``state_share``, ``distractor_share``, ``interaction_share`` (they add up to 1) and ``within_state_share`` (0 for a latent that ignores
        distractors) with intervals and ``chance``, and the first three shares ``by_step``.
    """
    return table._native.variance_shares()


def denoising_factor(table: Table) -> Numbers:
    """How much of the distance between two states' latents the distractors do not add; an interval. measure/src/invariance/denoising.rs defines it."""
    return table._native.denoising_factor()


def retrieval(table: Table, *, among: str = "same_step", k: int = 1, tolerance: int = 2, queries: int = 2000, seed: int = 0) -> Numbers:
    """How often a row of the same state under another distractor is among a latent's ``k`` nearest.

    Args:
        table: latents of a grid.
        among: same_step (candidates: all other cells at that step) or any_step (all rows under another distractor; at most ``tolerance`` steps away
            counts as found).
        k: neighbours looked at.
        tolerance, queries: of any_step.
        seed: of what is drawn.

    Returns:
        ``retrieval_same_step@k`` or ``retrieval_any_step@k``, with the k that was asked for in the name, its interval and ``chance``; and ``queries``, how
        many rows were asked for.
    """
    if not isinstance(among, str) or among not in ("same_step", "any_step"):
        raise _vibes.Error(f"unknown candidates {among!r}, choose one of: same_step, any_step")
    words = (checked_number(k, "k"), checked_number(tolerance, "tolerance"), checked_number(queries, "queries"), checked_seed(seed))
    return table._native.retrieval(among == "same_step", *words)


def neighbours(
    table: Table, queries: ArrayLike | None = None, *, k: int = 5, exclude: str = "trajectory", metric: str = "standardized"
) -> dict[str, NDArray[Any]]:
    """The ``k`` nearest rows of each query, nearest first, exactly.

    Args:
        table: the latents.
        queries: row numbers ``[queries]``; all rows unless given.
        k: how many.
        exclude: which rows cannot be neighbours: those of the query's trajectory (its episode), those of its state (trajectory, on a grid), or only the
            row itself, as ``row``.
        metric: standardized (each dimension over its standard deviation), euclidean or cosine.

    Returns:
        ``rows`` int64 and ``distances`` float64, ``[queries, k]`` each.
    """
    asked = np.arange(len(table)) if queries is None else checked_array("queries", queries, "row numbers [queries]")
    if asked.ndim != 1 or asked.dtype.kind not in "iu":
        raise _vibes.Error(f"queries of type {asked.dtype} and shape {asked.shape}; right is [queries], row numbers")
    words = (checked_number(k, "k"), checked_name(exclude, "exclude"), checked_name(metric, "metric"))
    rows, distances = table._native.neighbours(asked.astype(np.int64), *words)
    return {"rows": rows, "distances": distances}


def probes(
    table: Table,
    quantities: Mapping[str, ArrayLike],
    *,
    fit_on: tuple[Table, Mapping[str, ArrayLike]] | None = None,
    hold_out: Mapping[str, str] | None = None,
    folds: int = 5,
    k: int = 10,
    seed: int = 0,
) -> list[Numbers]:
    """What can be read from the latents, by a linear probe and a k-nearest-neighbours one, judged on trajectories they have not seen.

    Episodes without cells that took the same actions are views of one state trajectory, in a table of a recording (``recording=``): they are held out together.

    Args:
        table: the latents.
        quantities: values ``[rows]`` by name. Floats are numbers, scored by R²; whole numbers and booleans are classes, scored by accuracy.
        fit_on: another table and the same quantities of it, of the same kinds, to fit probes of numbers on (the training recordings, say).
        hold_out: of single quantities what is held out together: state (trajectories, unless given), episode or distractor.
        folds: into which a table's own trajectories are cut, at least 2; fewer where there are fewer trajectories.
        k: neighbours of the kNN probe.
        seed: of what is drawn.

    Returns:
        For each quantity and probe: ``quantity``, ``probe`` (linear, knn), ``fitting`` (other_recordings, cross_validation), ``measure``,
        ``score`` and ``shuffled`` with intervals, ``chance``, ``groups``. What is shuffled goes from cell to cell where states are held out, as with
        ``vibes-analyze probe --target``, since a column may be the distractors'.
    """
    held = {} if hold_out is None else by_name("hold_out", hold_out)
    read = quantities_of("quantities", quantities, held)
    if unknown := set(held) - set(read):
        raise _vibes.Error(f"hold_out names {sorted(unknown)}, which are no quantities")
    if checked_number(folds, "folds") < 2:
        raise _vibes.Error(f"{folds} folds; right is at least 2, since every trajectory is judged by a probe of the others")
    fitted = None if fit_on is None else fitted_on(fit_on, read, held)
    return table._native.probes(read, table._views, fitted, int(folds), checked_number(k, "k"), checked_seed(seed))


Quantities = dict[str, tuple[NDArray[np.float64], bool, str]]
"""By name what :func:`quantity` returns."""


def quantities_of(what: str, given: Any, held: Mapping[str, Any]) -> Quantities:
    """Quantities by name as the probes take them; ``held`` says what is held out together of single ones."""
    return {name: quantity(name, values, checked_name(held.get(name, "state"), f"hold_out of {name}")) for name, values in by_name(what, given).items()}


def fitted_on(fit_on: Any, read: Quantities, held: Mapping[str, Any]) -> tuple[_vibes.Table, Quantities, Any]:
    """A table to fit on and its quantities, in the order of those that are judged."""
    if not isinstance(fit_on, (tuple, list)) or len(fit_on) != 2 or not isinstance(fit_on[0], Table):
        raise _vibes.Error("fit_on that is no pair of a table and quantities; right is (another Table, the same quantities of it)")
    other, theirs = fit_on[0], quantities_of("the quantities of fit_on", fit_on[1], held)
    if set(theirs) != set(read):
        raise _vibes.Error(f"fit_on with the quantities {sorted(theirs)}; right is those that are judged, {sorted(read)}")
    for name, (_, is_class, _) in read.items():
        if theirs[name][1] != is_class:
            here, there = ("classes", "numbers") if is_class else ("numbers", "classes")
            right = "the same kind in both (floats are numbers, whole numbers and booleans classes)"
            raise _vibes.Error(f"{name} holds {here}, and {there} in fit_on; right is {right}")
    return other._native, {name: theirs[name] for name in read}, other._views


def by_name(what: str, given: Any) -> dict[str, Any]:
    """A dictionary whose names are text, or become text of which none is like another."""
    if not isinstance(given, Mapping):
        raise _vibes.Error(f"{what} of type {type(given).__name__}; right is a dictionary by the names of quantities")
    named = {str(name): value for name, value in given.items()}
    if len(named) != len(given):
        raise _vibes.Error(f"{what} {list(given)}, of which some have the same name; right is a name of its own for each")
    return named


def quantity(name: str, values: ArrayLike, hold_out: str) -> tuple[NDArray[np.float64], bool, str]:
    """A quantity as the probes take it: values, whether they are classes, what is held out together."""
    array = checked_array(name, values, "numbers or classes [rows]")
    is_class = array.dtype.kind in "iub"
    if array.ndim != 1 or array.dtype.kind not in "iubf":
        raise _vibes.Error(f"{name} of type {array.dtype} and shape {array.shape}; right is [rows], numbers or classes")
    if is_class and array.size and (int(array.min()) < 0 or int(array.max()) >= 2**32):
        raise _vibes.Error(f"{name} holds classes from {array.min()} to {array.max()}; classes are numbered from 0 to 2**32 - 1")
    return array.astype(np.float64), is_class, hold_out


def umap(
    table: Table,
    *,
    neighbours: int | None = None,
    min_dist: float = 0.1,
    spread: float = 1.0,
    epochs: int | None = None,
    metric: str = "euclidean",
    seed: int = 0,
) -> Numbers:
    """A map of the latents in which neighbours stay neighbours; the same for the same seed, whatever the number of threads.

    Args:
        table: the latents.
        neighbours: size of a neighbourhood, the point itself included; 15 unless given, or all rows of a smaller table.
        min_dist, spread: how close points may lie, and the scale of the map.
        epochs: rounds; 500, above 10,000 rows 200, unless given.
        metric: euclidean, as ``vibes-analyze umap`` has it unless told otherwise (:func:`neighbours` has standardized), standardized or cosine.
        seed: of start and layout.

    Returns:
        ``positions`` float32 ``[rows, 2]``, ``trustworthiness`` and ``kept`` (share of the neighbours that the map keeps; None of three rows or fewer).
    """
    rounds = None if epochs is None else checked_number(epochs, "epochs")
    size = None if neighbours is None else checked_number(neighbours, "neighbours")
    scales = (checked_real(min_dist, "min_dist"), checked_real(spread, "spread"))
    return table._native.umap(size, *scales, rounds, checked_name(metric, "metric"), checked_seed(seed))


def symmetry(
    table: Table, joints: ArrayLike, targets: ArrayLike, pixels: ArrayLike, *, tolerance: float = 0.02, pairs: int = 500, seed: int = 0
) -> Numbers:
    """Reacher: whether a latent is the same for a state and its rotation about the origin.

    Args:
        table: the latents.
        joints: angles of shoulder and wrist ``[rows, 2]``, radians: ``qpos``.
        targets: position of the goal ``[rows, 2]``, metres.
        pixels: the pictures ``[rows, …]``, to find rows that look as different.
        tolerance: most that two states may differ in the frame of the arm, metres.
        pairs: most pairs to compare.
        seed: of what is drawn.

    Returns:
        With intervals and ``chance``: ``symmetry_ratio`` (latent distance of rotated pairs over that of rows that look as different: 0 is symmetric, 1 is
        not), ``symmetry_percentile`` (share of the rows that look as different whose latents are farther away than the rotation's) and
        ``symmetry_percentile_equal_distance`` (the same among rows of equal distance to the target); and the ``pairs``.
    """
    images = np.atleast_1d(checked_array("pixels", pixels, "pictures [rows, …]", np.float32))
    pictures = images.reshape(len(images), int(np.prod(images.shape[1:])))
    states = [np.atleast_2d(checked_array(name, array, "numbers [rows, 2]", np.float64)) for name, array in [("joints", joints), ("targets", targets)]]
    if any(array.ndim != 2 for array in states):
        raise _vibes.Error(f"joints of shape {list(states[0].shape)} and targets of shape {list(states[1].shape)}; right is [rows, 2] of both")
    for name, array in [("joints", states[0]), ("targets", states[1]), ("pixels", pictures)]:
        checked_finite(name, array)
    words = (checked_real(tolerance, "tolerance"), checked_number(pairs, "pairs"), checked_seed(seed))
    return table._native.symmetry(states[0], states[1], pictures, *words)


def effective_rank(table: Table) -> Numbers:
    """How many dimensions the cloud of all rows of a table fills, on a grid or not: ``effective_rank`` and the total ``variance``, plain numbers without an interval.

    The ``effective_rank`` of :func:`grid_numbers`, which the programs print, is of the complete part of a grid (states and distractors with all their cells,
    over the steps that all of these have) and has an interval. Both agree, to rounding, where that part is all rows of the table.
    """
    return table._native.effective_rank()


def past_actions(actions: ArrayLike) -> NDArray[np.float32]:
    """The action-only control: what an encoder could know that sees nothing but past actions.

    Args:
        actions: one episode's, ``[T, action]``.

    Returns:
        Features of every row, ``[T + 1, features]``: the last eight actions, running averages with four memories, and the step.
    """
    array = checked_array("actions", actions, "numbers [T, action]", np.float32)
    if array.ndim != 2:
        raise _vibes.Error(f"actions of shape {array.shape}; right is [T, action]")
    return _vibes.past_actions(checked_finite("actions", array))


def past_actions_table(recording: Recording) -> Table:
    """The action-only control of every row of a recording."""
    checked_episodes(recording)
    return Table(np.concatenate([past_actions(episode.action) for episode in recording]), recording=recording)
