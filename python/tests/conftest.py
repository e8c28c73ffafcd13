"""What the tests share: the sample recording of the repository, and recordings made by vibes-collect. Nothing is skipped: what a test needs and does not find is
a failure that names the command which puts it there."""

import importlib.util
import multiprocessing
import os
import queue
import shutil
import struct
import subprocess
import warnings
import zlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("vibes", "dm_control", "dm_env", "gymnasium", "hypothesis", "polars", "stable_baselines3", "torch", "torchrl")


def program(name):
    """A program of the toolkit, from the path or from cargo's folder."""
    target = os.environ.get("CARGO_TARGET_DIR")
    found = shutil.which(name) or (target and shutil.which(name, path=f"{target}/debug"))
    return found or pytest.fail(f"{name} is not built; run make python-test, which builds it", pytrace=False)


def pytest_configure():
    """Says how the packages come here that the tests import."""
    missing = [package for package in PACKAGES if importlib.util.find_spec(package) is None]
    if missing:
        pytest.exit(f"these tests need {', '.join(missing)}; run make python-test, which installs what python/tests/requirements.txt lists", 1)


def collect(*words):
    """Runs vibes-collect and fails with what it said."""
    done = subprocess.run([program("vibes-collect"), *map(str, words)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def forked(work):
    """What the child of a fork returns from ``work``, or the words of its ``vibes.Error``. A child that waits for ever, or ends without a word, is a failure."""
    import vibes

    context = multiprocessing.get_context("fork")
    answers = context.Queue()

    def child():
        try:
            answers.put(work())
        except vibes.Error as error:
            answers.put(str(error))

    process = context.Process(target=child)
    with warnings.catch_warnings():
        # Python warns of forks beside threads, which is what is tried here.
        warnings.simplefilter("ignore")
        process.start()
    try:
        return answers.get(timeout=60)
    except queue.Empty:
        pytest.fail("the child of the fork gives no answer", pytrace=False)
    finally:
        process.kill()
        process.join()


def films(folder, count):
    """A plain folder of videos: `count` films of two frames each, grey PNGs of 16 x 16, under names that DAVIS does not know."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    size = 16
    header = struct.pack(">IIBBBBB", size, size, 8, 0, 0, 0, 0)
    for film in range(count):
        path = folder / f"film-{film}"
        path.mkdir(parents=True)
        for frame in range(2):
            rows = zlib.compress((b"\0" + bytes([16 * film + 8 * frame] * size)) * size)
            (path / f"{frame}.png").write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", rows) + chunk(b"IEND", b""))
    return folder


@pytest.fixture(scope="session")
def sample():
    """data/sample: a small grid of reacher-easy."""
    return ROOT / "data" / "sample"


@pytest.fixture(scope="session")
def recorded(tmp_path_factory):
    """A recording by options of vibes-collect, made once."""
    made = {}

    def record(*words):
        if words not in made:
            made[words] = tmp_path_factory.mktemp("recorded") / "recording"
            collect(*words, "--no-mcap", "--quiet", "-o", made[words])
        return made[words]

    return record
