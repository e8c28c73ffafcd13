"""Writes objective.json: the VIBES objective, its clipping and its gradients, in float64 by PyTorch's automatic differentiation.

usage: python make_objective.py objective.json      (needs numpy and torch)
"""

import json
import sys

import numpy as np
import torch

STEPS, BATCH, LATENT = 6, 4, 5


def unit(x):
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def log_density(x, mean, std):
    return -0.5 * ((x - mean) / std) ** 2 - torch.log(std) - 0.5 * np.log(2 * np.pi)


def objective(rng):
    shape = (STEPS, BATCH, LATENT)
    inputs = {
        "s": unit(rng.randn(*shape)) + 0.1 * rng.randn(*shape),
        "dyn_mean": unit(rng.randn(*shape)),
        "dyn_std": 0.2 + rng.rand(STEPS, BATCH, 1),
        "adv_mean": unit(rng.randn(*shape)),
        "adv_std": 0.2 + rng.rand(STEPS, BATCH, 1),
        "r": rng.randn(STEPS, BATCH),
        "r_mean": rng.randn(STEPS, BATCH),
        "r_std": 0.3 + rng.rand(STEPS, BATCH),
    }
    t = {name: torch.tensor(value, dtype=torch.float64, requires_grad=True) for name, value in inputs.items()}
    dynamics = log_density(t["s"], t["dyn_mean"], t["dyn_std"])
    # Per step and dimension, summed over the batch, then clipped.
    ratio = (dynamics - log_density(t["s"], t["adv_mean"], t["adv_std"])).sum(1)
    clipped = torch.clamp(ratio, max=0.0)
    reward = log_density(t["r"], t["r_mean"], t["r_std"])
    rows = STEPS * BATCH
    model = (clipped.sum() + reward.sum()) / rows
    adversary = log_density(t["s"].detach(), t["adv_mean"], t["adv_std"]).sum(-1).mean()
    without = (dynamics.sum() + reward.sum()) / rows
    of_model = ["s", "dyn_mean", "dyn_std", "r_mean", "r_std"]
    of_adversary = ["adv_mean", "adv_std"]
    model_gradient = torch.autograd.grad(model, [t[name] for name in of_model], retain_graph=True)
    adversary_gradient = torch.autograd.grad(adversary, [t[name] for name in of_adversary])
    return {
        "about": "shapes [T, B, D], isotropic std [T, B, 1]; L is maximised over theta and phi with psi held fixed, J over psi with s held fixed; "
        "the log-ratio is summed over the batch per (t, i) and then clipped to be non-positive",
        "inputs": {name: value.tolist() for name, value in inputs.items()},
        "log_ratio": ratio.tolist(),
        "clipped_share": float((ratio > 0).double().mean()),
        "L": model.item(),
        "J": adversary.item(),
        "L_without_adversary": without.item(),
        "grad_L": {name: gradient.tolist() for name, gradient in zip(of_model, model_gradient)},
        "grad_J": {name: gradient.tolist() for name, gradient in zip(of_adversary, adversary_gradient)},
    }


if __name__ == "__main__":
    with open(sys.argv[1], "w") as file:
        json.dump(objective(np.random.RandomState(0)), file)
