"""Physics traces from dm_control itself: the oracle for our task ports.

usage: python make_physics.py physics ball_in_cup-catch:0 cartpole-swingup:0 reacher-easy:0 reacher-easy:1 walker-walk:0
Needs: mujoco==3.17.0 dm-control==1.0.50
"""
import json, os, sys
import numpy as np
import mujoco
from dm_control import suite
from dm_control.suite import swimmer

FIELDS = {  # model fields a task may randomise, with the object kind that names their rows
    "geom_pos": "geom", "geom_size": "geom", "geom_rgba": "geom", "light_pos": "light",
    "site_pos": "site", "site_size": "site", "site_rgba": "site", "body_pos": "body",
    "dof_damping": "joint", "mat_rgba": "material",
}

def load(name, seed):
    if name == "swimmer-100":
        return swimmer.swimmer(n_links=100, random=seed)
    domain, task = name.rsplit("-", 1)
    return suite.load(domain, task, task_kwargs={"random": seed})

def names(model, kind, n):
    t = getattr(mujoco.mjtObj, "mjOBJ_" + kind.upper())
    return [mujoco.mj_id2name(model, t, i) for i in range(n)]

def overrides(before, after):
    out = {}
    for f, kind in FIELDS.items():
        a, b = before[f], np.asarray(getattr(after, f))
        if f == "dof_damping":
            rows = {}
            for j in range(after.njnt):
                d = after.jnt_dofadr[j]
                if a[d] != b[d]:
                    rows[mujoco.mj_id2name(after, mujoco.mjtObj.mjOBJ_JOINT, j)] = [float(b[d])]
        else:
            ns = names(after, kind, len(b))
            rows = {ns[i]: np.atleast_1d(b[i]).tolist() for i in range(len(b)) if not np.array_equal(a[i], b[i])}
        if rows:
            out[f] = rows
    return out

def trace(name, seed, steps=200):
    env = load(name, seed)
    m = env.physics.model.ptr
    before = {f: np.array(getattr(m, f)) for f in FIELDS}
    ts = env.reset()
    p = env.physics
    spec = env.action_spec()
    rng = np.random.RandomState(1000 + seed)
    t = {
        "format": "vibes-trace/1", "task": name, "seed": seed,
        "versions": {"mujoco": mujoco.__version__, "dm_control": "1.0.50"},
        "control_timestep": env.control_timestep(), "physics_timestep": p.timestep(),
        "step_limit": env._step_limit if np.isfinite(env._step_limit) else None,
        "action_min": spec.minimum.tolist(), "action_max": spec.maximum.tolist(),
        "time": float(p.data.time), "qpos": p.data.qpos.tolist(), "qvel": p.data.qvel.tolist(),
        "act": p.data.act.tolist(), "model_overrides": overrides(before, m),
        "observation_names": list(ts.observation), "actions": [], "rewards": [], "observations": [], "qpos_trace": [],
    }
    flat = lambda o: np.concatenate([np.ravel(v) for v in o.values()]).tolist()
    t["observations"].append(flat(ts.observation)); t["qpos_trace"].append(p.data.qpos.tolist())
    a = np.zeros(spec.shape)
    for k in range(steps):
        if k % 10 == 0:  # piecewise constant actions reach further than white noise
            a = rng.uniform(spec.minimum, spec.maximum)
        ts = env.step(a)
        t["actions"].append(a.tolist()); t["rewards"].append(float(ts.reward))
        t["observations"].append(flat(ts.observation)); t["qpos_trace"].append(p.data.qpos.tolist())
    return t

if __name__ == "__main__":
    out = sys.argv[1]; os.makedirs(out, exist_ok=True)
    for arg in sys.argv[2:]:
        name, seed = arg.rsplit(":", 1)
        steps = 50 if name == "swimmer-100" else 200
        t = trace(name, int(seed), steps)
        path = os.path.join(out, f"{name}-{seed}.json")
        json.dump(t, open(path, "w"))
        print(path, "obs", len(t["observations"][0]), "return", sum(t["rewards"]), list(t["model_overrides"]), os.path.getsize(path)//1024, "KiB")
