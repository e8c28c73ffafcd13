"""What a caller passes, looked at before it reaches the extension.

In: a value and what it is called. Out: the value as the extension takes it, or ``vibes.Error``, which names the parameter and says what would be right. The
extension's own conversions would say only which of Rust's types they wanted.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from . import _vibes

if TYPE_CHECKING:
    from .recordings import Recording


def checked_whole(number: Any, what: str) -> int:
    """A whole number whose bounds the extension knows and says, or what would be one."""
    return _between(number, what, -(2**63), 2**63 - 1, "a whole number of 64 bits")


def checked_seed(seed: Any, what: str = "the seed") -> int:
    """A seed, or what would be one."""
    return _between(seed, what, 0, 2**64 - 1, "a whole number from 0 to 2**64 - 1")


def checked_number(number: Any, what: str = "the number") -> int:
    """The number of an episode or trajectory, or how many of something there are, or what would be one."""
    return _between(number, what, 0, 2**32 - 1, "a whole number from 0 to 2**32 - 1")


def _between(number: Any, what: str, least: int, most: int, right: str) -> int:
    # True and False are whole numbers to Python, and mistakes here.
    if isinstance(number, (int, np.integer)) and not isinstance(number, bool) and least <= int(number) <= most:
        return int(number)
    raise _vibes.Error(f"{what} {number!r}; right is {right}")


def checked_real(number: Any, what: str) -> float:
    """A number, or what would be one. Text is none, even where Python could read it, and neither are True and False."""
    try:
        if not isinstance(number, (str, bytes, bool, np.bool_)):
            return float(number)
    except (TypeError, ValueError, OverflowError):
        pass
    raise _vibes.Error(f"{what} {number!r}; right is a number")


def checked_flag(flag: Any, what: str) -> bool:
    """True or False, also as 1 and 0 or as a numpy number or array without dimensions, or what would be right. To Python anything has a truth value: "no" would be True."""
    if isinstance(flag, bool):
        return flag
    array = checked_array(what, flag, "True or False")
    if array.ndim == 0 and array.dtype.kind in "biuf" and array in (0, 1):
        return bool(array)
    raise _vibes.Error(f"{what} {flag!r}; right is True or False")


def checked_name(name: Any, what: str) -> str:
    """A name as text; which names there are the extension knows and says."""
    if not isinstance(name, str):
        raise _vibes.Error(f"{what} {name!r}; right is a name, as text")
    return name


def checked_axes(distract: Any) -> list[str]:
    """The names of distractors, from one text with commas or from several."""
    names: list[Any]
    try:
        names = distract.split(",") if isinstance(distract, str) else list(() if distract is None else distract)
    except (TypeError, ValueError):
        names = [None]
    if not all(isinstance(name, str) for name in names):
        raise _vibes.Error(f"distract {distract!r}; right is some of background, camera and color, as text or one by one, or \"none\"")
    return names


def checked_options(options: Any, known: Iterable[str]) -> dict[str, Any]:
    """The options of a reset, which may be left out; a name that is not known is an error."""
    known = list(known)
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise _vibes.Error(f"reset options {options!r}; right is a dictionary, known are {', '.join(known)}")
    if unknown := set(options) - set(known):
        raise _vibes.Error(f"unknown reset options {sorted(map(str, unknown))}; known are {', '.join(known)}")
    return dict(options)


def checked_array(what: str, values: Any, right: str, dtype: DTypeLike | None = None) -> NDArray[Any]:
    """Numbers of any shape as an array, row after row in memory; ``right`` says what would be right where they are none.

    numpy lays them out so before the extension copies them, because it gives the interpreter's lock away while it does and the extension's copy holds it.
    """
    try:
        array = np.asarray(values)
        # Text that could be read as numbers, times and complex numbers are mistakes.
        if array.dtype.kind not in "cmMSU":
            return np.asarray(array, dtype, order="C")
    except Exception as error:
        # Rows of different lengths; a tensor that needs a gradient or lies on another device. Whoever made it says best what is the matter.
        raise _vibes.Error(f"{what} that numpy cannot read ({error}); right is {right}") from error
    raise _vibes.Error(f"{what} of type {array.dtype}; right is {right}")


def checked_shape(what: str, values: Any, shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Numbers of this shape in single precision, or what would be right."""
    array = checked_array(what, values, f"numbers {list(shape)}", np.float32)
    if array.shape != shape:
        raise _vibes.Error(f"{what} of shape {list(array.shape)}; right is {list(shape)}")
    return array


def checked_finite(what: str, values: NDArray[Any]) -> NDArray[Any]:
    """Numbers that are all finite, or which of them is not."""
    if not (finite := np.isfinite(values)).all():
        raise _vibes.Error(f"{values[~finite][0]} in {what}; right is finite numbers")
    return values


def checked_episodes(recording: Recording) -> None:
    """That a recording has episodes whose rows can be measured or encoded, or that it has none."""
    if len(recording) == 0:
        raise _vibes.Error(f"the recording has no finished episode; right is at least one: {recording.path}")


def checked_choice(what: str, which: Any, environments: int) -> NDArray[np.bool_]:
    """Which of the environments, as truth values; all of them where nothing is given. Their numbers would be taken for truth values, and are refused."""
    if which is None:
        return np.ones(environments, bool)
    array = checked_array(what, which, f"truth values [{environments}]")
    if array.dtype.kind != "b" or array.shape != (environments,):
        raise _vibes.Error(f"{what} of type {array.dtype} and shape {list(array.shape)}; right is truth values [{environments}]")
    return array
