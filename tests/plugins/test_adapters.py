"""Other people's optimisers: one that calls the objective itself, a whole track with each, and absent libraries."""

import copy
import gc
import pickle
import subprocess
import sys
import threading
import warnings
from dataclasses import replace
from functools import partial
from importlib.metadata import EntryPoint
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

import posefit
from posefit import Problem, minimise
from posefit.arrays import Array
from posefit.fitting.box import Start
from posefit.registry import Registry, load, registry
from posefit.testing.toy import Toy, ball, sphere
from posefit_bridges.optimisers import Bridge, GlobalRandom, called_back
from tests.cases import each


def climbs(space: Toy, rng: np.random.Generator, objective: Any) -> None:
    """A library as they are: it calls the objective, and returns at the end."""
    place = np.zeros(space.dimensions)
    cost = np.inf
    for _ in range(20):
        near = place + 0.3 * rng.standard_normal((5, space.dimensions))
        costs = objective(near)
        if costs.min() < cost:
            place = near[costs.argmin()]
            cost = costs.min()


def fails(space: Toy, rng: np.random.Generator, objective: Any) -> None:
    objective(np.zeros((2, space.dimensions)))
    raise OSError("out of paper")


def bridge(library: Any, space: Toy, seed: int = 0) -> Bridge:
    return Bridge(space, np.random.default_rng(seed), partial(called_back, library))


def bridges() -> set[threading.Thread]:
    gc.collect()
    return {
        thread
        for thread in threading.enumerate()
        if thread.name == "posefit_bridges.optimisers"
    }


def test_costs_reach_the_proposals_they_belong_to() -> None:
    calls: list[tuple[Array, Array]] = []

    def library(space: Toy, rng: np.random.Generator, objective: Any) -> None:
        for k in range(5):
            asked = np.full((3, 2), 0.1 * k) + [[0.0], [0.01], [0.02]]
            calls.append((asked, objective(asked)))

    optimiser = bridge(library, Toy(2))
    while len(asked := optimiser.ask()):
        # asking again changes nothing
        np.testing.assert_array_equal(optimiser.ask(), asked)
        optimiser.tell(asked, asked.sum(axis=1))
    assert len(calls) == 5
    for asked, costs in calls:
        np.testing.assert_array_equal(costs, asked.sum(axis=1))


def test_no_thread_outlives_its_search_or_an_error_in_it() -> None:
    before = bridges()
    for steps in (0, 1, 7, 20):
        optimiser = bridge(climbs, Toy(3), steps)
        for _ in range(steps):
            proposals = optimiser.ask()
            optimiser.tell(proposals, sphere(proposals))
    del optimiser
    assert bridges() <= before

    with pytest.raises(RuntimeError, match="the cost failed"):
        minimise(
            Problem(Mock(side_effect=RuntimeError("the cost failed")), Toy(3), 100),
            bridge(climbs, Toy(3)),
        )
    assert bridges() <= before


def test_an_error_of_the_library_is_raised_by_ask() -> None:
    with pytest.raises(RuntimeError, match="the library failed: OSError: out of paper"):
        minimise(Problem(sphere, Toy(3), 100), bridge(fails, Toy(3)))


