"""What Python draws is what the trainer trains on: the bytes of every batch, compared between the two processes."""

import hashlib
import json
import subprocess

import vibes
from conftest import program

LENGTH, BATCH, SEED, UPDATES = 5, 3, 11, 12


def trained(run, *recordings):
    """What vibes-train says that each update trained on."""
    words = f"--preset tiny --length {LENGTH} --batch {BATCH} --depth 4 --hidden 16 --head 16 --updates {UPDATES} --seed {SEED} --log-windows --quiet -o {run}"
    done = subprocess.run([program("vibes-train"), "offline", *map(str, recordings), *words.split()], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in (run / "windows.jsonl").read_text().splitlines()]


def assert_the_same(logged, windows):
    assert [line["update"] for line in logged] == list(range(UPDATES))
    for line in logged:
        batch = windows[line["update"]]
        assert list(zip(batch["episode"].tolist(), batch["step"].tolist())) == [tuple(start) for start in line["starts"]]
        for name in ("pixels", "observation", "action", "previous_action", "reward", "is_first"):
            in_time = batch[name].swapaxes(0, 1)
            assert hashlib.sha256(in_time.tobytes()).hexdigest() == line[name], (line["update"], name)


def test_windows_of_one_recording_are_the_trainers(tmp_path, sample):
    logged = trained(tmp_path / "run", sample)
    assert_the_same(logged, vibes.open(sample).windows(length=LENGTH, batch=BATCH, seed=SEED))
    assert len({line["pixels"] for line in logged}) > 1


def test_windows_of_two_recordings_are_the_trainers(tmp_path, sample, recorded):
    size = vibes.open(sample).spec["pixels"]["height"]
    more = recorded("--episodes", "3", "--steps", "20", "--size", size, "--seed", "4")
    logged = trained(tmp_path / "run", sample, more)
    assert_the_same(logged, vibes.windows([sample, more], length=LENGTH, batch=BATCH, seed=SEED))
