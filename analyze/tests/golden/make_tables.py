"""One small table of latents as pandas, polars, PyArrow and NumPy write it, in every way that the reader promises to take.

usage: python make_tables.py OUT_DIR        (made with pandas 3.1.1, polars 2.1.0, pyarrow 26.0.1, numpy 2.4.6)

Every number is exact in half precision, so that all files hold the same table. Columns that no verb uses have types that no reader should need.
"""
import datetime, decimal, pathlib, sys

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.feather
import pyarrow.ipc
import pyarrow.parquet

out = pathlib.Path(sys.argv[1])
out.mkdir(parents=True, exist_ok=True)
ROWS, DIMS = 24, 4
row = np.arange(ROWS)
episode, step = row // 12, row % 12
state, distractor = episode % 2, (episode // 2) % 2
latent = (((row[:, None] * 37 + np.arange(DIMS) * 11) % 101) - 50) / 64.0
reward = np.where(step == 11, np.nan, (row % 5) / 4.0)
video = np.array(["dogs", "surf", "dogs", "bus"])[row % 4]
lists = [list(map(float, l)) for l in latent]

half = pa.array([[np.float16(x) for x in l] for l in latent], pa.list_(pa.float16()))
half_fixed = pa.array([[np.float16(x) for x in l] for l in latent], pa.list_(pa.float16(), DIMS))
rewards = pa.array([None if np.isnan(r) else r for r in reward], pa.float64())
flat = {"step": pa.array(step, pa.int16()), "episode": pa.array(episode, pa.uint8()), "reward": rewards,
        "state": pa.array(state, pa.int64()), "distractor": pa.array(distractor, pa.uint32()),
        "video": pa.array(video).dictionary_encode(),
        "unused": pa.array([decimal.Decimal("1.5")] * ROWS, pa.decimal128(20, 2)),
        "when": pa.array([datetime.datetime(2025, 1, 1)] * ROWS)}

frame = pd.DataFrame({"episode": episode, "step": step, "state": state.astype(float), "distractor": distractor, "reward": reward,
                      "latent": lists, "video": pd.Categorical(video)})
frame.to_feather(out / "pandas-lz4.feather")
frame.to_parquet(out / "pandas-snappy.parquet")
wide = pd.concat([frame.drop(columns="latent"), pd.DataFrame(latent, columns=[f"latent_{d}" for d in range(DIMS)])], axis=1)
wide.to_csv(out / "pandas-wide.csv", index=False)
wide.to_csv(out / "pandas-wide-semicolons.csv", index=False, sep=";")
wide.to_csv(out / "pandas-wide.csv.gz", index=False)
frame.to_csv(out / "pandas-lists.csv", index=False)

polars = pl.DataFrame({"episode": episode.astype(np.int32), "step": step.astype(np.int8), "state": state, "distractor": distractor,
                       "reward": pl.Series([None if np.isnan(r) else float(r) for r in reward]), "latent": pl.Series(lists, dtype=pl.List(pl.Float64)),
                       "video": pl.Series(list(video), dtype=pl.Categorical), "unused": pl.Series([1] * ROWS, dtype=pl.Int128),
                       "text": list(video)})
polars.write_ipc(out / "polars-zstd.arrow", compression="zstd")
polars.write_ipc(out / "polars-views.arrow", compression="uncompressed")
polars.with_columns(pl.col("latent").cast(pl.Array(pl.Float32, DIMS))).drop("unused").write_parquet(out / "polars-array.parquet")
polars.write_ipc_stream(out / "polars-stream.arrows", compression="lz4")

table = pa.table({**flat, "latent": half_fixed})
pyarrow.feather.write_feather(table, out / "half-lz4.arrow", compression="lz4")
with pa.ipc.new_stream(out / "half-stream.arrows", table.schema) as writer:
    writer.write_table(table, max_chunksize=7)
for compression in ["none", "gzip", "brotli", "zstd", "lz4"]:
    pyarrow.parquet.write_table(pa.table({**flat, "latent": half}), out / f"half-{compression}.parquet", compression=compression, row_group_size=10)
large = pa.table({**flat, "latent": pa.array(lists, pa.large_list(pa.float64())), "text": pa.array(video, pa.large_string())})
pyarrow.feather.write_feather(large, out / "large-lists.arrow", compression="uncompressed")

columns = {"episode": episode, "step": step.astype(np.uint8), "state": state.astype(np.int16), "distractor": distractor, "reward": reward}
np.savez_compressed(out / "compressed.npz", **columns, latent=latent.astype(np.float16))
np.savez(out / "big-endian.npz", **columns, latent=latent.astype(">f8"))
np.savez(out / "fortran.npz", **columns, latent=np.asfortranarray(latent.astype(np.float32)))
record = np.zeros(ROWS, [("episode", "<u4"), ("step", "<i2"), ("latent", "<f2", (DIMS,)), ("reward", "<f8"), ("state", "u1"), ("distractor", ">i4"), ("video", "S4")])
for name, values in {**columns, "latent": latent}.items():
    record[name] = values
np.save(out / "structured.npy", record)
