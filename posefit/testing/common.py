"""Rules that several kinds of plugins share, and the parts of other rules."""

import copy
import inspect
import io
import pickle
import random
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from posefit import hints
from posefit.reading import quoted
from posefit.settings import settings_of
from posefit.testing.results import BrokenError, SkippedError, expect


@dataclass(frozen=True)
class PluginCase:
    """A factory with its settings."""

    # names of the positional arguments of a factory of the kind
    arguments: ClassVar[tuple[str, ...]] = ()

    factory: Callable[..., Any]
    settings: dict[str, Any] = field(default_factory=dict)

    def build(self, **more: Any) -> Any:
        """Return a new plugin, with additional or replaced settings."""
        return self.factory(**{**self.settings, **more})

    def use(self, **more: Any) -> object:
        """Build a plugin and use it a little: some invalid settings show only then."""
        return self.build(**more)

    @property
    def random_unchanged(self) -> bool:
        """Whether an earlier use left the global random generators unchanged."""
        return False

    def use_fully(self) -> object:
        """Use a new plugin as its caller does."""
        return self.use()


def construction(case: PluginCase) -> None:
    """A factory takes the arguments of its kind, and keyword-only settings."""
    parameters = inspect.signature(case.factory).parameters
    by_position = []
    for name, parameter in parameters.items():
        expect(
            parameter.kind is not inspect.Parameter.VAR_KEYWORD,
            "settings must be named, got **settings that swallow mistakes",
        )
        if parameter.kind is not inspect.Parameter.KEYWORD_ONLY:
            by_position.append(name)
    taken = ", ".join(case.arguments)
    more = ", ".join(by_position[len(case.arguments) :])
    came = f"({', '.join(by_position)})"
    if more:
        came = f"{more} before the *"
    expect(
        len(by_position) == len(case.arguments),
        f"a factory must take ({taken}) and keyword-only settings, got {came}",
    )
    for setting in settings_of(case.factory):
        if setting.annotation is inspect.Parameter.empty:
            kind = type(setting.default).__name__
            raise BrokenError(
                "a setting must have a type, "
                f"such as {setting.name}: {kind} = {setting.default}, got none"
            )
        expect(
            hints.checkable(setting.annotation),
            f"the type of the setting {setting.name} must be {hints.KNOWN}, "
            f"got {setting.type}",
        )
        # a default that its own type refuses would fail for every user
        if setting.default is not inspect.Parameter.empty:
            try:
                hints.fitted(setting.annotation, setting.default)
            except hints.UnfitError:
                raise BrokenError(
                    f"the default of {setting.name} must be {setting.type}, "
                    f"got {setting.default!r}"
                ) from None
    case.build()


def silence(case: PluginCase) -> None:
    """The plugin prints nothing."""
    with redirect_stdout(io.StringIO()) as printed:
        case.use()
    expect(
        not printed.getvalue(),
        f"a plugin must print nothing, got {quoted(printed.getvalue())}",
    )


def global_randomness(case: PluginCase) -> None:
    """The plugin neither uses nor changes the global random generators."""
    # a library that was imported during the first use may have seeded them
    if not case.random_unchanged:
        with left_alone():
            case.use_fully()


def unknown_setting(case: PluginCase) -> None:
    """The factory refuses an unknown setting."""
    try:
        case.build(no_such_setting=1)
    except TypeError:
        return
    raise BrokenError("an unknown setting must raise TypeError, got none")


def nonsense_settings(case: PluginCase, *, harmless: bool = False) -> str:
    """The plugin refuses invalid values of its settings."""
    tried = 0
    refused = list[str]()
    for setting in settings_of(case.factory):
        kind = setting.annotation
        if kind is inspect.Parameter.empty:
            kind = type(setting.default)
        nonsense: object
        if hints.choices_of(kind) or setting.name == "variant":
            nonsense = "no such choice"
        elif kind is int:
            nonsense = -1
        elif kind is float:
            nonsense = float("nan")
        else:
            # of other types, no value is nonsense for every plugin
            continue
        tried += 1
        try:
            case.use(**{setting.name: nonsense})
        except ValueError:
            refused.append(setting.name)
        else:
            expect(
                harmless, f"{setting.name}={nonsense} must raise ValueError, got none"
            )
    if not tried:
        raise SkippedError("it has no settings that could be nonsense")
    return f"refused: {', '.join(refused) or 'none'}"


def check_speed(what: str, limit: float, work: Callable[[int], int]) -> str:
    """Check the time that `work` takes for each item it makes.

    Args:
        what: The item, as the messages name it.
        limit: Seconds that an item may take, in the fastest of three turns.
        work: Takes the number of the turn; returns how many items it made.

    Returns:
        The time for an item, as text.
    """
    seconds = np.inf
    # the fastest of three, because other processes may slow one down
    for turn in range(3):
        began = time.perf_counter()
        count = work(turn)
        seconds = min(seconds, (time.perf_counter() - began) / max(count, 1))
    expect(
        seconds < limit,
        f"{what} must take less than {1e3 * limit:g} ms, got {1e3 * seconds:.3g}",
    )
    return f"{1e6 * seconds:.1f} us {what}"


def duplicates(plugin: Any) -> dict[str, Any]:
    """Return a deep copy and an unpickled copy of a plugin, by name."""
    ways: dict[str, Callable[[Any], Any]] = {
        "a deep copy": copy.deepcopy,
        "a pickle": lambda original: pickle.loads(pickle.dumps(original)),
    }
    made = {}
    for what, duplicate in ways.items():
        try:
            made[what] = duplicate(plugin)
        except Exception as error:
            raise BrokenError(
                f"{what} of it must be possible, got {type(error).__name__}: {error}"
            ) from None
    return made


def unchanged(*arrays: NDArray[Any]) -> Callable[[], bool]:
    """Return a function that tells whether the arrays still have their values."""
    before = [array.copy() for array in arrays]
    return lambda: all(map(np.array_equal, before, arrays))


def global_random_state() -> tuple[object, ...]:
    """Return the state of the global random generators, for comparison."""
    numpy_state = np.random.get_state(legacy=False)  # noqa: NPY002
    words = numpy_state["state"]
    return (
        repr(numpy_state["bit_generator"]),
        words["key"].tobytes(),
        words["pos"],
        random.getstate(),
    )


@contextmanager
def left_alone() -> Iterator[None]:
    """Check that the body leaves the global random generators unchanged."""
    before = global_random_state()
    yield
    expect(
        global_random_state() == before,
        "the global random state must not change, got another",
    )
