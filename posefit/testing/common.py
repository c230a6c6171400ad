"""What the rules of several kinds of plugins share: signatures, settings that make no sense, global randomness."""

import copy
import inspect
import pickle
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal, get_origin

import numpy as np

from posefit.settings import settings_of
from posefit.testing.results import BrokenError, SkippedError, expect


@dataclass(frozen=True)
class PluginCase:
    """A factory with its settings."""

    factory: Callable[..., Any]
    settings: dict[str, Any] = field(default_factory=dict)


def duplicates(plugin: Any) -> dict[str, Any]:
    """Return a deep copy of a plugin, and what comes out of its pickle."""
    ways: dict[str, Callable[[Any], Any]] = {
        "a deep copy": copy.deepcopy,
        "a pickle": lambda original: pickle.loads(pickle.dumps(original)),
    }
    made = {}
    for what, duplicate in ways.items():
        try:
            made[what] = duplicate(plugin)
        except Exception as error:
            raise BrokenError(f"{what} of it must be possible, got {type(error).__name__}: {error}") from None
    return made


def check_signature(factory: Callable[..., Any], *arguments: str) -> None:
    """Check that a factory takes these arguments by position, and only named keyword-only settings beside them."""
    kinds = [one.kind for one in inspect.signature(factory).parameters.values()]
    by_position = [kind for kind in kinds if kind is not inspect.Parameter.KEYWORD_ONLY]
    expect(
        len(by_position) == len(arguments),
        f"a factory must take ({', '.join(arguments)}) and keyword-only settings, got {len(by_position)} others",
    )
    expect(inspect.Parameter.VAR_KEYWORD not in kinds, "settings must be named, got **settings that swallow mistakes")


def check_unknown_setting(build: Callable[..., Any]) -> None:
    """Check that a setting which does not exist raises TypeError."""
    try:
        build(no_such_setting=1)
    except TypeError:
        return
    expect(False, "an unknown setting must raise TypeError, got none")


def check_nonsense(factory: Callable[..., Any], build: Callable[..., Any], *, harmless: bool = False) -> str:
    """Check that `build` raises ValueError for nonsense in each setting, or is harmless; return which did."""
    refused: list[str] = []
    for setting in settings_of(factory):
        kind = setting.annotation if setting.annotation is not inspect.Parameter.empty else type(setting.default)
        choice = get_origin(kind) is Literal or setting.name == "variant"
        if not choice and kind not in (int, float):
            continue
        nonsense: object = "no such choice" if choice else -1 if kind is int else float("nan")
        try:
            build(**{setting.name: nonsense})
        except ValueError:
            refused.append(setting.name)
        else:
            expect(harmless, f"{setting.name}={nonsense} must raise ValueError, got none")
    if not refused and not harmless:
        raise SkippedError("it has no settings that could be nonsense")
    return f"refused: {', '.join(refused) or 'none'}"


def global_random_state() -> tuple[object, ...]:
    """Return the state of the global random generators, to be compared."""
    numpy_state = np.random.get_state(legacy=False)  # noqa: NPY002
    words = numpy_state["state"]
    return repr(numpy_state["bit_generator"]), words["key"].tobytes(), words["pos"], random.getstate()


@contextmanager
def left_alone() -> Iterator[None]:
    """Check that the body leaves the global random generators as they are."""
    before = global_random_state()
    yield
    expect(global_random_state() == before, "the global random state must stay as it is, got another")


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """Seed the global random generators for the body, and put them back."""
    before = np.random.get_state(), random.getstate()  # noqa: NPY002
    np.random.seed(seed)  # noqa: NPY002
    random.seed(seed)
    try:
        yield
    finally:
        np.random.set_state(before[0])  # noqa: NPY002
        random.setstate(before[1])
