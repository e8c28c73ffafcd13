"""Writes the distribution of dm_control's initial observations: `python make_starts.py starts.json` (dm-control 1.0.50, mujoco 3.17.0, numpy).

For every task: how many resets, and the nine deciles of every number of the first observation.
"""

import json
import sys
from pathlib import Path

import numpy as np
from dm_control import suite

RESETS = 4000
TASKS = {
    "ball_in_cup-catch": ("ball_in_cup", "catch"),
    "cartpole-swingup": ("cartpole", "swingup"),
    "cheetah-run": ("cheetah", "run"),
    "finger-spin": ("finger", "spin"),
    "reacher-easy": ("reacher", "easy"),
    "swimmer-6": ("swimmer", "swimmer6"),
    "walker-walk": ("walker", "walk"),
}


def deciles(domain, task):
    env = suite.load(domain, task, {"random": 0})
    rows = [np.concatenate([np.ravel(part) for part in env.reset().observation.values()]) for _ in range(RESETS)]
    return np.quantile(np.array(rows), np.arange(1, 10) / 10, axis=0).T.tolist()


if __name__ == "__main__":
    out = {name: {"resets": RESETS, "deciles": deciles(*load)} for name, load in TASKS.items()}
    Path(sys.argv[1]).write_text(json.dumps(out))
