"""What stands between a fresh clone and these tests: the environments that the Makefile makes, and what pages and messages say of installing."""

import json
import os
import re
import subprocess
import sys

import pytest
from conftest import ROOT

SCRIPT = ROOT / "setup" / "environment.sh"


def environment(requirements, folder, *options, **variables):
    """What setup/environment.sh did and said. The packages of these tests are none, or one that is not there, so that nothing is fetched."""
    return subprocess.run([SCRIPT, *options, requirements, folder], env=os.environ | variables, capture_output=True, text=True)


def test_an_environment_is_whole_and_of_the_present_list(tmp_path):
    requirements, folder = tmp_path / "list.txt", tmp_path / "made" / "environment"
    requirements.write_text(f"{tmp_path}/nothing-there\n")
    failed = environment(requirements, folder)
    # The environment's own programs are there, as they are when an installation is cut short, and it is not taken for a whole one.
    assert failed.returncode != 0 and "could not install" in failed.stderr and (folder / "bin" / "python").exists()
    assert environment(requirements, folder).returncode != 0
    requirements.write_text("# nothing\n")
    assert "installing" in environment(requirements, folder).stdout
    (folder / "mine").touch()
    assert environment(requirements, folder).stdout == ""
    requirements.write_text("# nothing, in other words\n")
    assert environment(requirements, folder).stdout == "", "comments do not count"
    requirements.write_text(f"{tmp_path}/nothing-there\n")
    assert environment(requirements, folder).returncode != 0, "the list has changed"
    requirements.write_text("# nothing\n")
    assert "installing" in environment(requirements, folder).stdout, "what failed since is not whole"
    assert (folder / "mine").exists(), "the folder may be the user's own"
    requirements.write_text(f"{tmp_path}/nothing-there\n")
    environment(requirements, folder, "--anew")
    assert not (folder / "mine").exists()


def test_an_environment_is_made_for_whoever_has_pip_install_for_the_user_alone(tmp_path):
    requirements = tmp_path / "list.txt"
    requirements.write_text("# nothing\n")
    made = environment(requirements, tmp_path / "environment", PIP_USER="1")
    assert made.returncode == 0, made.stderr


def test_what_venv_says_of_its_failure_is_not_hidden(tmp_path):
    requirements, python = tmp_path / "list.txt", tmp_path / "bin" / "python3"
    requirements.write_text("# nothing\n")
    python.parent.mkdir()
    python.write_text("#!/bin/sh\necho 'No space left on device' >&2\nexit 1\n")
    python.chmod(0o755)
    failed = environment(requirements, tmp_path / "environment", PATH=f"{python.parent}:{os.environ['PATH']}")
    assert failed.returncode != 0 and "No space left on device" in failed.stderr


@pytest.mark.parametrize(("goal", "requirements"), [("python-test", "python/tests/requirements.txt"), ("sweep-test", "tests/sweep_engines.txt")])
def test_the_makefile_looks_at_the_list_whatever_is_there(goal, requirements, tmp_path):
    (tmp_path / "bin").mkdir()
    for name in ["pytest", "ray"]:
        (tmp_path / "bin" / name).touch(0o755)
    words = ["make", "--dry-run", "--directory", ROOT, goal, f"PYTHON_TEST={tmp_path}", f"SWEEP_TEST={tmp_path}"]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert f'setup/environment.sh {requirements} "{tmp_path}"' in said


@pytest.mark.parametrize(("notebook", "command"), [("01", "pip install -r setup/python.txt"), ("05", "pip install ./python torch")])
def test_a_notebook_says_how_what_it_needs_comes_here(notebook, command):
    # Without the site's packages nothing is there.
    done = subprocess.run([sys.executable, "-IS", ROOT / "notebooks" / "run.py", notebook], capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.strip().endswith(command), done.stderr


def test_what_the_examples_import_is_in_the_list_that_they_name():
    engines, packages = ((ROOT / name).read_text() for name in ["tests/sweep_engines.txt", "setup/python.txt"])
    page = (ROOT / "examples" / "README.md").read_text()
    for name, package in [("optuna_search.py", "optuna"), ("wandb_run.py", "wandb")]:
        example = (ROOT / "examples" / name).read_text()
        assert f"import {package}\n" in example and f"\n{package}>=" in engines and f"\n{package}==" not in packages
        assert "tests/sweep_engines.txt" in example
        assert f"`{package}`" in page and "tests/sweep_engines.txt" in page


def test_gymnasium_is_as_new_as_what_is_imported_of_it():
    """AutoresetMode came with 1.1."""
    for name in ["python/pyproject.toml", "python/tests/requirements.txt"]:
        (oldest,) = re.findall(r"gymnasium>=([0-9.]+)", (ROOT / name).read_text())
        assert tuple(map(int, oldest.split("."))) >= (1, 1), name


def test_pages_that_install_the_package_make_an_environment_first():
    """Debian's and Ubuntu's own Python lets pip install nothing."""
    for name in ["README.md", "docs/python.md", "python/README.md", "examples/README.md"]:
        assert "python3 -m venv" in (ROOT / name).read_text(), f"{name} installs into the system's Python"
    for name in ["docs/python.md", "python/README.md"]:
        page = (ROOT / name).read_text()
        assert 0 <= page.find("python3 -m venv .venv && . .venv/bin/activate") < page.find("pip install")
    assert "/.venv\n" in (ROOT / ".gitignore").read_text()
    cells = json.loads((ROOT / "notebooks" / "05-train-an-encoder-in-pytorch.ipynb").read_text())["cells"]
    assert "pip install ./python torch" in "".join(cells[0]["source"])
