"""Writes `vibes-trace/1` files with dm_control: `python make_traces.py OUT_FOLDER` (dm-control 1.0.50, mujoco 3.17.0, numpy).

Each trace is one episode from the task's own random start, with uniform random actions held for ten control steps, so that joints travel far.
"""

import json
import sys
from pathlib import Path

import mujoco
import numpy as np
from dm_control import suite
from dm_control.suite import swimmer

# Name, environment, control steps, what the episode changes in the model: (field, object).
TASKS = [
    ("cheetah-run", lambda seed: suite.load("cheetah", "run", {"random": seed}), 200, []),
    (
        "finger-spin",
        lambda seed: suite.load("finger", "spin", {"random": seed}),
        200,
        [("site_rgba", "target"), ("site_rgba", "tip"), ("dof_damping", "hinge")],
    ),
    ("swimmer-6", lambda seed: suite.load("swimmer", "swimmer6", {"random": seed}), 100, [("geom_pos", "target"), ("light_pos", "target_light")]),
    ("swimmer-15", lambda seed: swimmer.swimmer(15, random=seed), 40, [("geom_pos", "target"), ("light_pos", "target_light")]),
]


def state(env):
    return env.physics.data.qpos.tolist()


def trace(name, make, steps, changed, seed):
    env = make(seed)
    first = env.reset()
    physics, spec = env.physics, env.action_spec()
    overrides = {}
    for field, obj in changed:
        value = getattr(physics.named.model, field)[obj]
        overrides.setdefault(field, {})[obj] = np.atleast_1d(np.asarray(value, float)).tolist()
    out = dict(
        format="vibes-trace/1",
        task=name,
        seed=seed,
        versions=dict(mujoco=mujoco.__version__, dm_control="1.0.50"),
        control_timestep=env.control_timestep(),
        physics_timestep=physics.timestep(),
        step_limit=float(env._step_limit),
        action_min=spec.minimum.tolist(),
        action_max=spec.maximum.tolist(),
        time=float(physics.data.time),
        qpos=state(env),
        qvel=physics.data.qvel.tolist(),
        act=physics.data.act.tolist(),
        model_overrides=overrides,
        observation_names=list(first.observation),
        actions=[],
        rewards=[],
        observations=[],
        qpos_trace=[state(env)],
    )
    flat = lambda step: np.concatenate([np.ravel(part) for part in step.observation.values()]).tolist()
    out["observations"].append(flat(first))
    rng = np.random.RandomState(1000 + seed)
    for t in range(steps):
        if t % 10 == 0:
            action = rng.uniform(spec.minimum, spec.maximum)
        step = env.step(action)
        out["actions"].append(action.tolist())
        out["rewards"].append(float(step.reward))
        out["observations"].append(flat(step))
        out["qpos_trace"].append(state(env))
    return out


def main():
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, make, steps, changed in TASKS:
        seed = 0
        (folder / f"{name}-{seed}.json").write_text(json.dumps(trace(name, make, steps, changed, seed)))


if __name__ == "__main__":
    main()
