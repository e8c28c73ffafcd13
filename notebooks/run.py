"""Runs the notebooks' code cells top to bottom without Jupyter: python notebooks/run.py [01 02 …]

Needs the packages of setup/python.txt; `make test` runs it in an environment of its own that has them. The fifth needs vibes and PyTorch instead, and is run
only when it is named, as `make python-test` does. VIBES_RECORDING names another recording than data/sample. Pictures are checked to exist, not shown.
"""
import importlib.util
import json
import os
import sys
import types
from pathlib import Path

HERE = Path(__file__).parent.resolve()
wanted = sys.argv[1:] or ["01", "02", "03", "04"]
for named, needed, command in [
    ([name for name in wanted if name != "05"], ["numpy", "polars", "pyarrow", "mcap"], "pip install -r setup/python.txt"),
    ([name for name in wanted if name == "05"], ["numpy", "vibes", "torch"], "make setup && pip install ./python torch"),
]:
    missing = [name for name in needed if named and importlib.util.find_spec(name) is None]
    if missing:
        sys.exit(f"notebooks: these Python packages are missing: {', '.join(missing)}; run, in an environment of your own: {command}")


class Image:
    """Stands for a picture in a notebook."""

    def __init__(self, filename, width=None):
        assert Path(filename).stat().st_size > 1000, f"no picture: {filename}"


shown = types.ModuleType("IPython.display")
shown.Image, shown.display = Image, lambda *_: None
sys.modules.setdefault("IPython", types.ModuleType("IPython"))
sys.modules["IPython.display"] = shown
os.chdir(HERE)
notebooks = sorted(path for path in HERE.glob("[0-9]*.ipynb") if path.name[:2] in wanted)
assert notebooks, "no notebooks found"
for path in notebooks:
    names = {}
    for number, cell in enumerate(json.loads(path.read_text())["cells"]):
        if cell["cell_type"] == "code":
            try:
                exec(compile("".join(cell["source"]), f"{path.name}, cell {number}", "exec"), names)
            except Exception as error:
                sys.exit(f"notebooks: {path.name}, cell {number}: {type(error).__name__}: {error}")
    print(f"notebooks: {path.name} ran")
