"""Writes the notebooks from the cells below, so that they can be read and reviewed as text: python notebooks/make.py"""
import json
from pathlib import Path

HERE = Path(__file__).parent
FIND = '''from pathlib import Path
import os
recording = Path(os.environ.get("VIBES_RECORDING", "../data/sample"))'''

NOTEBOOKS = {
    "01-read-a-recording": [
        "# Read a recording\nA recording is a folder of plain Arrow and MCAP files; `data/README.md` is its specification.",
        FIND + "\nsorted(p.name for p in recording.iterdir())",
        "import json\nmanifest = json.loads((recording / 'manifest.json').read_text())\nmanifest['spec']['task'], manifest['grid'], len(manifest['episodes'])",
        "All episodes as one table. Row t holds the observation, the action taken there, and the reward that action earned; the last row has none.",
        "import polars as pl\nsteps = pl.scan_ipc(str(recording / 'episodes' / '*.arrow'))\nsteps.group_by('episode').agg(pl.len().alias('rows'), pl.col('reward').sum().alias('return')).sort('episode').collect()",
        "One picture. Its size is in the field's metadata.",
        "import numpy as np\nimport pyarrow as pa\nfirst = sorted((recording / 'episodes').glob('*.arrow'))[0]\ntable = pa.ipc.open_file(first).read_all()\nsize = {k.decode(): int(v) for k, v in table.schema.field('pixels').metadata.items()}\npixels = np.frombuffer(table['pixels'][0].as_py(), np.uint8).reshape(size['height'], size['width'], 3)\npixels.shape, pixels.mean()",
        "The same episode as messages, for Foxglove and Rerun.",
        "from mcap.reader import make_reader\nlog = first.with_suffix('.mcap')\nif log.exists():\n    with open(log, 'rb') as file:\n        summary = make_reader(file).get_summary()\n    print({c.topic: summary.statistics.channel_message_counts[i] for i, c in summary.channels.items()})",
    ],
    "02-look-at-latents": [
        "# Look at latents\nA table of latents has a row key (`episode`, `step`), the cell of the grid, and one vector a row. Here are latents without a model: the task's own observation.",
        FIND + "\nimport polars as pl, numpy as np\nsteps = pl.scan_ipc(str(recording / 'episodes' / '*.arrow'))\nrows = steps.select('episode', 'step', 'state', 'distractor', 'reward', 'observation').collect()\nlatents = rows.rename({'observation': 'latent'})\nlatents.head(3)",
        "How much do its dimensions vary?",
        "z = latents['latent'].to_numpy().astype(np.float64)\nz.shape, z.std(axis=0).round(3)",
        "The five nearest rows of other episodes in standardized L2, as `vibes-analyze nn --exclude trajectory` finds them. (Unless told otherwise it leaves out the whole state trajectory on a grid of a task with a symmetry, such as reacher's.)",
        "scaled = z / np.where(z.std(axis=0) > 0, z.std(axis=0), 1)\nquery = 7\ndistance = np.linalg.norm(scaled - scaled[query], axis=1)\ndistance[latents['episode'] == latents['episode'][query]] = np.inf\nnear = np.argsort(distance, kind='stable')[:5]\nlatents[near].select('episode', 'step').with_columns(distance=pl.Series(distance[near]))",
    ],
    "03-reproduce-figure-4": [
        "# Reproduce Figure 4\nTwo commands and their pictures. The latents here are the task's observation; put those of your run in their place.",
        FIND + "\nimport subprocess, tempfile, shutil\nimport polars as pl\nwork = Path(tempfile.mkdtemp())\nsteps = pl.scan_ipc(str(recording / 'episodes' / '*.arrow'))\nrows = steps.select('episode', 'step', 'state', 'distractor', 'reward', latent='observation').collect()\nrows.write_ipc(work / 'latents.arrow', compression='uncompressed')",
        "def analyze(*words):\n    done = subprocess.run(['vibes-analyze', *words, '--latents', work / 'latents.arrow', '-o', work], capture_output=True, text=True)\n    assert done.returncode == 0, done.stderr\n    return done.stdout.splitlines()[0]\nanalyze('nn', '--queries', '6', '--recording', recording)",
        "Figure 4b: each column a query on top and its nearest neighbours beneath.",
        "from IPython.display import Image, display\ndisplay(Image(filename=work / 'neighbours.png', width=500))",
        "Figure 4a: panels of one row share the state, panels of one column the distractor.",
        "if rows['state'].null_count() == 0:\n    print(analyze('grid'))\n    display(Image(filename=work / 'grid.png', width=500))\nelse:\n    print(analyze('umap'))\n    display(Image(filename=work / 'map-by-time.png', width=500))",
    ],
    "04-bring-your-own-latents": [
        "# Bring your own latents\nAny model will do: one vector a row, with the row's `episode` and `step`. Here a random projection of the pictures stands for the model.",
        FIND + "\nimport subprocess, tempfile\nimport numpy as np, polars as pl\nrows = pl.scan_ipc(str(recording / 'episodes' / '*.arrow')).select('episode', 'step', 'state', 'distractor', 'reward', 'pixels').collect()\nframes = np.stack([np.frombuffer(p, np.uint8) for p in rows['pixels']]).astype(np.float32) / 255\nmodel = np.random.default_rng(0).normal(size=(frames.shape[1], 16)).astype(np.float32) / frames.shape[1] ** 0.5\nlatents = frames @ model\nlatents.shape",
        "As Arrow, or as NumPy: both are read, and say the same. The cell of the grid, `state` and `distractor`, goes with them: without it neighbours would be looked for among other rows.",
        "work = Path(tempfile.mkdtemp())\nrows.drop('pixels').with_columns(latent=pl.Series(latents.tolist())).write_ipc(work / 'latents.arrow', compression='uncompressed')\nnp.savez(work / 'latents.npz', latent=latents, **{name: rows[name].to_numpy() for name in ['episode', 'step', 'state', 'distractor']})",
        "import json\nfound = {}\nfor name in ['latents.arrow', 'latents.npz']:\n    done = subprocess.run(['vibes-analyze', 'nn', '--queries', '4', '--json', '--quiet', '--latents', work / name, '--recording', recording, '-o', work / name[8:]], capture_output=True, text=True)\n    assert done.returncode == 0, done.stderr\n    found[name] = json.loads(done.stdout)['state_error']\nassert found['latents.arrow'] == found['latents.npz'], found\nfound['latents.arrow']",
    ],
    "05-train-an-encoder-in-pytorch": [
        "# Train an encoder in PyTorch\nThe environments from Python, a small encoder of your own, and the toolkit's measures of what its latents hold. Needs the package `vibes` and PyTorch (`pip install ./python torch`, in an environment as docs/python.md says); about a minute on two idle cores.",
        "import numpy as np\nimport torch\nimport torch.nn as nn\nimport vibes\nfrom vibes import measures\nrng = np.random.default_rng(0)\ntorch.manual_seed(0)\nvibes.tasks()",
        "Many environments at once, without a process of Python's own for each. A cell (i, j) of a grid is state trajectory i under distractor trajectory j: all cells of a row get the same actions, so that they are the same physics in other pictures.",
        "def play(cells, steps, **options):\n    world = vibes.World('reacher-easy', environments=len(cells), size=32, **options)\n    states = np.array([i for i, j in cells])\n    rows = [world.reset_to([(world.seed, i, j) for i, j in cells])]\n    for _ in range(steps):\n        actions = rng.uniform(-1, 1, (states.max() + 1, 2))\n        rows.append(world.step(actions[states]))\n    world.close()\n    return np.stack([row['pixels'] for row in rows], 1)",
        "For training, 30 state trajectories, each seen twice: under two distractor trajectories of its own.",
        "STATES, STEPS = 30, 40\npixels = play([(i, 2 * i + view) for i in range(STATES) for view in range(2)], STEPS, seed=0)\npixels = pixels.reshape(STATES, 2, STEPS + 1, 32, 32, 3)\npixels.shape",
        "To look at, a grid that training never sees: six other states under six distractors, with held-out videos.",
        "N, M, T = 6, 6, 20\ngrid = play([(i, j) for i in range(N) for j in range(M)], T, seed=1, video_set='val')\ni, j, t = np.indices((N, M, T + 1)).reshape(3, -1)\nkeys = {'episode': i * M + j, 'step': t, 'state': i, 'distractor': j}\ngrid.shape",
        "The encoder: three convolutions to 32 numbers. Among the pictures of a batch it learns to find the one that shows the same state under the other distractor.",
        "encoder = nn.Sequential(\n    nn.Conv2d(3, 32, 4, 2), nn.ReLU(), nn.Conv2d(32, 64, 4, 2), nn.ReLU(), nn.Conv2d(64, 64, 3, 1), nn.ReLU(), nn.Flatten(), nn.Linear(64 * 16, 32))\n\ndef encode(pictures):\n    images = torch.from_numpy(np.ascontiguousarray(pictures)).permute(0, 3, 1, 2).float() / 255 - 0.5\n    return nn.functional.normalize(encoder(images), dim=1)\n\ndef table():\n    with torch.no_grad():\n        return measures.Table(encode(grid.reshape(-1, 32, 32, 3)).numpy(), **keys)\n\nbefore = table()",
        "optimizer = torch.optim.Adam(encoder.parameters(), lr=1e-3)\nfor update in range(150):\n    which, when = rng.integers(0, STATES, 96), rng.integers(0, STEPS + 1, 96)\n    one, two = (encode(pixels[which, view, when]) for view in range(2))\n    loss = nn.functional.cross_entropy(one @ two.T / 0.1, torch.arange(96))\n    optimizer.zero_grad()\n    loss.backward()\n    optimizer.step()\nafter = table()\nloss.item()",
        "How much of the latents' variance is the state's, how much the distractor's? The 95% intervals are over the grid's trajectories, and six of each are few.",
        "for name, latents in [('before training', before), ('after', after)]:\n    shares = measures.variance_shares(latents)\n    print(name, {kind: tuple(round(shares[kind][end], 2) for end in ('estimate', 'low', 'high')) for kind in ('state_share', 'distractor_share', 'interaction_share')})",
        "Is the nearest of the other cells at the same step one of the same state?",
        "found = {name: measures.retrieval(latents, k=1)['retrieval_same_step@1'] for name, latents in [('before training', before), ('after', after)]}\nassert found['after']['estimate'] > found['before training']['estimate']\n{name: (round(one['estimate'], 2), 'chance', round(one['chance'], 2)) for name, one in found.items()}",
        "A map of the latents, for any plotting library, and the nearest rows of other trajectories, exactly.",
        "drawn = measures.umap(after, seed=0)\nnear = measures.neighbours(after, [0, 100], k=3)\ndrawn['positions'].shape, round(drawn['trustworthiness'], 3), near['rows'].tolist()",
    ],
}


def cell(text, number):
    code = not (text.startswith("# ") or text[0].isupper() and "=" not in text and "import" not in text)
    fields = {"cell_type": "code" if code else "markdown", "id": f"cell-{number}", "metadata": {}, "source": text.splitlines(keepends=True)}
    return fields | ({"execution_count": None, "outputs": []} if code else {})


for name, cells in NOTEBOOKS.items():
    notebook = {
        "cells": [cell(text, i) for i, text in enumerate(cells)],
        "metadata": {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    (HERE / f"{name}.ipynb").write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n")
