"""``vibes.make``, ``make_dm`` and ``make_vec``: the environments as Gymnasium and dm_env expect them, imported only when they are asked for."""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from . import _vibes

if TYPE_CHECKING:
    from .dm import DmEnvironment
    from .environment import Environment
    from .vector import VectorEnvironment


def tasks() -> list[str]:
    """The names of the tasks; swimmer-N stands for 3 to 496 links, the most that MuJoCo can load."""
    return _vibes.task_names()


def make(
    task: str = "reacher-easy",
    *,
    difficulty: str = "easy",
    dynamic: bool = True,
    distract: str | Iterable[str] | None = ("background", "camera", "color"),
    videos: str | os.PathLike[str] | None = None,
    video_set: str = "train",
    video_count: int | None = None,
    size: int | None = 64,
    action_repeat: int | None = None,
    render: str = "fast",
    seed: int = 0,
    observation: str = "pixels",
    render_mode: str | None = None,
    raw_torques: bool = False,
    background_seed: int | None = None,
    camera_seed: int | None = None,
    color_seed: int | None = None,
) -> Environment:
    """A task under distractors as a Gymnasium environment. Its episodes are those that ``vibes-collect --seed SEED`` records.

    Args:
        task: one of :func:`vibes.tasks`, as reacher-easy or swimmer-6.
        difficulty: how far the distractors go: easy, medium or hard, as in the Distracting Control Suite.
        dynamic: whether they move during an episode.
        distract: which of background, camera and color; "all" or "none" as well.
        videos: folder of background videos, ``DIR/VIDEO/FRAME.jpg`` as in DAVIS; procedural ones unless given.
        video_set: train, or val for the held-out ones.
        video_count: how many of them; the suite's number for the difficulty unless given (4, 8, all).
        size: height and width of the pictures in pixels.
        action_repeat: control steps an action is held; the task's own number unless given.
        render: fast, or suite for pixels as the Distracting Control Suite's own.
        seed: of the recording whose episodes are played, one after the other.
        observation: pixels (uint8 ``[size, size, 3]``), state (float32, the task's vector in dm_control's order), or both (a dictionary of the two).
            With state nothing is drawn and no EGL is needed.
        render_mode: "rgb_array" lets ``render`` return the picture.
        raw_torques: one torque per joint of the swimmer instead of its four-parameter wave.
        background_seed, camera_seed, color_seed: of single axes, instead of ``seed``.

    Raises:
        vibes.Error: a name that is not known, a number out of range, videos that cannot be read, a machine that cannot draw.
        ImportError: Gymnasium is not installed.
    """
    options = {name: value for name, value in locals().items() if name != "task"}
    return _environment().Environment(task, **options)


def make_vec(task: str = "reacher-easy", num_envs: int = 8, *, threads: int | None = None, **options: Any) -> VectorEnvironment:
    """``num_envs`` environments as a Gymnasium vector environment, simulated and drawn on all cores by threads of the library's own.

    Environment ``i`` plays the episodes ``i``, ``i + num_envs``, … of the recording of ``seed``. The interpreter's lock is released while they work.

    Args:
        task: as in :func:`make`.
        num_envs: how many.
        threads: how many threads; one per core unless given, and none for one environment, which works on the thread that calls.
        options: as in :func:`make`.
    """
    _environment()
    from .vector import VectorEnvironment

    return VectorEnvironment(task, num_envs, threads=threads, **options)


def make_dm(task: str = "reacher-easy", *, observation: str = "pixels", **options: Any) -> DmEnvironment:
    """A task under distractors as a dm_env environment.

    Args:
        task: as in :func:`make`.
        observation: pixels, state (the task's own parts by dm_control's names), or both.
        options: as in :func:`make`, without ``render_mode``.

    Raises:
        ImportError: dm_env is not installed.
    """
    try:
        from . import dm
    except ModuleNotFoundError as error:
        raise ImportError(f"make_dm needs dm_env; pip install dm-env ({error})") from error
    return dm.DmEnvironment(task, observation=observation, **options)


def _environment() -> Any:
    try:
        from . import environment
    except ModuleNotFoundError as error:
        raise ImportError(f"make and make_vec need Gymnasium; pip install gymnasium ({error})") from error
    return environment
