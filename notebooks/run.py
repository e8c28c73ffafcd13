"""Runs the notebooks' code cells top to bottom without Jupyter: python notebooks/run.py

Needs polars, pyarrow, mcap and numpy; VIBES_RECORDING names another recording than data/sample. Pictures are checked to exist, not shown.
Exits with 0 and says so when a needed package is missing, so that a machine without them can still run every other check.
"""
import importlib.util
import json
import os
import sys
import types
from pathlib import Path

HERE = Path(__file__).parent.resolve()
# The fifth asks for the Python package and PyTorch; `make python-test` names it.
wanted = sys.argv[1:] or ["01", "02", "03", "04"]
needed = ["numpy", "vibes", "torch"] if wanted == ["05"] else ["numpy", "polars", "pyarrow", "mcap"]
missing = [name for name in needed if importlib.util.find_spec(name) is None]
if missing:
    print(f"notebooks: skipped, these Python packages are missing: {', '.join(missing)}")
    sys.exit(0)


class Image:
    """Stands for a picture in a notebook."""

    def __init__(self, filename, width=None):
        assert Path(filename).stat().st_size > 1000, f"no picture: {filename}"


shown = types.ModuleType("IPython.display")
shown.Image, shown.display = Image, lambda *_: None
sys.modules.setdefault("IPython", types.ModuleType("IPython"))
sys.modules["IPython.display"] = shown
os.chdir(HERE)
for path in sorted(path for path in HERE.glob("[0-9]*.ipynb") if path.name[:2] in wanted):
    names = {}
    for number, cell in enumerate(json.loads(path.read_text())["cells"]):
        if cell["cell_type"] == "code":
            try:
                exec(compile("".join(cell["source"]), f"{path.name}, cell {number}", "exec"), names)
            except Exception as error:
                sys.exit(f"notebooks: {path.name}, cell {number}: {type(error).__name__}: {error}")
    print(f"notebooks: {path.name} ran")
