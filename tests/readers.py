"""Reads a recording and its exports with the readers that other people use: python tests/readers.py [RECORDING]

Needs vibes-collect on the PATH for the exports, and the packages of setup/python.txt; `make test` runs it in an environment of its own that has
them. Exits with 1 when a reader is missing or disagrees with the recording. Only LeRobot may be missing, because it is large; the line says so.
"""
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent.resolve()
RECORDING = Path(sys.argv[1] if len(sys.argv) > 1 else HERE.parent / "data/sample").resolve()
MANIFEST = json.loads((RECORDING / "manifest.json").read_text())
SPEC, EPISODES = MANIFEST["spec"], MANIFEST["episodes"]
ROWS = sum(episode["steps"] + 1 for episode in EPISODES)
FRAMES = sum(episode["steps"] for episode in EPISODES)
RETURNS = [episode["return"] for episode in EPISODES]
OBSERVATION = sum(part["len"] for part in SPEC["observation"])
CHECKS = []
OUT = Path(tempfile.mkdtemp(prefix="vibes-readers-"))


def check(name, *packages, program=None):
    """Registers a check that needs these Python packages and this program."""

    def register(function):
        CHECKS.append((name, packages, program, function))
        return function

    return register


def close(a, b):
    return abs(a - b) <= 1e-4 * max(1.0, abs(a), abs(b))


def picture(path, row):
    """The recording's own picture, as the tests of other formats compare it: [height, width, 3]."""
    import numpy as np
    import pyarrow as pa

    size = SPEC["pixels"]
    column = pa.ipc.open_file(RECORDING / path).read_all()["pixels"]
    return np.frombuffer(column[row].as_py(), np.uint8).reshape(size["height"], size["width"], 3)


def exported(format, *options):
    """Exports once, into a folder of its own."""
    out = OUT / "-".join([format, *[option.strip("-") for option in options], "v0"])
    if not out.exists():
        run = ["vibes-collect", "export", str(RECORDING), "--format", format, *options, "-o", str(out), "-q"]
        subprocess.run(run, check=True)
    return out


@check("Arrow files with pyarrow", "pyarrow")
def _():
    import pyarrow as pa

    for episode in EPISODES:
        table = pa.ipc.open_file(RECORDING / episode["arrow"]["path"]).read_all()
        table.validate(full=True)
        assert table.num_rows == episode["steps"] + 1
        assert close(sum(table["reward"].drop_null().to_pylist()), episode["return"])


@check("Arrow files with polars", "polars")
def _():
    import polars as pl

    table = pl.scan_ipc(RECORDING / "episodes/*.arrow").collect()
    assert table.height == ROWS
    returns = table.group_by("episode").agg(pl.col("reward").sum()).sort("episode")["reward"]
    assert all(close(a, b) for a, b in zip(returns, RETURNS))


