"""The environments themselves, with numpy alone: any number of them behind one object, drawn on all cores without Python processes.

In: what to show (:class:`World`), actions ``[environments, action]``. Out: rows as dictionaries of arrays. ``make``, ``make_dm`` and ``make_vec`` dress
a world as what Gymnasium and dm_env expect.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _vibes
from .checks import checked_axes, checked_choice, checked_flag, checked_name, checked_number, checked_seed, checked_shape, checked_whole

if TYPE_CHECKING:
    from .writer import Writer

Rows = dict[str, NDArray[Any]]
"""A row of every environment: ``pixels`` uint8 ``[environments, size, size, 3]``, ``state`` float32 ``[environments, observation]``, ``reward``
float64 ``[environments]`` (summed over the action repeat), ``is_last`` bool ``[environments]``."""

EpisodeKey = tuple[int, int, int]
"""Which episode: the recording's seed, its state trajectory, its distractor trajectory."""


@dataclass(frozen=True)
class Course:
    """Which episodes come next: for every environment the seed of its recording, the number of its next episode, and by how many it goes on from there.

    Never changed but replaced, so that a call that is refused leaves the course that was there before.
    """

    seed: int
    """The world's own."""
    seeds: tuple[int, ...]
    numbers: tuple[int, ...]
    strides: tuple[int, ...]

    @staticmethod
    def of(seed: int, numbers: Sequence[int]) -> Course:
        """All environments share out the episodes of one recording."""
        count = len(numbers)
        return Course(seed, (seed,) * count, tuple(numbers), (count,) * count)

    def with_own(self, first: int, seeds: Sequence[int | None]) -> Course:
        """Environments that are given a seed go through a recording of their own from its episode ``first`` on; the others go on as they are."""
        given = [seed is not None for seed in seeds]
        return Course(
            self.seed,
            tuple(old if seed is None else seed for old, seed in zip(self.seeds, seeds)),
            tuple(first if own else old for old, own in zip(self.numbers, given)),
            tuple(1 if own else old for old, own in zip(self.strides, given)),
        )

    def ahead(self, chosen: NDArray[np.bool_]) -> tuple[list[EpisodeKey | None], Course]:
        """The next episodes of the chosen environments, and the course once they have begun."""
        now = zip(self.seeds, self.numbers, chosen)
        keys = [(seed, checked_number(number, "the episode"), number) if begins else None for seed, number, begins in now]
        moved = zip(self.numbers, self.strides, chosen)
        return keys, Course(self.seed, self.seeds, tuple(number + stride * int(begins) for number, stride, begins in moved), self.strides)


