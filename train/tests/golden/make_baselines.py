"""Oracles in float64 for what losses.json leaves out: multi-step inverse, DeepMDP, Huber critics, the cross-entropy search, CoRe, SAR. Needs numpy.

usage: python make_baselines.py SEED OUT.json
Gradients are central differences in float64, so that they depend on the values' formulas alone.
"""
import json, sys
import numpy as np

seed, out = int(sys.argv[1]), sys.argv[2]
random = np.random.RandomState(seed)
cases = {}


def gradient(loss, arguments, name, step=1e-6):
    """Central differences of `loss` with respect to the argument `name`."""
    found = np.zeros_like(arguments[name])
    for index in np.ndindex(found.shape):
        values = []
        for sign in (1, -1):
            moved = {key: np.array(value, dtype=float) for key, value in arguments.items()}
            moved[name][index] += sign * step
            values.append(loss(**moved))
        found[index] = (values[0] - values[1]) / (2 * step)
    return found


def case(name, loss, arguments, wrt):
    cases[name] = {
        "in": {key: value.tolist() for key, value in arguments.items()},
        "out": {"loss": float(loss(**arguments))},
        "grad": {key: gradient(loss, arguments, key).tolist() for key in wrt},
    }


huber = lambda e: np.where(np.abs(e) < 1, 0.5 * e**2, np.abs(e) - 0.5)
rows, dims, width = 6, 5, 3
normal = lambda *shape: random.randn(*shape)
case("inverse", lambda prediction, action: (0.5 * ((prediction - action) ** 2).sum(-1)).mean(), dict(prediction=normal(rows, width), action=normal(rows, width)), ["prediction"])
case(
    "transition",
    lambda mean, std, next, prediction, reward: (0.5 * ((next - mean) / std) ** 2 + np.log(std)).mean() + ((prediction - reward) ** 2).mean(),
    dict(mean=normal(rows, dims), std=np.abs(normal(rows, dims)) + 0.3, next=normal(rows, dims), prediction=normal(rows), reward=normal(rows)),
    ["mean", "std", "prediction"],
)
case("huber_critic", lambda q1, q2, y: huber(q1 - y).mean() + huber(q2 - y).mean(), dict(q1=normal(rows) * 2, q2=normal(rows) * 2, y=normal(rows)), ["q1", "q2"])

# The cross-entropy search on a quadratic value with a known best action, one for every row.
iterations, samples, elites = 3, 8, 3
noise, best_action = normal(iterations, rows * samples, width), random.uniform(-1, 1, (rows, width))
value = lambda a: -((a - np.repeat(best_action, samples, 0)) ** 2).sum(-1)
mean, std = np.zeros((rows, 1, width)), np.ones((rows, 1, width))
highest, chosen = np.full(rows, -np.inf), np.zeros((rows, width))
for draw in noise:
    actions = np.clip(mean + std * draw.reshape(rows, samples, width), -1, 1)
    values = value(actions.reshape(-1, width)).reshape(rows, samples)
    order = np.argsort(-values, 1)[:, :elites]
    kept = np.take_along_axis(actions, order[..., None], 1)
    mean, std = kept.mean(1, keepdims=True), kept.std(1, keepdims=True)
    wins = values.max(1) > highest
    highest = np.where(wins, values.max(1), highest)
    chosen[wins] = kept[wins, 0]
cases["cross_entropy"] = {"in": {"noise": noise.tolist(), "best_action": best_action.tolist(), "samples": samples, "elites": elites}, "out": {"actions": chosen.tolist()}}

# CoRe's losses beside the critics' (apple/ml-core), weights 1, 1, 1, .01: contrast of next features, smooth L1 of rewards, inverse dynamics, divergence above a free nat.
def core(expected, features, sharpness, reward_prediction, reward, action_prediction, action, mean, std, prior_mean, prior_std):
    logits = np.log1p(np.exp(sharpness)) * (expected / np.sqrt(features.shape[1])) @ features.T
    log_softmax = lambda x: x - x.max(1, keepdims=True) - np.log(np.exp(x - x.max(1, keepdims=True)).sum(1, keepdims=True))
    contrast = -0.5 * (np.diag(log_softmax(logits)).mean() + np.diag(log_softmax(logits.T)).mean())
    inverse = (0.5 * ((np.tanh(action_prediction) - action) ** 2).sum(-1)).mean()
    divergence = (np.log(prior_std / std) + (std**2 + (mean - prior_mean) ** 2) / (2 * prior_std**2) - 0.5).sum(-1).mean()
    return contrast + huber(reward_prediction - reward).mean() + inverse + 0.01 * max(divergence, 1.0)


