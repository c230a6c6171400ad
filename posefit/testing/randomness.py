"""The state of the global random generators, which a plugin has to leave alone."""

import random
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from posefit.testing.results import expect


def _state() -> tuple[object, ...]:
    numpy_state = np.random.get_state(legacy=False)  # noqa: NPY002
    return (
        repr(numpy_state["bit_generator"]),
        numpy_state["state"]["key"].tobytes(),
        numpy_state["state"]["pos"],
        random.getstate(),
    )


@dataclass
class Watched:
    """Whether the global random generators were left as they were."""

    kept: bool = True


@contextmanager
def watched() -> Iterator[Watched]:
    """Give what says, after the body, whether it left the global random generators as they were."""
    before, found = _state(), Watched()
    yield found
    found.kept = _state() == before


@contextmanager
def left_alone() -> Iterator[None]:
    """Check that the body leaves the global random generators as they are."""
    with watched() as found:
        yield
    expect(found.kept, "the global random state must stay as it is, got another")


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """Seed the global random generators for the body, and put them back."""
    kept = np.random.get_state(), random.getstate()  # noqa: NPY002
    np.random.seed(seed)  # noqa: NPY002
    random.seed(seed)
    try:
        yield
    finally:
        np.random.set_state(kept[0])  # noqa: NPY002
        random.setstate(kept[1])
