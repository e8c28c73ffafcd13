"""Records a grid of two physical trajectories under three distractors, and reads it with Polars and NumPy.

usage: python record_and_read.py [FOLDER]        needs vibes-collect on the path, and polars
"""
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl

folder = Path(sys.argv[1] if len(sys.argv) > 1 else "recordings/example")
subprocess.run(["vibes-collect", "--grid", "2x3", "--steps", "20", "-q", "-o", str(folder)], check=True)

# Every episode is an Arrow table, a row for every agent step: row t holds the observation, the action taken there and the reward it earned.
table = pl.scan_ipc(folder / "episodes" / "*.arrow")
returns = table.group_by("state", "distractor").agg(pl.col("reward").sum().alias("return")).sort("state", "distractor").collect()
print(returns)

# The trajectories of one state share their physics: only the pictures differ.
first = table.filter((pl.col("state") == 0) & (pl.col("step") == 10)).sort("distractor").select("pixels", "qpos").collect()
side = round((len(first["pixels"][0]) // 3) ** 0.5)
pictures = np.stack([np.frombuffer(pixels, np.uint8).reshape(side, side, 3) for pixels in first["pixels"]])
positions = np.array(first["qpos"].to_list())
print(f"{len(pictures)} pictures of {side}x{side}; positions equal: {bool((positions == positions[0]).all())}; "
      f"pictures equal: {bool((pictures == pictures[0]).all())}")