case(
    "core",
    core,
    dict(
        expected=normal(rows, 8), features=normal(rows, 8), sharpness=np.array(1.0), reward_prediction=normal(rows) * 2, reward=normal(rows), action_prediction=normal(rows, width),
        action=random.uniform(-1, 1, (rows, width)), mean=normal(rows, dims), std=np.array(0.1), prior_mean=normal(rows, dims), prior_std=np.abs(normal(rows, 1)) + 0.3,
    ),
    ["expected", "features", "sharpness", "reward_prediction", "action_prediction", "mean", "prior_mean", "prior_std"],
)

# SAR's head and loss (DMU-XMU/SAR): two views of three rows, two next actions and rewards, frequencies from learned moments, three heads of which the best two count. Written row by row,
# head by head, where the code makes one product.
views, steps, samples, heads, best, hidden = 2, 2, 4, 3, 2, 6
batch = rows // views


def sar(features, actions, rewards, noise, center, spread, g, g_bias, r, r_bias, f, f_bias, w1, b1, w2, b2, w3, b3):
    omega = center + noise * np.exp(-6 + 8 * np.tanh(spread))
    silu = lambda x: x / (1 + np.exp(-x))
    expected, own = np.zeros((heads, samples, rows, 2)), np.zeros((samples, rows, 2))
    for s in range(samples):
        for row in range(rows):
            of_batch = row % batch
            phase = omega[s] @ (actions[of_batch] @ g + g_bias)
            own[s, row] = np.pi / 2 * np.cos(phase), np.pi / 2 * np.sin(phase)
            seen = np.concatenate([features[row], rewards[of_batch] @ r + r_bias, omega[s] @ f + f_bias])
            out = silu(silu(seen @ w1 + b1) @ w2 + b2) @ w3 + b3
            expected[:, s, row, 0], expected[:, s, row, 1] = out[:heads], out[heads:]
    squared = ((expected - own) ** 2).sum(-1).mean((1, 2))
    vectors = lambda waves: np.stack([waves[:, i].T.reshape(-1) for i in range(batch)])
    unit = lambda x: x / np.linalg.norm(x, axis=-1, keepdims=True)
    entropies = np.zeros(heads)
    for head in range(heads):
        logits = unit(vectors(expected[head])) @ unit(vectors(own)).T / 0.1
        entropies[head] = -np.mean([logits[i, i] - np.log(np.exp(logits[i]).sum()) for i in range(batch)])
    return np.sort(squared)[:best].sum() * views + np.sort(entropies)[:best].sum()


case(
    "sar",
    sar,
    dict(
        features=normal(rows, dims), actions=random.uniform(-1, 1, (batch, steps * width)), rewards=random.uniform(0, 1, (batch, steps)), noise=normal(samples, steps), center=normal(steps) * 0.3,
        spread=np.arctanh(0.75) + normal(steps) * 0.05, g=normal(steps * width, steps) * 0.5, g_bias=normal(steps) * 0.3, r=normal(steps, steps) * 0.5, r_bias=normal(steps) * 0.3, f=normal(steps, steps) * 0.5, f_bias=normal(steps) * 0.3,
        w1=normal(dims + 2 * steps, hidden) * 0.3, b1=normal(hidden) * 0.3, w2=normal(hidden, hidden) * 0.3, b2=normal(hidden) * 0.3, w3=normal(hidden, 2 * heads) * 0.5, b3=normal(2 * heads) * 0.3,
    ),
    ["features", "center", "spread", "g", "g_bias", "r", "r_bias", "f", "f_bias", "w1", "b1", "w2", "b2", "w3", "b3"],
)
cases["sar"]["in"].update(views=views, best=best)

json.dump({"format": "vibes-golden-baselines/1", "seed": seed, "made_by": "make_baselines.py (numpy, float64)", "cases": cases}, open(out, "w"))
