"""Distractor traces and reference frames: the Distracting Control Suite's own camera and colour code, dm_control's own renderer.

usage: MUJOCO_GL=egl python make_dcs.py dcs videos ball_in_cup-catch:medium:0 cartpole-swingup:easy:0 reacher-easy:easy:0 walker-walk:hard:0
Needs: mujoco==3.17.0 dm-control==1.0.50 distracting-control==0.1.1rc3 pillow opencv-python-headless
The suite's background wrapper predates mjModel.tex_data, so its published algorithm is followed here on the new field.
"""
import json, os, sys
import cv2, mujoco, numpy as np
from PIL import Image
from dm_control import suite
from dm_control.mujoco.wrapper import mjbindings

from distracting_control import camera, color, suite_utils

class Recorder:
    """A RandomState that keeps every draw, in order."""
    def __init__(self, seed): self.rng, self.draws = np.random.RandomState(seed), []
    def _keep(self, kind, v):
        self.draws.append([kind, np.asarray(v).tolist()]); return v
    def uniform(self, low, high, size=None): return self._keep("uniform", self.rng.uniform(low, high, size))
    def randn(self, *shape): return self._keep("randn", self.rng.randn(*shape))
    def choice(self, xs, size=None): return self._keep("choice", self.rng.choice(xs, size=size))
    def take(self):
        d, self.draws = self.draws, []; return d

def make_videos(root, n=4, frames=12, w=320, h=180):
    for v in range(n):
        d = os.path.join(root, f"video-{v}"); os.makedirs(d, exist_ok=True)
        rng = np.random.RandomState(v)
        discs = [(rng.rand() * w, rng.rand() * h, 8 + 40 * rng.rand(), rng.randint(0, 256, 3), rng.randn(2) * 6) for _ in range(60)]
        for f in range(frames):
            img = np.full((h, w, 3), 90 + 20 * v, np.uint8)
            for x, y, r, c, vel in discs:
                cv2.circle(img, (int(x + vel[0] * f) % w, int(y + vel[1] * f) % h), int(r), c.tolist(), -1)
            Image.fromarray(img).save(os.path.join(d, f"{f:05d}.jpg"), quality=92)

def run(out, videos, name, difficulty, seed, steps=40):
    domain, task = name.rsplit("-", 1)
    base = suite.load(domain, task, task_kwargs={"random": seed})
    p = base.physics
    scale = suite_utils.DIFFICULTY_SCALE[difficulty]
    cam = camera.DistractingCameraEnv(base, camera_id=0, seed=seed, **suite_utils.get_camera_kwargs(domain, scale, True))
    cam._random_state = Recorder(100 + seed)
    env = color.DistractingColorEnv(cam, seed=seed, **suite_utils.get_color_kwargs(scale, True))
    env._random_state = Recorder(200 + seed)
    alpha = suite_utils.get_background_kwargs(domain, 4, True, videos)["ground_plane_alpha"]
    rng = np.random.RandomState(300 + seed)
    video = sorted(os.listdir(videos))[rng.randint(len(os.listdir(videos)))]
    files = sorted(os.listdir(os.path.join(videos, video)))
    frames = [np.asarray(Image.open(os.path.join(videos, video, f))) for f in files]
    textures = [cv2.resize(f, (800, 800), interpolation=cv2.INTER_LINEAR).astype(np.uint8).ravel() for f in frames]
    index, direction = int(rng.randint(len(frames))), int(rng.choice([-1, 1]))

    def background():
        m = p.model
        m.mat_rgba[mujoco.mj_name2id(m.ptr, mujoco.mjtObj.mjOBJ_MATERIAL, "grid"), 3] = alpha
        m.tex_height[0] = 800
        start = m.tex_adr[0]
        m.tex_data[start:start + 800 * 800 * 3] = textures[index]
        with p.contexts.gl.make_current() as ctx:
            ctx.call(mjbindings.mjlib.mjr_uploadTexture, m.ptr, p.contexts.mujoco.ptr, 0)

    def overrides():
        m = p.model.ptr
        g = mujoco.mj_name2id(m, mujoco.mjtObj.mjOBJ_GEOM, "target")
        return {"geom_pos": {"target": m.geom_pos[g].tolist()}, "geom_size": {"target": m.geom_size[g].tolist()}} if g >= 0 else {}

    mats = [mujoco.mj_id2name(p.model.ptr, mujoco.mjtObj.mjOBJ_MATERIAL, i) for i in range(p.model.nmat)]
    doc = {"format": "vibes-distractor-trace/1", "task": name, "difficulty": difficulty, "dynamic": True, "ground_alpha": alpha,
           "video": video, "frame_count": len(frames), "materials": mats, "steps": []}
    original = p.model.mat_rgba.copy()[:, :3]; doc["original_rgb"] = original.tolist()
    env.reset()
    doc["model_overrides"] = overrides()
    c0 = cam
    doc["camera_start"] = {"type": c0._camera_type, "h_bounds": [float(c0._min_h_angle), float(c0._max_h_angle)], "v_bounds": [float(c0._min_v_angle), float(c0._max_v_angle)],
                           "r_bounds": [float(c0._min_radius), float(c0._max_radius)], "roll_bounds": [float(c0._min_roll), float(c0._max_roll)], "vel_scaling": float(c0._vel_scaling)}
    spec = base.action_spec(); arng = np.random.RandomState(400 + seed)
    stem = f"{name}-{difficulty}-{seed}"
    for k in range(steps + 1):
        if k:
            a = arng.uniform(spec.minimum, spec.maximum)
            env.step(a)
            index += direction
            if index <= 0: index, direction = 0, 1
            if index >= len(frames): index, direction = len(frames) - 1, -1
        s = {"qpos": p.data.qpos.tolist(), "qvel": p.data.qvel.tolist(), "subtree_com": p.data.subtree_com[1].tolist(),
             "camera": {"r": float(c0._radius), "h": float(c0._h_angle), "v": float(c0._v_angle), "roll": float(c0._roll),
                        "velocity": np.asarray(c0._camera_vel).tolist(), "roll_velocity": float(c0._roll_vel),
                        "xpos": p.data.cam_xpos[0].tolist(), "xmat": p.data.cam_xmat[0].tolist(), "draws": cam._random_state.take()},
             "color": {"rgb": p.model.mat_rgba[:, :3].tolist(), "draws": env._random_state.take()},
             "background": {"frame": index, "direction": direction}}
        if k % 20 == 0:
            background(); s["frames"] = {}
            for size in (64, 84):
                f = f"{stem}-{k:03d}-{size}.png"
                Image.fromarray(p.render(size, size, camera_id=0)).save(os.path.join(out, f)); s["frames"][str(size)] = f
        doc["steps"].append(s)
    json.dump(doc, open(os.path.join(out, stem + ".json"), "w"))
    print(stem, os.path.getsize(os.path.join(out, stem + ".json")) // 1024, "KiB", doc["camera_start"]["type"])

if __name__ == "__main__":
    out, videos = sys.argv[1:3]; os.makedirs(out, exist_ok=True)
    if not os.path.isdir(videos): make_videos(videos)
    for arg in sys.argv[3:]:
        name, difficulty, seed = arg.split(":")
        run(out, videos, name, difficulty, int(seed))
