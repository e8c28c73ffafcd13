"""The examples that hand runs to other engines, with the real packages: `make sweep-test`, in an environment of its own outside the clone.

Ray: a cluster of two workers, one of which is killed in the middle, and every run still ends with the bytes of an undisturbed one. Optuna: a short search.
Weights & Biases: offline, by the command of the sweep's file. SkyPilot's file is only read, because it needs a cloud account.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
SAMPLE = ROOT / "data" / "sample"
RUNS, UPDATES = 4, 60
TINY = "--preset tiny --batch 2 --length 6 --depth 4 --hidden 16 --head 16 --latent 4"
PLAN = f"""
output = "runs/sweep"
seeds = {RUNS}
stages = ["vibes-train offline {SAMPLE} {TINY} --updates {UPDATES} --checkpoint-every 2 --log-every 1 --seed {{seed}} -o {{run}}"]
"""


def call(*words, folder, **variables):
    """What a command says; it has to succeed."""
    done = subprocess.run([str(word) for word in words], cwd=folder, env=os.environ | variables, capture_output=True, text=True)
    assert done.returncode == 0, f"{words}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def states(folder):
    return [run["state"] for run in json.loads(call("vibes-train", "sweep", "plan.toml", "--status", "--json", folder=folder))]


def weights(folder):
    last = f"checkpoints/{UPDATES:06}/model.safetensors"
    return [(folder / f"runs/sweep/seed={seed}" / last).read_bytes() for seed in range(RUNS)]


def wait_for(moment, what, seconds=300):
    begun = time.monotonic()
    while not moment():
        assert time.monotonic() - begun < seconds, f"{what} never comes"
        time.sleep(0.1)


def ray_finishes_every_run_although_a_worker_is_killed(folder):
    import ray
    from ray.cluster_utils import Cluster

    (folder / "plan.toml").write_text(PLAN)
    undisturbed = folder / "undisturbed"
    undisturbed.mkdir()
    shutil.copy(folder / "plan.toml", undisturbed)
    call("vibes-train", "sweep", "plan.toml", "--index", f"0-{RUNS - 1}", "--quiet", folder=undisturbed)

    # The head gives no cores, so that runs are on the two workers.
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    workers = [cluster.add_node(num_cpus=1) for _ in range(2)]
    cluster.wait_for_nodes()
    words = [sys.executable, EXAMPLES / "ray_sweep.py", "plan.toml", "--address", cluster.address]
    sweep = subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    begun = lambda: [path for path in (folder / "runs/sweep").glob("*/checkpoints/000004")]
    wait_for(lambda: len(begun()) == 2 or sweep.poll() is not None, "the moment when two runs have checkpoints")
    assert states(folder).count("running") == 2, states(folder)
    cluster.remove_node(workers[0], allow_graceful=False)
    said, _ = sweep.communicate(timeout=900)
    cluster.shutdown()
    ray.shutdown()
    assert sweep.returncode == 0, said
    assert states(folder) == ["done"] * RUNS, said
    assert weights(folder) == weights(undisturbed), "the bytes of runs that nobody disturbed"
    again = max(json.loads(line)["update"] for line in (folder / "runs/sweep/seed=0/metrics.jsonl").read_text().splitlines())
    assert again == UPDATES


def optuna_searches_and_goes_on(folder):
    words = [sys.executable, EXAMPLES / "optuna_search.py", SAMPLE, SAMPLE, "--updates", "4", "--preset", "tiny", "-o", "search"]
    assert "best: " in call(*words, "--trials", "2", folder=folder)
    said = call(*words, "--trials", "3", folder=folder)
    assert "trial 2: " in said and "trial 1: " not in said, said
    assert (folder / "search/trial-002/run.json").exists()


def wandb_logs_a_run_as_the_sweep_file_starts_it(folder):
    sweep = yaml.safe_load((EXAMPLES / "wandb_sweep.yaml").read_text())
    chosen = {"lr": 0.0003, "dynamics-weight": sweep["parameters"]["dynamics-weight"]["values"][0], "seed": 1}
    assert set(chosen) == set(sweep["parameters"])
    fill = {"${env}": ["/usr/bin/env"], "python": [sys.executable], "${args}": [f"--{name}={value}" for name, value in chosen.items()]}
    fill |= {"examples/wandb_run.py": [EXAMPLES / "wandb_run.py"], "recordings/train": [SAMPLE], "runs/wandb": ["wandb-run"]}
    words = [word for part in sweep["command"] for word in fill.get(part, [part])]
    call(*words, *TINY.split(), "--updates", "5", "--log-every", "1", folder=folder, WANDB_MODE="offline", WANDB_SILENT="true")
    (log,) = (folder / "wandb").glob("offline-run-*/run-*.wandb")
    assert log.stat().st_size > 1000 and sweep["metric"]["name"].encode() in log.read_bytes()
    assert json.loads((folder / "wandb-run/run.json").read_text())["options"]["seed"] == 1


def skypilots_file_is_one(folder):
    task = yaml.safe_load((EXAMPLES / "skypilot.yaml").read_text())
    assert {"resources", "setup", "run"} <= set(task) and "table1-small.toml" in task["run"]
    (folder / "run.sh").write_text(task["run"])
    call("bash", "-n", "run.sh", folder=folder)


def main():
    tests = [
        skypilots_file_is_one,
        optuna_searches_and_goes_on,
        wandb_logs_a_run_as_the_sweep_file_starts_it,
        ray_finishes_every_run_although_a_worker_is_killed,
    ]
    for test in tests:
        with tempfile.TemporaryDirectory() as folder:
            begun = time.monotonic()
            test(Path(folder))
            print(f"{test.__name__.replace('_', ' ')}: {time.monotonic() - begun:.0f} s", flush=True)


if __name__ == "__main__":
    main()
