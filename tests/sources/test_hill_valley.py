"""One test for each step of hill-valley clustering: by hand, and against a slow one that tests pair after pair."""

import itertools
from collections.abc import Callable

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.fitting.box import displacement, wrap
from posefit.testing.toy import Toy
from posefit.uncertainty.hill_valley import edge_length, same_valley, valleys
from posefit.uncertainty.landscape import Landscape


def two_holes(proposals: Array) -> Array:
    """Costs (n,) that are least, 0, at -0.5 and 0.5 of the first coordinate, with a hill of 1 at 0."""
    return np.asarray((4.0 * proposals[:, 0] ** 2 - 1.0) ** 2 + (proposals[:, 1:] ** 2).sum(axis=1))


def eggs(proposals: Array) -> Array:
    """Costs (n,) with valleys at -2/3, 0 and 2/3 of each coordinate."""
    return np.asarray((1.0 - np.cos(3.0 * np.pi * proposals)).sum(axis=1))


def turning(proposals: Array) -> Array:
    """Costs (n,) of a full turn that are least where it closes, at -1 and 1, and at 0."""
    return np.asarray(1.0 - np.cos(2.0 * np.pi * proposals[:, 0]))


def slow(cost: Callable[[Array], Array], space: Toy, proposals: Array, costs: Array, least: int = 1) -> list[set[int]]:
    """Return the clusters as the paper's algorithm 2 makes them, each a set of rows."""
    n, d = proposals.shape
    edge = (2.0**d / n) ** (1.0 / d)
    order = sorted(range(n), key=lambda i: costs[i])
    clusters: list[set[int]] = []
    for place, i in enumerate(order):
        away = {j: float(np.linalg.norm(displacement(space, proposals[i], proposals[j]))) for j in order[:place]}
        home: set[int] | None = None
        failed: list[set[int]] = []
        for j in sorted(away, key=lambda j: away[j])[: d + 1]:
            mine = next(cluster for cluster in clusters if j in cluster)
            if any(mine is one for one in failed):
                continue
            probes = least + int(away[j] // edge)
            way, flat = displacement(space, proposals[i], proposals[j]), True
            for k in range(1, probes + 1):
                x = wrap(space, (proposals[i] + k / (probes + 1) * way)[None])
                flat = flat and bool(cost(x)[0] <= max(costs[i], costs[j]))
            if flat:
                home = mine
                break
            failed.append(mine)
        if home is None:
            home = set()
            clusters.append(home)
        home.add(i)
    return clusters


def test_a_hill_between_two_points_parts_them() -> None:  # URSEM1999 (hill valley)
    for probes, one in [(1, False), (2, False), (4, False)]:
        points = np.array([[-0.5], [0.5], [-0.4], [0.9]])
        costs = two_holes(points)
        landscape = Landscape(Toy(1), two_holes)
        pairs, counts = np.array([[0, 1], [0, 2], [1, 3]]), np.array([probes] * 3)
        np.testing.assert_array_equal(same_valley(landscape, points, costs, pairs, counts), [one, True, True])
        assert landscape.evaluations == 3 * probes


def test_a_hill_lower_than_the_tolerance_is_none_and_what_is_not_feasible_is_one() -> None:
    points, pairs, probes = np.array([[-0.5], [0.5]]), np.array([[0, 1]]), np.array([1])
    for tolerance, one in ((0.9, False), (1.1, True)):
        landscape = Landscape(Toy(1), two_holes)
        assert same_valley(landscape, points, np.zeros(2), pairs, probes, tolerance)[0] == one
    flat = Landscape(Toy(1, lambda x: np.abs(x[:, 0]) > 0.1), lambda x: np.zeros(len(x)))
    assert not same_valley(flat, points, np.zeros(2), pairs, probes)[0]
    assert flat.evaluations == 0


def test_neighbours_of_a_grid_lie_an_edge_apart() -> None:  # MAREE2018 (edge length)
    assert edge_length(1, 10) == pytest.approx(0.2)
    assert edge_length(2, 100) == pytest.approx(0.2)
    assert edge_length(3, 8) == pytest.approx(1.0)


def test_a_pair_is_probed_once_and_once_more_for_every_edge_between() -> None:  # MAREE2018 (test points)
    # four points of one coordinate: the edge is 0.5. Best first 0.0; 0.3 is 0.3 away: 1 probe. -0.8 is 0.8 from 0 and
    # 1.1 from 0.3: 2 and 3. 1.0 is 0.7 from 0.3 and 1.0 from 0, of which the nearest two are probed: 2 and 3
    points = np.array([[0.0], [0.3], [-0.8], [1.0]])
    landscape = Landscape(Toy(1), lambda x: np.abs(x[:, 0]))
    found = valleys(landscape, points, np.abs(points[:, 0]))
    assert landscape.evaluations == 1 + 2 + 3 + 2 + 3
    np.testing.assert_array_equal(found.labels, 0)
    np.testing.assert_array_equal(found.lowest, [0])


def test_a_point_joins_the_nearest_better_one_that_no_hill_parts_it_from() -> None:  # MAREE2018 (nearest better)
    # 0.05 is nearest to -0.4, beyond the hill at 0; the next nearest is 0.55
    points = np.array([[-0.5], [0.55], [-0.4], [0.05]])
    found = valleys(Landscape(Toy(1), two_holes), points, two_holes(points), least=5)
    np.testing.assert_array_equal(found.labels, [0, 1, 0, 1])
    np.testing.assert_array_equal(found.lowest, [0, 1])


def test_clusters_are_those_of_one_test_after_the_other() -> None:
    for least, (cost, dimensions, wrapping) in itertools.product(
        [1, 3], [(two_holes, 1, 0), (two_holes, 2, 0), (eggs, 1, 0), (eggs, 2, 0), (turning, 1, 1), (turning, 2, 1)]
    ):
        space = Toy(dimensions, wrapping=wrapping)
        for seed in range(5):
            points = np.random.default_rng(seed).uniform(-1.0, 1.0, (40, dimensions))
            costs = cost(points)
            found = valleys(Landscape(space, cost), points, costs, least=least)
            theirs = slow(cost, space, points, costs, least)
            mine = [set(np.flatnonzero(found.labels == k).tolist()) for k in range(len(found.lowest))]
            assert mine == theirs
            np.testing.assert_array_equal(found.lowest, [min(one, key=lambda i: costs[i]) for one in theirs])


def test_few_points_have_no_hills_and_a_cost_that_is_no_number_is_refused() -> None:
    landscape = Landscape(Toy(2), two_holes)
    assert len(valleys(landscape, np.empty((0, 2)), np.empty(0)).lowest) == 0
    np.testing.assert_array_equal(valleys(landscape, np.zeros((1, 2)), np.ones(1)).labels, [0])
    assert landscape.evaluations == 0
    with pytest.raises(ValueError, match="costs must be finite, got nan"):
        valleys(Landscape(Toy(1), two_holes), np.zeros((2, 1)), np.array([0.0, np.nan]))
