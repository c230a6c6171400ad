"""A library that calls the objective itself is asked and told, and leaves no thread behind."""

import copy
import gc
import pickle
import threading
from functools import partial
from typing import Any

import numpy as np
import pytest

from posefit import minimise
from posefit.arrays import Array
from posefit.testing.toy import Toy, ball, sphere
from posefit_bridges.optimisers import Bridge, GlobalRandom, called_back
from tests.cases import each


def climbs(space: Toy, rng: np.random.Generator, objective: Any) -> None:
    """A library as they are: it calls the objective, and returns at the end."""
    place, cost = np.zeros(space.dimensions), np.inf
    for _ in range(20):
        near = place + 0.3 * rng.standard_normal((5, space.dimensions))
        costs = objective(near)
        if costs.min() < cost:
            place, cost = near[costs.argmin()], costs.min()


def fails(space: Toy, rng: np.random.Generator, objective: Any) -> None:
    objective(np.zeros((2, space.dimensions)))
    raise OSError("out of paper")


def bridges() -> set[threading.Thread]:
    gc.collect()
    return {thread for thread in threading.enumerate() if thread.name == "posefit_bridges.optimisers"}


def test_costs_reach_the_proposals_they_belong_to() -> None:
    calls: list[tuple[Array, Array]] = []

    def library(space: Toy, rng: np.random.Generator, objective: Any) -> None:
        for k in range(5):
            asked = np.full((3, 2), 0.1 * k) + [[0.0], [0.01], [0.02]]
            calls.append((asked, objective(asked)))

    optimiser = Bridge(Toy(2), np.random.default_rng(0), partial(called_back, library))
    while len(asked := optimiser.ask()):
        np.testing.assert_array_equal(optimiser.ask(), asked)  # asking again changes nothing
        optimiser.tell(asked, asked.sum(axis=1))
    assert len(calls) == 5
    for asked, costs in calls:
        np.testing.assert_array_equal(costs, asked.sum(axis=1))


def test_no_thread_outlives_its_search_or_an_error_in_it() -> None:
    before = bridges()
    for steps in (0, 1, 7, 20):
        optimiser = Bridge(Toy(3), np.random.default_rng(steps), partial(called_back, climbs))
        for _ in range(steps):
            proposals = optimiser.ask()
            optimiser.tell(proposals, sphere(proposals))
    del optimiser
    assert bridges() <= before

    def breaks(proposals: Array) -> Array:
        raise RuntimeError("the cost failed")

    with pytest.raises(RuntimeError, match="the cost failed"):
        minimise(breaks, Bridge(Toy(3), np.random.default_rng(0), partial(called_back, climbs)), 100)
    assert bridges() <= before


def test_what_the_library_raises_is_raised_where_it_is_asked() -> None:
    with pytest.raises(RuntimeError, match="the library failed: OSError: out of paper"):
        minimise(sphere, Bridge(Toy(3), np.random.default_rng(0), partial(called_back, fails)), 100)


@each("copied", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_copy_goes_on_as_the_original(copied: Any) -> None:
    space = Toy(3, ball)
    first = Bridge(space, np.random.default_rng(0), partial(called_back, climbs))
    for _ in range(4):
        proposals = first.ask()
        first.tell(proposals, sphere(proposals))
    second = copied(first)
    for _ in range(5):
        proposals = first.ask()
        assert space.feasible(proposals).all()
        np.testing.assert_array_equal(second.ask(), proposals)
        first.tell(proposals, sphere(proposals))
        second.tell(proposals, sphere(proposals))


def test_a_borrowed_global_generator_is_put_back() -> None:
    def draws(generator: GlobalRandom) -> list[float]:
        with generator:
            return [float(np.random.rand()) for _ in range(2)]  # noqa: NPY002

    before = np.random.get_state()[1].copy()  # type: ignore[index, union-attr]  # noqa: NPY002
    one, other = GlobalRandom(5), GlobalRandom(5)
    first = draws(one)
    assert draws(other) == first
    assert draws(one) != first  # it goes on
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # type: ignore[index]  # noqa: NPY002
