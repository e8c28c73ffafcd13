"""Gymnasium's ids: ``gymnasium.make("vibes/reacher-easy-v0")`` after ``import vibes``, or ``gymnasium.make("vibes:vibes/reacher-easy-v0")``."""

from __future__ import annotations

import importlib.util

from . import _vibes


def register() -> None:
    """Registers the example tasks with Gymnasium, where it is installed. Episodes end by the environment's own clock."""
    if importlib.util.find_spec("gymnasium") is None:
        return
    from gymnasium.envs.registration import register as add

    for task in _vibes.example_tasks():
        add(
            f"vibes/{task}-v0",
            entry_point="vibes.environment:Environment",
            vector_entry_point="vibes.vector:VectorEnvironment",
            kwargs={"task": task},
        )
