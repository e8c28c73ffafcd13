"""A sweep on a Ray cluster: every run of a plan is one task. A run whose machine dies is given to another, and goes on from its last checkpoint.

    python ray_sweep.py PLAN.toml                                  a cluster of this machine's cores
    python ray_sweep.py PLAN.toml --address auto --threads 4       the cluster that `ray start` has made, four cores a run

Every machine has vibes-train on its path and sees the folder in which this is started (a shared file system), because the state of a sweep is what lies
in its folders. Given again, the same command does what is not done yet. `make sweep-test` runs it on two workers and kills one of them.
"""

import argparse
import ctypes
import json
import os
import signal
import subprocess
import sys
import time

import ray

AGAIN = 75  # vibes-train's exit code for: saved, or somebody else is at it; the same command goes on
PAUSE = 2.0  # seconds before it is given again
DEATH_OF_PARENT = 1  # PR_SET_PDEATHSIG of Linux


class Again(Exception):
    """The run was stopped, or its former owner is still saving."""


def end_with_the_worker():
    """In the child: a worker that dies, by whatever signal, takes its run along, so that the folder is free for the next owner."""
    ctypes.CDLL(None).prctl(DEATH_OF_PARENT, signal.SIGTERM)
    # Ray's workers block SIGINT, and children inherit that.
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})


@ray.remote(max_retries=-1, retry_exceptions=[Again])
def run(plan, index, digest, threads, folder):
    """Run `index` of the plan, in a process of its own; its error's text if it failed, or if that is another run by now."""
    # Ray's numbers of cores are bookkeeping: the program has to be told.
    cores = os.environ | {"RAYON_NUM_THREADS": str(threads)}
    words = ["vibes-train", "sweep", plan, "--index", str(index), "--run-is", digest, "--quiet"]
    done = subprocess.run(words, cwd=folder, env=cores, preexec_fn=end_with_the_worker, capture_output=True, text=True)
    if done.returncode == AGAIN:
        time.sleep(PAUSE)
        raise Again(index)
    return None if done.returncode == 0 else done.stderr.strip()


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("plan")
    arguments.add_argument("--address", help="of the cluster; auto finds the one on this machine (default: a new one)")
    arguments.add_argument("--threads", type=int, default=1, help="cores a run")
    asked = arguments.parse_args()
    listed = subprocess.run(["vibes-train", "sweep", asked.plan, "--list", "--json"], check=True, capture_output=True)
    runs = json.loads(listed.stdout)
    ray.init(address=asked.address, log_to_driver=False, include_dashboard=False if asked.address is None else None)
    start = run.options(num_cpus=asked.threads).remote
    plan, folder = os.path.abspath(asked.plan), os.getcwd()
    waiting = {start(plan, one["index"], one["digest"], asked.threads, folder): one["name"] for one in runs}
    failed = 0
    while waiting:
        (ready,), _ = ray.wait(list(waiting))
        name, error = waiting.pop(ready), ray.get(ready)
        failed += error is not None
        print(f"{name}: {'done' if error is None else error}", flush=True)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
