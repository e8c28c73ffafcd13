"""Draws steps of the golden physics episodes with dm_control, undistracted, at 64 pixels: python make_frames.py physics frames"""
import json
import os
import sys

os.environ.setdefault("MUJOCO_GL", "egl")
from dm_control import suite  # noqa: E402
from PIL import Image  # noqa: E402

physics_folder, frames_folder = sys.argv[1:]
for name in ["reacher-easy-0", "cartpole-swingup-0", "walker-walk-0", "ball_in_cup-catch-0"]:
    with open(f"{physics_folder}/{name}.json") as file:
        trace = json.load(file)
    physics = suite.load(*trace["task"].split("-")).physics
    for field, objects in trace["model_overrides"].items():
        for name_of, value in objects.items():
            getattr(physics.named.model, field)[name_of] = value
    for step in [0, 40]:
        with physics.reset_context():
            physics.data.qpos[:] = trace["qpos_trace"][step]
        Image.fromarray(physics.render(64, 64, camera_id=0)).save(f"{frames_folder}/{name}-{step:03d}.png")
