"""Writes behaviour.json: what an actor and a critic are made of, in float64 by numpy and PyTorch from the formulas alone.

usage: python make_behaviour.py behaviour.json      (needs numpy and torch)

The cases are those of train/tests/golden/make_losses.py that belong to this package, and λ-returns; all with seed 0.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

TRAIN = Path(__file__).resolve().parents[3] / "train/tests/golden"
CASES = ["tanh_normal", "bounded_normal", "two_hot_symexp", "return_scale", "imagination"]
HORIZON, ROWS, DISCOUNT, LAMBDA = 7, 3, 0.99, 0.95


def lambda_return(rng):
    reward, value = rng.randn(HORIZON, ROWS), rng.randn(HORIZON + 1, ROWS)
    returns, last = np.zeros((HORIZON, ROWS)), value[HORIZON]
    for t in reversed(range(HORIZON)):
        last = reward[t] + DISCOUNT * ((1 - LAMBDA) * value[t + 1] + LAMBDA * last)
        returns[t] = last
    return reward, value, returns


def main(path):
    sys.path.insert(0, str(TRAIN))
    import make_objective

    with tempfile.TemporaryDirectory() as folder:
        losses = Path(folder) / "losses.json"
        subprocess.run([sys.executable, TRAIN / "make_losses.py", "0", losses], check=True)
        whole = json.loads(losses.read_text())
    # The λ-return's numbers are drawn after those of the objective, from one generator.
    rng = np.random.RandomState(0)
    make_objective.objective(rng)
    reward, value, returns = lambda_return(rng)
    cases = {name: whole["cases"][name] for name in CASES}
    cases["lambda_return"] = {
        "about": "R_t = r_t + gamma * ((1 - lambda) * v_{t+1} + lambda * R_{t+1}), R_H = v_H, r_t = r(s_t, a_t); no termination",
        "in": {"gamma": DISCOUNT, "lambda": LAMBDA, "reward": reward.tolist(), "value": value.tolist()},
        "out": {"returns": returns.tolist()},
    }
    about = "the cases of the actor-critic: values and gradients in float64 by numpy and torch, from the formulas alone"
    made = {"format": whole["format"], "seed": 0, "made_by": whole["made_by"], "about": about, "cases": cases}
    Path(path).write_text(json.dumps(made))


if __name__ == "__main__":
    main(sys.argv[1])
