"""UMAP's usual test sets: `vibes-analyze umap` beside umap-learn at its defaults, one table.

usage: python analyze/docs/umap_learn.py [PROGRAM]     needs umap-learn==0.5.12, scikit-learn, numpy
Both maps are judged by the same code: scikit-learn's trustworthiness and the share of the 15 nearest neighbours kept, over all rows;
mean of the seeds 0, 1 and 2. Checking only: the toolkit itself needs no Python.
"""
import subprocess, sys, tempfile, warnings
from pathlib import Path

import numpy as np
import pyarrow.ipc
import umap
from sklearn import datasets
from sklearn.manifold import trustworthiness
from sklearn.neighbors import NearestNeighbors

warnings.filterwarnings("ignore")
PROGRAM = sys.argv[1] if len(sys.argv) > 1 else "vibes-analyze"
SEEDS = [0, 1, 2]


def test_sets():
    rng = np.random.default_rng(0)
    yield "iris", datasets.load_iris().data
    yield "wine, standardized", (lambda x: (x - x.mean(0)) / x.std(0))(datasets.load_wine().data)
    yield "digits", datasets.load_digits().data
    yield "three blobs, far apart", datasets.make_blobs(900, 8, centers=3, cluster_std=0.3, random_state=0)[0]
    bridge = np.concatenate([rng.normal(0, 1, (500, 5)), rng.normal(12, 1, (500, 5)), np.linspace(0, 12, 12)[:, None].repeat(5, 1)])
    yield "two blobs and a thin bridge", bridge
    yield "every point of digits[:500] three times", datasets.load_digits().data[:500].repeat(3, 0)
    yield "swiss roll", datasets.make_swiss_roll(2000, noise=0.1, random_state=0)[0]


def judge(high, low):
    near = lambda z: NearestNeighbors(n_neighbors=16).fit(z).kneighbors(z, return_distance=False)[:, 1:]
    kept = np.mean([len(set(a) & set(b)) / 15 for a, b in zip(near(high), near(low))])
    return trustworthiness(high, low, n_neighbors=15), kept


def ours(x, seed):
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "latents.npz"
        np.savez(table, episode=np.zeros(len(x), np.uint32), step=np.arange(len(x), dtype=np.uint32), latent=x)
        subprocess.run([PROGRAM, "umap", "--latents", table, "-o", folder, "--seed", str(seed), "-q"], check=True, stdout=subprocess.DEVNULL)
        placed = pyarrow.ipc.open_file(Path(folder) / "map.arrow").read_all()
        return np.stack([placed["x"], placed["y"]], 1)


print("| set | rows x dims | trustworthiness: ours | umap-learn | neighbours kept: ours | umap-learn |\n|---|---|---|---|---|---|")
for name, x in test_sets():
    x = x.astype(np.float32)
    mine = np.mean([judge(x, ours(x, seed)) for seed in SEEDS], 0)
    theirs = np.mean([judge(x, umap.UMAP(random_state=seed).fit_transform(x)) for seed in SEEDS], 0)
    print(f"| {name} | {len(x)} x {x.shape[1]} | {mine[0]:.4f} | {theirs[0]:.4f} | {mine[1]:.3f} | {theirs[1]:.3f} |", flush=True)
