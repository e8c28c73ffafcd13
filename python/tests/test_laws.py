"""Laws over the package's public names, so that what is added is tested without a new test.

Every public function, class, method and property is called with arguments of every kind, and returns or raises an ordinary exception; the stubs of the
extension module say what it has. `test_hypothesis.py` goes deeper where arguments belong together.
"""

import inspect
import subprocess
import sys

import numpy as np
import pytest
import vibes
from hypothesis import given, settings
from hypothesis import strategies as st
from test_hypothesis import arrays, numbers, tried, words

MODULES = (vibes, vibes.measures)
SMALL = {"environments": 3, "num_envs": 3, "threads": 8, "epochs": 30, "episodes": 2, "size": 64, "batch": 50, "length": 50}
"""Numbers that name an amount of work: nobody waits for a million environments. Larger ones that are refused are in test_hypothesis.py."""
SPECIAL = ("__call__", "__getitem__", "__len__", "__iter__", "__enter__", "__repr__", "__reduce__")


def public():
    """Every public function and class by its full name."""
    found = {}
    for module in MODULES:
        names = getattr(module, "__all__", None) or [name for name in vars(module) if not name.startswith("_")]
        for name in names:
            value = getattr(module, name)
            if callable(value) and getattr(value, "__module__", "").startswith("vibes") and value is not vibes.Error:
                found[f"{module.__name__}.{name}"] = value
    return found


def members(kind):
    """The public methods and properties of a class, those of its bases in this package included."""
    for base in inspect.getmro(kind):
        if base.__module__.startswith("vibes"):
            yield from (name for name in vars(base) if not name.startswith("_") or name in SPECIAL)


CALLABLES = public()
METHODS = sorted({(name, member) for name, kind in CALLABLES.items() if inspect.isclass(kind) for member in members(kind)})


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("laws")


@pytest.fixture(scope="module")
def things(sample, folder):
    """One of every class, made anew for every example, by the name of the class; and by the names of parameters."""
    recording = vibes.open(sample)
    spec = {"task": "any", "action_low": [-1], "action_high": [1], "observation": {"x": 1}}
    counted = iter(range(1_000_000))
    rng = np.random.default_rng(0)
    keys = {name: values.ravel() for name, values in zip(["state", "distractor", "step"], np.indices((3, 3, 4)))}
    table = vibes.measures.Table(rng.normal(size=(36, 3)), episode=keys["state"] * 3 + keys["distractor"], **keys)
    model = sample.parents[1] / "checkpoints" / "cartpole-swingup"
    return {
        "Episode": lambda: recording[0],
        "Model": lambda: vibes.load(model),
        "Recording": lambda: vibes.open(sample),
        "Table": lambda: table,
        "WindowDataset": lambda: recording.dataset(length=4),
        "Windows": lambda: recording.windows(length=4, batch=2),
        "World": lambda: vibes.World(size=None, environments=2, action_repeat=500),
        "Writer": lambda: vibes.Writer(folder / f"written-{next(counted)}", spec=spec, mcap=False),
    }


def argument(name, things):
    """What may come for a parameter of this name: what belongs there, and everything else."""
    junk = st.one_of(words, arrays, st.dictionaries(st.text(max_size=4), numbers, max_size=2))
    if name in SMALL:
        return st.one_of(st.integers(-2, SMALL[name]), junk.filter(lambda value: not isinstance(value, (int, float))))
    fitting = {"table": "Table", "past_actions": "Table", "recording": "Recording", "observations": "Episode", "writer": "Writer"}
    if name in fitting:
        return st.one_of(st.builds(things[fitting[name]]), junk)
    if name == "policy":
        return st.one_of(st.just(lambda observation: [0.0, 0.0]), junk)
    if name in ("path", "paths", "videos"):
        # Names of nothing that is there: a folder of videos may be anybody's.
        return st.sampled_from(["", "nothing", "\0", b"nothing", None, 3, 0.5, [], ["nothing"]])
    return junk


def called(data, function, things):
    """Calls it with drawn arguments."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:
        return
    given_by_place, named = [], {}
    for parameter in parameters:
        drawn = argument(parameter.name, things)
        if parameter.kind == parameter.VAR_KEYWORD:
            named |= data.draw(st.dictionaries(st.sampled_from(["size", "task", "action", "reward", "x"]), words, max_size=2))
        elif parameter.kind == parameter.VAR_POSITIONAL:
            continue
        elif parameter.default is not parameter.empty and data.draw(st.booleans()):
            continue
        elif parameter.kind == parameter.KEYWORD_ONLY or parameter.default is not parameter.empty:
            named[parameter.name] = data.draw(drawn, label=parameter.name)
        else:
            given_by_place.append(data.draw(drawn, label=parameter.name))
    tried(lambda: function(*given_by_place, **named))


@pytest.mark.parametrize("name", CALLABLES)
@given(data=st.data())
@settings(max_examples=12)
def test_every_public_function_returns_or_raises(name, data, things, folder):
    function = CALLABLES[name]
    if function is vibes.World or name in ("vibes.make", "vibes.make_vec", "vibes.make_dm"):
        # Pictures are in test_hypothesis.py; here every example would open a window's worth of OpenGL.
        made = function
        function = lambda **options: made(**options | ({"size": None} if made is vibes.World else {"observation": "state"}))
        function.__signature__ = inspect.signature(made)
    called(data, function, things)


@pytest.mark.parametrize(("name", "member"), METHODS, ids=lambda value: value)
@given(data=st.data())
@settings(max_examples=6)
def test_every_public_method_returns_or_raises(name, member, data, things):
    kind = name.rpartition(".")[2]
    assert kind in things, f"a new public class; add how to make a {kind} to the things above"
    thing = things[kind]()
    if not callable(inspect.getattr_static(type(thing), member)):
        tried(lambda: getattr(thing, member))
    else:
        called(data, getattr(thing, member), things)


def test_the_stubs_say_what_the_extension_has():
    done = subprocess.run([sys.executable, "-m", "mypy.stubtest", "vibes._vibes"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_package_is_typed_and_every_public_name_is_documented():
    for name, value in CALLABLES.items():
        assert inspect.getdoc(value), f"{name} has no docstring"
    for name, member in METHODS:
        static = inspect.getattr_static(CALLABLES[name], member)
        assert member in SPECIAL or not callable(static) or inspect.getdoc(static), f"{name}.{member} has no docstring"
    for name in vibes.__all__:
        assert hasattr(vibes, name)
