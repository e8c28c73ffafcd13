"""The notebooks are those that make.py writes, and do what they say."""

import json
import re
import shutil
import subprocess
import sys

import numpy as np
from conftest import ROOT, program

NOTEBOOKS = ROOT / "notebooks"


def test_the_notebooks_are_those_that_make_py_writes(tmp_path):
    shutil.copy(NOTEBOOKS / "make.py", tmp_path)
    subprocess.run([sys.executable, tmp_path / "make.py"], check=True)
    written = {path.name: path.read_text() for path in tmp_path.glob("*.ipynb")}
    assert written == {path.name: path.read_text() for path in NOTEBOOKS.glob("*.ipynb")}


def test_the_second_finds_the_neighbours_that_the_command_it_names_finds(sample, tmp_path, monkeypatch):
    cells = json.loads((NOTEBOOKS / "02-look-at-latents.ipynb").read_text())["cells"]
    (words,) = re.findall(r"as `vibes-analyze (nn[^`]*)` finds them", "".join("".join(cell["source"]) for cell in cells))
    monkeypatch.setenv("VIBES_RECORDING", str(sample))
    names = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    latents, near = names["latents"], names["near"]
    latents.write_ipc(tmp_path / "latents.arrow", compression="uncompressed")
    query = "{}:{}".format(*latents.select("episode", "step").row(names["query"]))
    options = ["--rows", query, "--quiet", "--latents", tmp_path / "latents.arrow", "--recording", sample, "-o", tmp_path / "out"]
    done = subprocess.run([program("vibes-analyze"), *words.split(), *options], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (found,) = json.loads((tmp_path / "out" / "neighbours.json").read_text())["queries"]
    np.testing.assert_allclose(found["distance"], names["distance"][near], rtol=1e-5)
