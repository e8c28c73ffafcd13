"""Gymnasium's ids: ``gymnasium.make("vibes/reacher-easy-v0")`` after ``import vibes``, or ``gymnasium.make("vibes:vibes/reacher-easy-v0")``."""

from __future__ import annotations

import importlib.util

TASKS = (
    "ball_in_cup-catch",
    "cartpole-swingup",
    "cheetah-run",
    "finger-spin",
    "reacher-easy",
    "swimmer-6",
    "swimmer-15",
    "swimmer-100",
    "walker-walk",
)


def register() -> None:
    """Registers every task with Gymnasium, where it is installed. Episodes end by the environment's own clock."""
    if importlib.util.find_spec("gymnasium") is None:
        return
    from gymnasium.envs.registration import register as add

    for task in TASKS:
        add(
            f"vibes/{task}-v0",
            entry_point="vibes.environment:Environment",
            vector_entry_point="vibes.vector:VectorEnvironment",
            kwargs={"task": task},
        )
