"""Environments, recordings, measures and trained models of the VIBES toolkit, as numpy arrays.

    import vibes

    env = vibes.make("reacher-easy", difficulty="easy", seed=0)         # Gymnasium; make_dm for dm_env, make_vec for many at once
    recording = vibes.open("recordings/reacher-easy-10x10")             # episodes and training windows
    table = vibes.measures.Table(latents, recording=recording)
    shares = vibes.measures.variance_shares(table)                      # what the latents hold, with intervals
    latents = vibes.load("runs/reacher").encode(recording[0])           # a trained model

Everything works with numpy alone except ``make`` and ``make_vec``, which need Gymnasium, and ``make_dm``, which needs dm_env.

A value that cannot be right (a name that is not known, a number out of range, an array of another shape or kind, a file that is missing or damaged) raises
:class:`vibes.Error` with the toolkit's own message, and so does whatever goes wrong at work. What Python refuses by itself stays Python's: TypeError or
AttributeError for a parameter that does not exist or an object of another class, IndexError past the end of a sequence, ImportError for a missing package.
"""

from . import measures
from ._vibes import Error, __version__
from .make import make, make_dm, make_vec, tasks
from .models import Model, load
from .recordings import Episode, Recording, WindowDataset, Windows, open, windows
from .registry import register
from .world import World
from .writer import Writer

register()

__all__ = [
    "Episode",
    "Error",
    "Model",
    "Recording",
    "WindowDataset",
    "Windows",
    "World",
    "Writer",
    "__version__",
    "load",
    "make",
    "make_dm",
    "make_vec",
    "measures",
    "open",
    "tasks",
    "windows",
]
