"""Our strategy and the library cmaes learn the same from the same proposals, and end in the same generation."""

import itertools
from typing import Any

import numpy as np
from cmaes import CMA

from posefit.arrays import Array
from posefit.evolution.strategy import Strategy


class Given(np.random.Generator):
    """A generator of given normal draws, as ours and as the library ask for them."""

    def __init__(self, rows: Array) -> None:
        super().__init__(np.random.PCG64(0))
        self.rows, self.next = rows, 0

    def standard_normal(self, size: Any = None, *_: Any, **__: Any) -> Any:
        assert size == self.rows.shape
        return self.rows.copy()

    def randn(self, dimensions: int) -> Array:
        self.next += 1
        return self.rows[self.next - 1][:dimensions]


def pair(d: int, population: int, seed: int = 0) -> tuple[Strategy, Any]:
    """Return our strategy and the library's, at the same place with the same spread."""
    rng = np.random.default_rng(seed)
    mean, spread = rng.normal(0.0, 0.1, d), rng.uniform(0.05, 0.5, d)
    size = float(np.sqrt((spread**2).mean()))
    theirs = CMA(mean.copy(), size, population_size=population, cov=np.diag((spread / size) ** 2))
    return Strategy(mean, spread, population), theirs


def alike(ours: Strategy, theirs: Any) -> None:
    pairs = [
        (ours.mean, theirs._mean),
        (ours.covariance, theirs._C),
        (ours.step_path, theirs._p_sigma),
        (ours.path, theirs._pc),
        (np.array([ours.sigma]), np.array([theirs._sigma])),
    ]
    for one, other in pairs:
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


def tell(theirs: Any, proposals: Array, costs: Array) -> None:
    theirs.tell(list(zip(proposals, costs.tolist(), strict=True)))


def test_it_learns_what_the_library_learns_until_both_end() -> None:
    for ties, (d, population) in itertools.product(
        [False, True], [(1, 5), (2, 6), (2, 7), (9, 10), (9, 40), (28, 13), (28, 40)]
    ):
        rng = np.random.default_rng(d)
        ours, theirs = pair(d, population)
        valley = rng.normal(size=(d, d))
        for _ in range(250):
            proposals = ours.sample(rng, population)
            costs = ((proposals @ valley) ** 2).sum(axis=1)
            if ties:
                costs = np.round(2.0 * costs) / 2.0
            ours.learn(proposals, costs)
            tell(theirs, proposals, costs)
            alike(ours, theirs)
            ended = ours.ended()
            assert ended == theirs.should_stop()
            if ended:
                break
        assert ended or d > 2


def test_it_draws_what_the_library_draws_from_the_same_normal_numbers() -> None:
    for d in [1, 2, 9, 28]:
        ours, theirs = pair(d, 12)
        given = Given(np.random.default_rng(7).normal(size=(12, d)))
        theirs._rng = given
        np.testing.assert_allclose(ours.sample(given, 12), [theirs.ask() for _ in range(12)], rtol=1e-12)


def test_it_learns_the_same_from_proposals_that_were_moved_and_from_costs_of_chance() -> None:
    for d in [1, 2, 9]:
        rng = np.random.default_rng(d)
        ours, theirs = pair(d, 8)
        for _ in range(60):
            proposals = np.clip(ours.sample(rng, 8), -0.2, 0.2)
            costs = rng.choice([1e15, -1e15, 3.0, rng.random()], 8)
            ours.learn(proposals, costs)
            tell(theirs, proposals, costs)
            alike(ours, theirs)
            assert ours.ended() == theirs.should_stop()
            if ours.ended():
                break


def test_it_ends_where_the_library_ends() -> None:
    for what, changed in [
        ("nothing", {}),
        ("a step size that is nearly nothing", {"sigma": 1e-13, "mean": np.zeros(3)}),
        ("one just above that", {"sigma": 1e-10, "mean": np.zeros(3)}),
        ("a path that is longer", {"sigma": 1e-13, "mean": np.zeros(3), "path": np.array([0.0, 9.0, 0.0])}),
        ("a path the other way", {"sigma": 1e-13, "mean": np.zeros(3), "path": np.array([0.0, -9.0, 0.0])}),
        ("a step size beyond all bounds", {"sigma": 1e5}),
        ("a mean that no step changes", {"mean": np.full(3, 1e16)}),
        ("a mean that one step does not change", {"mean": np.array([0.0, 0.0, 1e16])}),
        ("a covariance that is long and flat", {"covariance": np.diag([1.0, 1.0, 1e-20])}),
        ("one that is longer and flatter", {"covariance": np.diag([1.0, 1.0, 1e-30])}),
        ("one that rounding has made negative", {"covariance": np.diag([1.0, 1.0, -1e-17])}),
    ]:
        ours, theirs = pair(3, 7)
        names = {"sigma": "_sigma", "mean": "_mean", "path": "_pc", "covariance": "_C"}
        for name, value in changed.items():
            setattr(ours, name, value if name == "sigma" else value.copy())
            setattr(theirs, names[name], value if name == "sigma" else value.copy())
        ours._decompose()
        assert ours.ended() == theirs.should_stop(), what
        np.testing.assert_allclose(ours.covariance, theirs._C, rtol=1e-12, atol=1e-25)


def test_axes_that_are_some_generations_old_serve_as_well() -> None:
    rng = np.random.default_rng(1)
    lazy = Strategy(np.full(9, 0.5), np.full(9, 0.3), 10, lag=1.0)  # 1 / (9 (0.0183 + 0.0240)) = 2.6
    for _ in range(250):
        proposals = lazy.sample(rng, 10)
        lazy.learn(proposals, (proposals**2).sum(axis=1))
    assert np.abs(lazy.mean).max() < 1e-5