class World:
    """Environments of one task under distractors, each on its own episode.

    Environment ``i`` of ``n`` plays the episodes ``i``, ``i + n``, ``i + 2 n``, … of a recording of this seed: the same starts, distractors, rewards and
    pictures that ``vibes-collect --seed SEED`` records, given the same actions.

    Args:
        task: one of :func:`vibes.tasks`, as reacher-easy or swimmer-6.
        environments: how many.
        threads: threads of its own that simulate and draw. Unless given one per core, and none for one environment, which works on the thread that
            calls.
        difficulty: how far the distractors go: easy, medium or hard, as in the Distracting Control Suite.
        dynamic: whether they move during an episode.
        distract: which of background, camera and color; "all" or "none" as well.
        videos: folder of background videos, ``DIR/VIDEO/FRAME.jpg`` as in DAVIS; procedural ones unless given.
        video_set: train or val.
        video_count: how many of them; the suite's number for the difficulty unless given (4, 8, all).
        size: side of the pictures in pixels; None draws none and asks for no EGL.
        action_repeat: control steps an action is held; the task's own number unless given.
        render: fast, or suite for pixels as the Distracting Control Suite's own.
        raw_torques: one torque per joint of the swimmer instead of its four-parameter wave.
        seed: of the recording whose episodes are played.
        background_seed, camera_seed, color_seed: of single axes, instead of ``seed``.

    Raises:
        vibes.Error: a name that is not known, a number out of range, videos that cannot be read, a machine that cannot draw.
    """

    def __init__(
        self,
        task: str = "reacher-easy",
        *,
        environments: int = 1,
        threads: int | None = None,
        difficulty: str = "easy",
        dynamic: bool = True,
        distract: str | Iterable[str] | None = ("background", "camera", "color"),
        videos: str | os.PathLike[str] | None = None,
        video_set: str = "train",
        video_count: int | None = None,
        size: int | None = 64,
        action_repeat: int | None = None,
        render: str = "fast",
        raw_torques: bool = False,
        seed: int = 0,
        background_seed: int | None = None,
        camera_seed: int | None = None,
        color_seed: int | None = None,
    ) -> None:
        if size is not None:
            load_triton_first()
        axes = {"background": background_seed, "camera": camera_seed, "color": color_seed}
        environments = checked_whole(environments, "environments")
        options = {
            "task": checked_name(task, "task"),
            "difficulty": checked_name(difficulty, "difficulty"),
            "dynamic": checked_flag(dynamic, "dynamic"),
            "distract": checked_axes(distract),
            "videos": None if videos is None else os.fspath(videos),
            "video_set": checked_name(video_set, "video_set"),
            "video_count": None if video_count is None else checked_whole(video_count, "video_count"),
            "size": None if size is None else checked_whole(size, "size"),
            "action_repeat": None if action_repeat is None else checked_whole(action_repeat, "action_repeat"),
            "render": checked_name(render, "render"),
            "raw_torques": checked_flag(raw_torques, "raw_torques"),
            "axis_seeds": {name: checked_seed(value, f"{name}_seed") for name, value in axes.items() if value is not None},
        }
        own_seed = checked_seed(seed)
        self._native = _vibes.World(options, environments, None if threads is None else checked_whole(threads, "threads"))
        self._environments = environments
        self._begun = np.full(environments, -1, np.int64)
        self._course = Course.of(own_seed, range(environments))
        self.spec: dict[str, Any] = self._native.spec()
        """The shape of a row: task, ``action`` bounds, parts of the ``observation``, ``control_timestep`` in seconds, ``action_repeat``."""

    @property
    def seed(self) -> int:
        """The world's own: of the recording that its environments share out; ``seek`` goes to another. Environments that were given seeds of their own do not
        play it."""
        return self._course.seed

    @property
    def environments(self) -> int:
        """How many environments."""
        return self._environments

    @property
    def threads(self) -> int:
        """How many threads of its own simulate and draw; 0 where the thread that calls does."""
        return self._native.threads

    @property
    def episode_steps(self) -> int:
        """Agent steps of a whole episode: 1000 control steps."""
        return self._native.episode_steps

    @property
    def videos(self) -> list[dict[str, Any]]:
        """The background videos in use: name, set, number of frames."""
        return self._native.videos()

    @property
    def episodes(self) -> NDArray[np.int64]:
        """The number of each environment's episode, ``[environments]``; -1 before the first."""
        return self._begun.copy()

    @property
    def action_bounds(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest action, ``[action]`` each, in the task's own units."""
        action = self.spec["action"]
        return np.asarray(action["min"], np.float32), np.asarray(action["max"], np.float32)

    @property
    def action_size(self) -> int:
        """Numbers in an action."""
        return len(self.spec["action"]["min"])

    @property
    def state_size(self) -> int:
        """Numbers in the vector observation."""
        return sum(part["len"] for part in self.spec["observation"])

    def seek(self, first: int = 0, *, seed: int | Sequence[int | None] | None = None) -> None:
        """The next ``reset`` begins with episode ``first`` (environment ``i`` with ``first + i``), of a recording of ``seed`` if it is given.

        Args:
            first: the episode.
            seed: of the recording; the world's own unless given. Or one for each environment, which then plays ``first``, ``first + 1``, … of a
                recording of that seed by itself; where it is None an environment goes on as it is.
        """
        first = checked_number(first, "first")
        if isinstance(seed, Iterable) and not isinstance(seed, (str, bytes)) and np.ndim(seed) > 0:
            seeds = [None if value is None else checked_seed(value) for value in seed]
            if len(seeds) != self._environments:
                raise _vibes.Error(f"{len(seeds)} seeds for {self._environments} environments; give one seed, or one for each")
            self._course = self._course.with_own(first, seeds)
        else:
            following = [checked_number(first + i, "the episode") for i in range(self._environments)]
            self._course = Course.of(self.seed if seed is None else checked_seed(seed), following)

    def reset(self, which: Sequence[bool] | NDArray[np.bool_] | None = None, *, draw: bool = True) -> Rows:
        """Begins the next episode of every environment, or of those of ``which`` ``[environments]``.

        Args:
            which: the environments; all unless given.
            draw: whether pictures are drawn; without, the rows have no ``pixels``.
        """
        keys, course = self._course.ahead(checked_choice("which", which, self._environments))
        rows = self._native.reset(keys, checked_flag(draw, "draw"))
        self._have_begun(keys, course)
        return rows

    def reset_to(self, keys: Sequence[EpisodeKey | None], *, draw: bool = True) -> Rows:
        """Begins given episodes, one of (seed, state trajectory, distractor trajectory) for every environment, or None for those that go on.

        Raises:
            vibes.Error: keys that are no such numbers, or of more or fewer environments; an episode that the recording being written has already. All
                environments stay where they are then.
        """
        try:
            asked = list(keys)
        except TypeError:
            asked = []
        if len(asked) != self._environments:
            right = f"one of (seed, state trajectory, distractor trajectory), or None, for each of the {self._environments} environments"
            raise _vibes.Error(f"keys {keys!r}; right is {right}")
        checked = [None if key is None else checked_key(key) for key in asked]
        rows = self._native.reset(checked, checked_flag(draw, "draw"))
        self._have_begun(checked, self._course)
        return rows

    def step(self, actions: ArrayLike, reset: NDArray[np.bool_] | None = None, *, draw: bool = True) -> Rows:
        """One agent step of every environment.

        Args:
            actions: ``[environments, action]``; they are executed in single precision, as a recording keeps them.
            reset: environments ``[environments]`` that begin their next episode instead; their action is not looked at, their reward is 0.
            draw: whether pictures are drawn.

        Raises:
            vibes.Error: an action that is not finite or of another shape, an episode that is over or has not begun; all environments stay where they are
                then. An unstable simulation; its environment has to be reset then, and the others have made their step.
        """
        numbers = checked_shape("actions", actions, (self._environments, self.action_size))
        chosen = None if reset is None else checked_choice("reset", reset, self._environments)
        if chosen is None or not chosen.any():
            return self._native.step(numbers, None, checked_flag(draw, "draw"))
        keys, course = self._course.ahead(chosen)
        rows = self._native.step(numbers, keys, checked_flag(draw, "draw"))
        self._have_begun(keys, course)
        return rows

    def pictures(self) -> NDArray[np.uint8] | None:
        """The present pictures, ``[environments, size, size, 3]``; None of a world without pictures."""
        return self._native.pictures()

    def keep(self, writer: Writer | None, *, acts_by_pictures: bool | None = None) -> None:
        """Keeps every episode that begins from now on and is played to its end in ``writer``'s recording; None stops that.

        Args:
            writer: of this world, or None.
            acts_by_pictures: whether actions are chosen by what the distractor trajectory of the state trajectory's own number shows; the recording
                then names it as its acting distractor. Unless given it is so where the writer's environment observes pictures and its recording is no
                grid: an episode then has one number for both.
        """
        acts = None if acts_by_pictures is None else checked_flag(acts_by_pictures, "acts_by_pictures")
        if writer is None:
            if acts is not None:
                raise _vibes.Error("acts_by_pictures without a writer; right is with one, since its recording names what acted")
            self._native.stop_keeping()
            return
        native = getattr(writer, "_native", None)
        if not isinstance(native, _vibes.Writer):
            raise _vibes.Error(f"writer {writer!r}; right is a vibes.Writer, or None")
        if writer._world is not self:
            raise _vibes.Error(f"a writer that was not made with this world; right is vibes.Writer(path, world): {writer.path}")
        native.keep(self._native, writer._sees_pictures if acts is None else acts)

    def close(self) -> None:
        """Ends the threads and frees their memory; using the world afterwards raises."""
        self._native.close()

    @contextlib.contextmanager
    def _unless_refused(self) -> Iterator[None]:
        """Keeps to the course from before where what is done inside is refused."""
        before = self._course
        try:
            yield
        except BaseException:
            self._course = before
            raise

    def _have_begun(self, keys: Sequence[EpisodeKey | None], course: Course) -> None:
        self._course = course
        for i, key in enumerate(keys):
            if key is not None:
                self._begun[i] = key[1]


def load_triton_first() -> None:
    """Loads Triton, where it is installed, before anything is drawn.

    Mesa's software renderer shows its LLVM to every library that is loaded later. Triton, which PyTorch loads at some later moment of its own choice,
    has an LLVM inside, calls Mesa's instead and ends the process. Loaded first, it keeps to its own.
    """
    if "triton" not in sys.modules and importlib.util.find_spec("triton") is not None:
        with contextlib.suppress(Exception):
            importlib.import_module("triton")


KINDS = ("pixels", "state", "both")


def open_world(task: str, observation: str, render_mode: str | None, *, environments: int, **options: Any) -> World:
    """A world that draws only where somebody looks.

    How many environments it has whoever dresses it says, and no caller among the options: Python refuses it there.
    """
    if checked_name(observation, "observation") not in KINDS:
        raise _vibes.Error(f"unknown observation {observation!r}; known are {', '.join(KINDS)}")
    if render_mode is not None and not (isinstance(render_mode, str) and render_mode == "rgb_array"):
        raise _vibes.Error(f"unknown render_mode {render_mode!r}; known are None, rgb_array")
    if observation == "state" and render_mode is None:
        options = options | {"size": None}
    world = World(task, environments=environments, **options)
    if observation != "state" and world.spec["pixels"] is None:
        raise _vibes.Error(f"size None with observation {observation!r}; pictures have a size, or choose observation='state'")
    return world


def checked_key(key: Any) -> EpisodeKey:
    """Which episode of which recording, or what would say it."""
    try:
        seed, state, distractor = key
    except (TypeError, ValueError):
        raise _vibes.Error(f"the key {key!r} of an episode; right is (seed, state trajectory, distractor trajectory)") from None
    return checked_seed(seed), checked_number(state, "the state trajectory"), checked_number(distractor, "the distractor trajectory")
