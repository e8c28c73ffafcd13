"""The latents of measure/tests/golden/neighbours.json as others write them.

usage: python make_neighbours.py        writes neighbours.npz, .npy and .parquet beside itself; needs numpy and pyarrow
"""
import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet

here = Path(__file__).parent
golden = json.loads((here / "../../../measure/tests/golden/neighbours.json").read_text())
episode, step = np.array(golden["episode"]), np.array(golden["step"])
latent = np.array(golden["latent"], np.float64)

np.savez(here / "neighbours.npz", episode=episode.astype(np.int64), step=step.astype(np.uint16), latent=latent)
record = np.zeros(len(episode), [("episode", "<u4"), ("step", "<i4"), ("latent", "<f4", (latent.shape[1],))])
record["episode"], record["step"], record["latent"] = episode, step, latent
np.save(here / "neighbours.npy", record)
lists = pa.array(latent.tolist(), pa.list_(pa.float64()))
pa.parquet.write_table(pa.table({"latent": lists, "step": step, "episode": episode}), here / "neighbours.parquet")
