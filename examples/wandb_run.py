"""One training run with its metrics in Weights & Biases: the program that wandb_sweep.yaml starts, and of use alone.

    python wandb_run.py RECORDING -o RUN [any option of `vibes-train offline`]

The run's metrics.jsonl is followed while it grows. Without an account: WANDB_MODE=offline, and `wandb sync` later.
Needs wandb, as tests/sweep_engines.txt names it.
"""

import json
import subprocess
import sys
import time
from pathlib import Path

import wandb


def rows(path, since):
    """The whole lines of a file from a place on, and the place after them."""
    if not path.exists():
        return [], since
    with path.open("rb") as file:
        file.seek(since)
        whole, newline, _ = file.read().rpartition(b"\n")
    return [json.loads(line) for line in whole.splitlines()], since + len(whole) + len(newline)


def main():
    words = sys.argv[1:]
    if "-o" not in words[:-1]:
        sys.exit("say where the run lies: -o RUN")
    folder = Path(words[words.index("-o") + 1])
    # A sweep's runs lie side by side under their ids.
    with wandb.init(project="vibes") as run:
        if run.sweep_id:
            folder = folder / run.id
            words[words.index("-o") + 1] = str(folder)
        training = subprocess.Popen(["vibes-train", "offline", *words, "--quiet"])
        place, code = 0, None
        while code is None:
            code = training.poll()
            found, place = rows(folder / "metrics.jsonl", place)
            for row in found:
                run.log(row, step=row["update"])
            time.sleep(0 if code is not None else 1)
        # A training that ended before its run was there has no options; its exit code is told either way.
        if (folder / "run.json").exists():
            told = json.loads((folder / "run.json").read_text())
            run.config.update(told["options"], allow_val_change=True)
    sys.exit(code)


if __name__ == "__main__":
    main()