@each("copied", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
def test_a_copy_continues_like_the_original(copied: Any) -> None:
    space = Toy(3, ball)
    first = bridge(climbs, space)
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

    before = np.random.get_state()[1].copy()  # noqa: NPY002
    one = GlobalRandom(5)
    other = GlobalRandom(5)
    first = draws(one)
    assert draws(other) == first
    assert draws(one) != first  # it goes on
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002


@each("dimensions", [1, 3])
def test_pycma_gets_the_box_and_a_spread_for_each_coordinate(dimensions: int) -> None:
    cma = pytest.importorskip("cma")
    made: list[tuple[Any, ...]] = []

    class Noted(cma.CMAEvolutionStrategy):  # type: ignore[misc]
        """pycma's strategy, which notes what it is made of."""

        def __init__(self, *given: Any) -> None:
            made.append(given)
            super().__init__(*given)

    spreads = np.linspace(0.1, 0.4, dimensions)
    start = Start(np.zeros(dimensions), spreads, np.zeros(dimensions))
    for space, expected in (
        (Toy(dimensions), np.full(dimensions, 0.3)),
        (replace(Toy(dimensions), start=start), spreads),
    ):
        rng = np.random.default_rng(0)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(cma, "CMAEvolutionStrategy", Noted)
            optimiser = posefit.optimiser("pycma")(
                space, rng, population_size=6, spread=0.3
            )
            assert optimiser.ask().shape == (6, dimensions)
        mean, step, options = made.pop()
        # a search of one dimension has a spare one, as wide as one without a prediction
        spare = [0.3] * (dimensions == 1)
        assert len(mean) == dimensions + len(spare)
        assert step == 1.0
        # pycma 4.0 makes lists of the bounds that it was given
        assert np.ravel(options["bounds"]).tolist() == [-1, 1]
        np.testing.assert_array_equal(options["CMA_stds"], [*expected, *spare])
        assert options["popsize"] == 6
        assert options["verbose"] < 0  # says nothing


LIBRARIES = {
    "pycma": "cma",
    "nevergrad": "nevergrad",
    "pymoo": "pymoo",
    "optuna": "optuna",
    "mediapipe": "mediapipe",
}


def test_an_absent_library_is_named_with_the_extra_to_install() -> None:
    plugins = load(
        [
            EntryPoint(name, f"posefit_{name}", "posefit")
            for name in ("bridges", "mediapipe")
        ]
    )
    needs = {
        offer.name: offer.needs
        for plugin in plugins
        for offer in plugin.offers
        if offer.needs
    }
    assert needs == {
        name: (library, f"posefit[{name}]") for name, library in LIBRARIES.items()
    }
    for plugin in plugins:
        absent = tuple(
            replace(offer, needs=("no_such_library", f"posefit[{offer.name}]"))
            for offer in plugin.offers
        )
        for offer in absent:
            message = rf"{offer.kind} {offer.name} needs the library .* 'posefit\[{offer.name}\]'"
            with pytest.raises(ImportError, match=message):
                Registry((plugin._replace(offers=absent),)).offer(
                    offer.kind, offer.name
                )


def test_listing_plugins_imports_none_of_their_libraries() -> None:
    names = [*LIBRARIES.values(), "scipy.optimize", "sklearn"]
    script = f"import sys; from posefit.registry import registry; registry(); print({{*{names}}} & {{*sys.modules}})"
    ran = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert ran.stdout.splitlines()[-1] == "set()"


@each(
    "name",
    ["scipy", "scipy:dual_annealing", "pycma", "nevergrad", "pymoo:PSO", "optuna"],
)
def test_an_adapter_follows_a_motion_at_the_same_budget(name: str) -> None:
    threads = set(threading.enumerate())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # posefit's own threads, of which there would be some otherwise, are kept
        summary = posefit.track(
            "walk",
            method=name,
            frames=(0, 2),
            size=(120, 90),
            evaluations=400,
            threads=1,
        ).summary
    assert summary["evaluations_per_frame"] == 400
    assert 720 <= summary["evaluations"] <= 800
    assert summary["iou"] > 0.5
    assert set(threading.enumerate()) <= threads


def test_a_library_behaves_the_same_afterwards() -> None:
    optuna = pytest.importorskip("optuna")
    config = pytest.importorskip("pymoo.config").Config
    before = optuna.logging.get_verbosity(), config.warnings["not_compiled"]
    try:
        optuna.logging.set_verbosity(optuna.logging.DEBUG)
        config.warnings["not_compiled"] = True
        for name in ("optuna", "pymoo"):
            optimiser = registry().optimiser(name)(Toy(3), np.random.default_rng(0))
            proposals = optimiser.ask()
            optimiser.tell(proposals, sphere(proposals))
        assert optuna.logging.get_verbosity() == optuna.logging.DEBUG
        assert config.warnings == {"not_compiled": True}
    finally:
        optuna.logging.set_verbosity(before[0])
        config.warnings["not_compiled"] = before[1]


def test_an_unknown_variant_is_named() -> None:
    for name, message in (
        (
            "pymoo:NSGA9",
            "variant must be one of DE, PSO, GA, ES, SRES, ISRES, got 'NSGA9'",
        ),
        ("optuna:Best", "variant must be one of TPESampler"),
        (
            "nevergrad:Best",
            "variant must be one of [0-9]+ names such as TwoPointsDE, CMA, PSO, got 'Best'",
        ),
        (
            "scipy:minimize",
            "variant must be one of differential_evolution, dual_annealing, got 'minimize'",
        ),
        ("pso:fast", "optimiser must be pso, which has no variants, got 'pso:fast'"),
    ):
        with pytest.raises(ValueError, match=message):
            posefit.track(
                "walk", method=name, frames=(0, 1), size=(60, 45), evaluations=100
            )
