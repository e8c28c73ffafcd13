"""Takes latents that were made outside the toolkit to vibes-analyze: here the recorded joint positions stand in for a model's output.

usage: python own_latents.py RECORDING            a grid; needs vibes-analyze on the path, and polars
"""
import subprocess
import sys
from pathlib import Path

import polars as pl

recording = Path(sys.argv[1])
rows = pl.scan_ipc(recording / "episodes" / "*.arrow").select("episode", "step", "state", "distractor", "qpos").collect()

# All that is asked for is `episode`, `step` and `latent`; with `state` and `distractor` the numbers of a grid can be computed too.
latents = rows.rename({"qpos": "latent"}).cast({"latent": pl.List(pl.Float32)})
latents.write_parquet("my_latents.parquet")

for verb in (["nn", "--queries", "4"], ["invariance"]):
    subprocess.run(["vibes-analyze", *verb, "my_latents.parquet", "--recording", str(recording), "-o", "figures"], check=True)
