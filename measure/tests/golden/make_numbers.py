"""Golden numbers of the measures, from their definitions in NumPy (float64).

usage: python make_numbers.py        writes grid.json and neighbours.json beside itself; needs numpy

grid.json: latents of 3 states x 4 distractors x 6 steps x 5 dimensions, `retrieval_same_step@k`, `retrieval_any_step@k` and the variance shares.
neighbours.json: latents of 12 episodes x 25 steps x 8 dimensions, and the 5 nearest rows of other episodes of 20 queries.
"""
import itertools
import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent


def unit(x):
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def retrieval(latents, kind, k):
    """Share of rows with the same state among their k nearest; ties by row (state, distractor, step)."""
    flat = latents.reshape(-1, latents.shape[-1])
    standard = latents / flat.std(0)
    rows = list(itertools.product(*(range(n) for n in latents.shape[:3])))
    hits = 0
    for i, j, t in rows:
        if kind == "same":
            candidates = [(a, b, u) for a, b, u in rows if u == t and (a, b) != (i, j)]
        else:
            candidates = [(a, b, u) for a, b, u in rows if b != j]
        distance = [((standard[c] - standard[i, j, t]) ** 2).sum() for c in candidates]
        near = [candidates[c] for c in np.argsort(distance, kind="stable")[:k]]
        reach = 0 if kind == "same" else 2
        hits += any(a == i and abs(u - t) <= reach for a, _, u in near)
    return hits / len(rows)


def shares(latents):
    """The two-way split at each step, summed over steps and dimensions."""
    states, distractors = latents.shape[:2]
    mean = latents.mean((0, 1))
    total = ((latents - mean) ** 2).sum()
    state = distractors * ((latents.mean(1) - mean) ** 2).sum() / total
    distractor = states * ((latents.mean(0) - mean) ** 2).sum() / total
    return {"state": state, "distractor": distractor, "interaction": 1 - state - distractor}


def grid(rng, states=3, distractors=4, steps=6, dims=5):
    latents = 2 * rng.standard_normal((states, 1, steps, dims)) + 0.7 * rng.standard_normal((1, distractors, 1, dims))
    latents = latents + 0.6 * rng.standard_normal((states, distractors, steps, dims))
    latents = latents.astype(np.float32).astype(float)
    found = {f"retrieval_{kind}_step@{k}": retrieval(latents, kind, k) for kind in ("same", "any") for k in (1, 3)}
    found["chance_same_step@1"] = (distractors - 1) / (states * distractors - 1)
    return {"latents": latents.tolist(), "retrieval": found, "shares": shares(latents)}


def neighbours(rng, episodes=12, steps=25, dims=8, k=5):
    walks = [unit(np.cumsum(0.3 * rng.standard_normal((steps, dims)), 0) + rng.standard_normal(dims)) for _ in range(episodes)]
    latents = (np.concatenate(walks) * np.linspace(0.05, 4, dims)).astype(np.float32).astype(float)
    episode, step = np.repeat(np.arange(episodes), steps), np.tile(np.arange(steps), episodes)
    standard = latents / latents.std(0)
    queries = []
    for row in sorted(rng.choice(len(latents), 20, replace=False)):
        distance = np.sqrt(((standard - standard[row]) ** 2).sum(1))
        distance[episode == episode[row]] = np.inf
        near = np.argsort(distance, kind="stable")[:k]
        key = lambda at: [int(episode[at]), int(step[at])]
        queries.append({"query": key(row), "neighbours": [key(at) for at in near], "distance": distance[near].tolist()})
    return {"k": k, "episode": episode.tolist(), "step": step.tolist(), "latent": latents.tolist(), "queries": queries}


for name, make in [("grid", grid), ("neighbours", neighbours)]:
    (HERE / f"{name}.json").write_text(json.dumps(make(np.random.default_rng(0))) + "\n")
