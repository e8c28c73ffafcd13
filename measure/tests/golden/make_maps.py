"""The points whose maps by umap-learn are known, and the numbers of README.md.

usage: python make_maps.py           writes the points beside itself and prints the numbers; needs umap-learn==0.5.12, scikit-learn, numpy

arcs.f32: 20 arcs of 100 points on the unit sphere in 32 dimensions with noise 0.05, little-endian float32. iris.f32 and digits-500.u8 are scikit-learn's.
"""
from pathlib import Path

import numpy as np
import umap
from sklearn import datasets
from sklearn.manifold import trustworthiness
from sklearn.neighbors import NearestNeighbors

HERE = Path(__file__).parent


def arcs(rng, count=20, steps=100, dims=32):
    unit = lambda x: x / np.linalg.norm(x, axis=-1, keepdims=True)
    along = np.linspace(0, 2.5, steps)[:, None]
    arc = lambda: unit(np.cos(along) * unit(rng.standard_normal(dims)) + np.sin(along) * unit(rng.standard_normal(dims)))
    return np.concatenate([arc() + 0.05 * rng.standard_normal((steps, dims)) for _ in range(count)])


def judge(high, low, k=15):
    near = lambda x: NearestNeighbors(n_neighbors=k + 1).fit(x).kneighbors(x, return_distance=False)[:, 1:]
    kept = np.mean([len(set(a) & set(b)) / k for a, b in zip(near(high), near(low))])
    return trustworthiness(high, low, n_neighbors=k), kept


for name, points, kind in [
    ("arcs.f32", arcs(np.random.default_rng(0)), "<f4"),
    ("iris.f32", datasets.load_iris().data, "<f4"),
    ("digits-500.u8", datasets.load_digits().data[:500], "u1"),
]:
    points = points.astype(kind)
    (HERE / name).write_bytes(points.tobytes())
    print(name, [judge(points.astype(float), umap.UMAP(random_state=seed).fit_transform(points)) for seed in range(3)])