@check("MCAP logs with mcap", "mcap", "mcap_protobuf")
def _():
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    for episode in EPISODES:
        if not episode["mcap"]:
            continue
        with open(RECORDING / episode["mcap"]["path"], "rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
            total, pictures, steps = 0.0, 0, 0
            for _, channel, _, message in reader.iter_decoded_messages():
                if channel.topic == "/step":
                    steps += 1
                    total += message.reward
                if channel.topic == "/pixels":
                    pictures += 1
                    assert len(message.data) == message.step * message.height
        assert steps == episode["steps"] + 1 and close(total, episode["return"])
        assert pictures == (steps if SPEC["pixels"] else 0)


@check("MCAP logs with rerun", program="rerun")
def _():
    for episode in EPISODES[:1]:
        out = OUT / "episode.rrd"
        run = ["rerun", "mcap", "convert", str(RECORDING / episode["mcap"]["path"]), "-o", str(out)]
        subprocess.run(run, check=True, capture_output=True)
        assert out.stat().st_size > 1000


@check("Parquet export with pyarrow and pandas", "pyarrow", "pandas", program="vibes-collect")
def _():
    import pandas as pd
    import pyarrow.parquet as pq

    out = exported("parquet")
    files = sorted((out / "episodes").glob("*.parquet"))
    assert len(files) == len(EPISODES)
    for file, episode in zip(files, EPISODES):
        table = pd.read_parquet(file)
        assert len(table) == episode["steps"] + 1 and close(table["reward"].sum(), episode["return"])
        assert pd.isna(table["reward"].iloc[-1]) and len(table["observation"].iloc[0]) == OBSERVATION
        assert pq.read_schema(file).names == list(table.columns)


@check("Parquet export with polars, pictures with Pillow", "polars", "PIL", "numpy", "pyarrow", program="vibes-collect")
def _():
    import io

    import numpy as np
    import polars as pl
    from PIL import Image

    out = exported("parquet")
    assert pl.scan_parquet(out / "episodes/*.parquet").select(pl.len()).collect().item() == ROWS
    if SPEC["pixels"]:
        bytes_ = pl.read_parquet(sorted((out / "episodes").glob("*.parquet"))[0])["pixels"][1]
        assert (np.array(Image.open(io.BytesIO(bytes_))) == picture(EPISODES[0]["arrow"]["path"], 1)).all()


@check("Minari export with minari", "minari", "numpy", "pyarrow", "PIL", program="vibes-collect")
def _():
    import warnings

    import numpy as np

    warnings.simplefilter("ignore")
    from minari import MinariDataset

    dataset = MinariDataset(exported("minari") / "data")
    assert dataset.total_episodes == len(EPISODES) and dataset.total_steps == FRAMES
    for found, episode in zip(dataset.iterate_episodes(), EPISODES):
        assert close(found.rewards.sum(), episode["return"]) and len(found.rewards) == episode["steps"]
        assert found.actions.shape == (episode["steps"], len(SPEC["action"]["min"]))
        for part in SPEC["observation"]:
            assert found.observations[part["name"]].shape == (episode["steps"] + 1, part["len"])
        assert dataset.action_space.contains(found.actions[0])
        assert found.truncations[-1] != found.terminations[-1] and not found.truncations[:-1].any()
        if SPEC["pixels"]:
            assert (found.observations["pixels"][2] == picture(episode["arrow"]["path"], 2)).all()
        if SPEC["qpos"]:
            assert found.infos["qpos"].shape == (episode["steps"] + 1, SPEC["qpos"])
    list(dataset.storage.get_episode_metadata(range(len(EPISODES))))
    assert np.isfinite(dataset.storage.metadata["dataset_size"])


@check("LeRobot export, the tables with pandas", "pyarrow", "pandas", program="vibes-collect")
def _():
    import pandas as pd

    out = exported("lerobot")
    info = json.loads((out / "meta/info.json").read_text())
    stats = json.loads((out / "meta/stats.json").read_text())
    frames = pd.read_parquet(out / "data/chunk-000/file-000.parquet")
    episodes = pd.read_parquet(out / "meta/episodes/chunk-000/file-000.parquet")
    tasks = pd.read_parquet(out / "meta/tasks.parquet")
    assert len(frames) == info["total_frames"] == FRAMES and len(episodes) == info["total_episodes"]
    assert tasks.iloc[0].name == SPEC["task"] and list(tasks.columns) == ["task_index"]
    assert (frames["index"] == range(FRAMES)).all()
    assert set(frames.columns) == {name for name, feature in info["features"].items() if feature["dtype"] != "video"}
    for row, (place, episode) in zip(episodes.itertuples(), enumerate(EPISODES)):
        own = frames[frames["episode_index"] == place]
        assert (own["index"].min(), own["index"].max() + 1) == (row.dataset_from_index, row.dataset_to_index)
        assert close(own["next.reward"].sum(), episode["return"])
        assert (abs(own["timestamp"] - own["frame_index"] / info["fps"]) < 1e-4).all()
    assert close(stats["next.reward"]["mean"][0], frames["next.reward"].mean())
    assert close(stats["next.reward"]["std"][0], frames["next.reward"].std(ddof=0))


@check("LeRobot export, the videos with PyAV", "av", "numpy", "pyarrow", program="vibes-collect")
def _():
    if SPEC["pixels"]:
        import av

        with av.open(str(exported("lerobot") / "videos/observation.images.camera/chunk-000/file-000.mp4")) as file:
            stream = file.streams.video[0]
            assert abs(float(stream.average_rate) * SPEC["control_timestep"] * SPEC["action_repeat"] - 1) < 1e-6
            compare_video([frame.to_ndarray(format="rgb24") for frame in file.decode(stream)])


@check("LeRobot export, the videos with OpenCV", "cv2", "numpy", "pyarrow", program="vibes-collect")
def _():
    if SPEC["pixels"]:
        import cv2

        video = cv2.VideoCapture(str(exported("lerobot") / "videos/observation.images.camera/chunk-000/file-000.mp4"))
        frames = []
        while True:
            there, frame = video.read()
            if not there:
                break
            frames.append(frame[:, :, ::-1])
        compare_video(frames)


def compare_video(frames):
    """Luma comes back to rounding; colours are half as sharp."""
    import numpy as np

    assert len(frames) == FRAMES
    place = 0
    for episode in EPISODES[:2]:
        for row in range(episode["steps"]):
            own = picture(episode["arrow"]["path"], row).astype(float)
            got = frames[place].astype(float)
            weights = np.array([0.299, 0.587, 0.114])
            assert abs((own - got) @ weights).mean() < 1.5, abs((own - got) @ weights).mean()
            assert abs(own - got).mean() < 8, abs(own - got).mean()
            place += 1


@check("LeRobot export with lerobot", "lerobot", "torch", program="vibes-collect")
def _():
    import numpy as np
    from lerobot.datasets.lerobot_dataset import LeRobotDataset

    for options in [[], ["--pictures", "png"]]:
        root = exported("lerobot", *options)
        dataset = LeRobotDataset("vibes/sample", root=root, video_backend="pyav")
        assert len(dataset) == FRAMES and dataset.num_episodes == len(EPISODES)
        place = EPISODES[0]["steps"] + 1
        assert dataset.meta.episodes[1]["dataset_from_index"] == EPISODES[0]["steps"]
        if not options and SPEC["pixels"]:
            # LeRobot's decoders come and go with FFmpeg; PyAV and OpenCV decode the videos above.
            row = dataset.hf_dataset[place]
            assert row["action"].shape[0] == len(SPEC["action"]["min"])
            assert dataset.meta.get_video_file_path(1, "observation.images.camera")
            continue
        item = dataset[place]
        assert item["task"] == SPEC["task"] and item["action"].shape[0] == len(SPEC["action"]["min"])
        if SPEC["pixels"]:
            got = item["observation.images.camera"].numpy().transpose(1, 2, 0) * 255
            assert np.abs(got - picture(EPISODES[1]["arrow"]["path"], 1)).max() < 0.5


def main():
    failed = 0
    for name, packages, program, function in CHECKS:
        missing = [package for package in packages if importlib.util.find_spec(package) is None]
        if missing and "lerobot" in packages:
            print(f"readers: {name}: not tried, pip install lerobot==0.4.4 ({', '.join(missing)} missing)")
            continue
        try:
            if missing:
                raise ImportError(f"{', '.join(missing)} missing; run: pip install -r setup/python.txt")
            if program and shutil.which(program) is None:
                raise FileNotFoundError(f"no {program} on the PATH; run: make test")
            function()
            print(f"readers: {name}: agrees")
        except Exception as error:
            failed += 1
            print(f"readers: {name}: FAILED: {type(error).__name__}: {error}")
    shutil.rmtree(OUT, ignore_errors=True)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    os.chdir(OUT)
    main()
