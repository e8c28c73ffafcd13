"""What a user has who installs the wheel with nothing but numpy: everything except the doors to Gymnasium and dm_env, which say what they need.

Run by `make python-test` in an environment that holds the wheel and numpy.
"""

import importlib.util
from pathlib import Path

import numpy as np
import vibes

SAMPLE = Path(__file__).resolve().parents[2] / "data" / "sample"

assert not any(importlib.util.find_spec(name) for name in ("gymnasium", "dm_env", "torch", "mujoco")), "this environment holds more than numpy"
world = vibes.World("cartpole-swingup", environments=3, size=32)
rows = world.reset()
rows = world.step(np.zeros((3, 1)))
assert rows["pixels"].shape == (3, 32, 32, 3) and rows["pixels"].std() > 0
recording = vibes.open(SAMPLE)
assert recording.windows(length=4, batch=2)[0]["pixels"].shape[:2] == (2, 4)
observations = np.concatenate([episode.observation for episode in recording])
table = vibes.measures.Table(observations, recording=recording)
assert vibes.measures.variance_shares(table)["state_share"]["estimate"] > 0.9
for door, needs in [(vibes.make, "gymnasium"), (vibes.make_vec, "gymnasium"), (vibes.make_dm, "dm-env")]:
    try:
        door()
        raise AssertionError(f"{door.__name__} opened without {needs}")
    except ImportError as error:
        assert f"pip install {needs}" in str(error), error
print("the wheel works with numpy alone")
