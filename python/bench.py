"""How fast the environments are from Python: python python/bench.py [TASK]

Prints, of one run, control steps held: frames a second of ``vibes.make`` at 64 pixels under easy dynamic distractors, beside the same loop in Rust
(``World.roll``) and beside a vector environment on one thread and on all cores, and the same many environments without Python, which is what the machine's
cores give. Actions are drawn beforehand: what a policy costs is not the environment's. The loops take turns, and medians are printed, because other work on
the machine comes and goes; seconds of the processor (all threads of this process) are printed beside seconds of the clock for the same reason.
"""

import os
import statistics
import sys
import time

import numpy as np
import vibes

TURNS, STEPS, MANY = 15, 40, 8


def timed(work):
    clock, processor = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - clock, time.process_time() - processor


def main(task):
    env = vibes.make(task, seed=0)
    loop = vibes.World(task, seed=0)
    cores = len(os.sched_getaffinity(0))
    many = {threads: vibes.make_vec(task, MANY, threads=threads, seed=0) for threads in {1, cores}}
    alone = {threads: vibes.World(task, environments=MANY, threads=threads, seed=0) for threads in many}
    low, high = env.world.action_bounds
    actions = np.random.default_rng(0).uniform(low, high, (STEPS, MANY, len(low))).astype(np.float32)

    def one():
        for action in actions[:, 0]:
            if env.step(action)[3]:
                env.reset()

    def vector(envs):
        for action in actions:
            envs.step(action)

    env.reset()
    for envs in many.values():
        envs.reset()
    works = {"rust": (lambda: loop._native.roll(STEPS, True), STEPS), "python": (one, STEPS)}
    works |= {f"vector on {threads}": (lambda envs=envs: vector(envs), STEPS * MANY) for threads, envs in many.items()}
    works |= {f"rust on {threads}": (lambda world=world: world._native.roll(STEPS, True), STEPS * MANY) for threads, world in alone.items()}
    times = {name: [] for name in works}
    for work, _ in works.values():
        work()
    for _ in range(TURNS):
        for name, (work, frames) in works.items():
            times[name].append([seconds / frames for seconds in timed(work)])
    found = {name: [statistics.median(column) for column in zip(*rows)] for name, rows in times.items()}
    for name, (clock, processor) in found.items():
        print(f"{name:12} {1 / clock:8.0f} frames/s by the clock, {1e6 * processor:6.0f} us of processor a frame")
    for place, what in enumerate(["by the clock", "of the processor"]):
        pairs = [python[place] / rust[place] - 1 for python, rust in zip(times["python"], times["rust"])]
        print(f"overhead of Python over the Rust loop {what}: {100 * statistics.median(pairs):.1f} %")
    if cores > 1:
        for what, said in [("vector", "the vector environment scales"), ("rust", "the same environments without Python scale")]:
            pairs = [one[0] / all_[0] / cores for one, all_ in zip(times[f"{what} on 1"], times[f"{what} on {cores}"])]
            print(f"{said} to {cores} cores by {100 * statistics.median(pairs):.0f} %")


main(sys.argv[1] if len(sys.argv) > 1 else "reacher-easy")
