"""Searches of the related work: John 2010, Zhao 2008, Krzeszowski 2010, Gavrila 1996, each step by hand or by a twin."""

import copy
import math
from itertools import pairwise

import numpy as np
import pytest

from posefit import Start
from posefit.arrays import Array
from posefit.testing.toy import Toy, sphere
from posefit_related.haga import HAGA
from posefit_related.hpso import HPSO
from posefit_related.local import Local
from posefit_related.psopf import CHI, PHI, PSOPF
from posefit_related.stages import opened, runs


def predicted(d: int) -> Toy:
    """Return a space of d dimensions whose prediction is its middle, give or take 0.1."""
    return Toy(d, start=Start(np.zeros(d), np.full(d, 0.1), np.zeros(d)))


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_the_root_comes_first_and_then_runs_along_the_chain() -> None:  # JOHN2010 (hierarchy)
    assert [run.tolist() for run in runs(10, 4)] == [[0, 1, 2], [3, 4, 5, 6], [7, 8, 9]]
    assert [run.tolist() for run in runs(2, 4)] == [[0, 1]]
    for d in range(1, 70):
        np.testing.assert_array_equal(np.concatenate(runs(d, 6)), np.arange(d))


def stages(optimiser: HPSO) -> list[list[tuple[Array, Array]]]:
    """Return the populations and costs of each stage of a search, the first poses first."""
    by_stage: list[list[tuple[Array, Array]]] = [[] for _ in range(len(optimiser._runs) + 1)]
    while len(proposals := optimiser.ask()):
        costs = sphere(proposals)
        by_stage[optimiser._stage + 1].append((proposals, costs))
        optimiser.tell(proposals, costs)
    return by_stage


def test_a_stage_moves_its_own_coordinates_only() -> None:  # JOHN2010 (stage)
    _, *after = stages(HPSO(predicted(10), rng(), run_length=4, evaluations=300))
    for run, populations in zip(runs(10, 4), after, strict=True):
        rows = np.concatenate([proposals for proposals, _ in populations])
        assert np.flatnonzero(np.ptp(rows, axis=0) > 0.0).tolist() == run.tolist()


def test_a_stage_holds_the_best_of_the_one_before() -> None:  # JOHN2010 (handed down)
    parts = stages(HPSO(predicted(10), rng(), run_length=4, evaluations=300))
    for before, after in pairwise(parts):
        proposals, costs = (np.concatenate(rows) for rows in zip(*before, strict=True))
        np.testing.assert_array_equal(after[0][0][0], proposals[costs.argmin()])


def test_the_inertia_falls_from_a_to_a_tenth() -> None:  # JOHN2010 (inertia)
    optimiser = HPSO(predicted(3), rng(), acceleration=0.0, inertia=2.0, alpha=10.0, evaluations=101)
    optimiser.tell(optimiser.ask(), np.zeros(1))
    assert optimiser._generations == 10
    for generation, omega in ((0, 2.0), (5, math.sqrt(0.2)), (10, 0.1)):  # the middle of a geometric fall
        optimiser._v[:], optimiser._generation = 0.01, generation
        optimiser._move()
        np.testing.assert_allclose(optimiser._v, 0.01 * omega)


def test_layers_open_the_root_and_then_equal_shares() -> None:  # ZHAO2008 (hierarchy)
    assert [opened(9, layer, 3) for layer in range(3)] == [5, 7, 9]
    assert [opened(10, layer, 3) for layer in range(3)] == [6, 8, 10]  # 7 components: 3, 2 and 2
    assert [opened(2, layer, 3) for layer in range(3)] == [2, 2, 2]


def test_the_best_survives() -> None:  # ZHAO2008 (elite)
    optimiser, lowest = HAGA(predicted(9), rng(), evaluations=400), np.inf
    while len(proposals := optimiser.ask()):
        costs = sphere(proposals)
        assert costs[0] == lowest or not np.isfinite(lowest)
        lowest = min(lowest, costs.min())
        optimiser.tell(proposals, costs)


def test_the_temperature_falls_geometrically_in_each_layer() -> None:  # ZHAO2008 (annealing)
    optimiser = HAGA(predicted(9), rng(), evaluations=3 * 40 * 5)
    temperatures = []
    while len(proposals := optimiser.ask()):
        temperatures.append(optimiser.temperature())
        optimiser.tell(proposals, sphere(proposals))
    layers = np.reshape(temperatures, (3, 5))
    np.testing.assert_allclose(layers[:, [0, -1]], [[5.0, 0.2]] * 3)
    np.testing.assert_allclose(layers[:, 1:] / layers[:, :-1], (0.2 / 5.0) ** 0.25)  # four steps


def halves(optimiser: HAGA) -> Array:
    """Return individuals, of which every other one is at -0.4, the rest at 0.4."""
    x = np.full((optimiser._size, optimiser._space.dimensions), -0.4)
    x[::2] = 0.4
    return x


def test_parents_are_chosen_by_their_fitness_at_the_temperature() -> None:  # ZHAO2008 (selection)
    optimiser = HAGA(predicted(1), rng(), population_size=20_000, evaluations=20_000, layers=1, mutation=0.0)
    x = halves(optimiser)
    costs = np.where(x[:, 0] > 0.0, 7.0, 7.0 + 5.0 * math.log(3.0))  # three to one at a temperature of 5
    children = optimiser._children(x, costs)
    assert children.mean() == pytest.approx(0.75 * 0.4 - 0.25 * 0.4, abs=0.01)


def test_children_lie_between_their_parents_or_a_quarter_beyond() -> None:  # ZHAO2008 (crossover)
    optimiser = HAGA(predicted(1), rng(), population_size=20_000, evaluations=20_000, layers=1, mutation=0.0)
    children = optimiser._children(halves(optimiser), np.zeros(20_000))
    assert np.abs(children).max() <= 0.6 + 1e-12  # 0.4 and a quarter of 0.8
    mixed = children[np.abs(np.abs(children) - 0.4) > 1e-9]
    assert len(mixed) == pytest.approx(10_000, abs=400)  # half of the pairs differ
    np.testing.assert_allclose(np.quantile(mixed, [0.25, 0.5, 0.75]), [-0.3, 0.0, 0.3], atol=0.02)  # uniform


def test_open_coordinates_mutate_by_noise_that_cools() -> None:  # ZHAO2008 (mutation)
    optimiser = HAGA(predicted(9), rng(), population_size=20_000, evaluations=180_000, mutation=1.0)
    for generation, share in ((0, 1.0), (1, 0.2), (2, 0.04)):  # 5, 1 and 0.2: of three generations
        optimiser._generation = generation
        children = optimiser._children(np.zeros((20_000, 9)), np.zeros(20_000))
        np.testing.assert_allclose(children.std(axis=0)[:5], 0.1 * share, rtol=0.03)
        assert not children[:, 5:].any()


def test_a_swarm_shifts_the_particles() -> None:  # KRZESZOWSKI2010 (shift)
    optimiser = PSOPF(Toy(4), rng(), evaluations=60, iterations=2, alpha=10.0)
    x = optimiser.ask()
    optimiser.tell(x, sphere(x))
    moved, v = optimiser.ask(), optimiser.ask() - x  # at rest before, and each its own best
    twin, gbest = copy.deepcopy(optimiser._rng), x[sphere(x).argmin()]
    optimiser.tell(moved, sphere(moved))
    pulls = twin.random((2, *x.shape))
    for row in range(len(x)):
        pbest = moved[row] if sphere(moved[row : row + 1])[0] < sphere(x[row : row + 1])[0] else x[row]
        best = moved[sphere(moved).argmin()] if sphere(moved).min() < sphere(gbest[None])[0] else gbest
        by_hand = v[row] + PHI * pulls[0, row] * (pbest - moved[row]) + PHI * pulls[1, row] * (best - moved[row])
        if np.abs(moved[row] + CHI * by_hand).max() <= 1.0 and np.abs(moved[row]).max() < 1.0:
            np.testing.assert_allclose(optimiser._x[row], moved[row] + CHI * by_hand, atol=1e-12)


def test_particles_survive_by_the_weights_of_where_they_were_brought() -> None:  # KRZESZOWSKI2010 (weights)
    optimiser = PSOPF(Toy(1), rng(), evaluations=4000, iterations=0, sharpness=2.0, noise=1e-9)
    x = np.where(rng().permutation(4000) % 2, 0.5, -0.5)[:, None]
    optimiser._x = x
    optimiser.ask()
    optimiser.tell(x, np.where(x[:, 0] > 0.0, 1.0, 1.0 + 0.5 * math.log(3.0)))  # three to one
    assert not len(optimiser.ask())
    optimiser.advance(Toy(1))
    assert (optimiser.ask() > 0.0).mean() == pytest.approx(0.75, abs=0.01)


def test_one_part_is_searched_after_the_other() -> None:  # GAVRILA1996 (decomposition)
    optimiser, parts = Local(predicted(10), rng(), run_length=4, evaluations=500), runs(10, 4)
    optimiser.tell(optimiser.ask(), np.zeros(1))
    order = []
    for _ in range(12):
        best, proposals = optimiser._best, optimiser.ask()
        moved = np.flatnonzero((proposals != best).any(axis=0))
        order.append(next(k for k, run in enumerate(parts) if np.isin(moved, run).all()))
        optimiser.tell(proposals, np.ones(len(proposals)))  # never better
    assert order == [0, 0, 1, 1, 2, 2] * 2  # two expansions in vain end a part
    assert optimiser._step == 0.1 / 4.0  # halved after each round without a better pose


def test_the_best_pose_that_was_not_expanded_is_next() -> None:  # GAVRILA1996 (best first)
    optimiser = Local(predicted(3), rng(), step=0.1, patience=5, evaluations=500)
    optimiser.tell(optimiser.ask(), np.array([9.0]))
    near = optimiser.ask()
    np.testing.assert_allclose(near, 0.1 * np.concatenate([np.eye(3), -np.eye(3)]))
    optimiser.tell(near, np.array([8.0, 5.0, 7.0, 9.0, 9.0, 9.0]))
    second = optimiser.ask()  # around the one that costs 5, but for the pose it came from
    np.testing.assert_allclose(np.abs(second - near[1]).sum(axis=1), 0.1)
    assert len(second) == 5
    optimiser.tell(second, np.full(5, 10.0))  # in vain: back to the one that costs 7
    third = optimiser.ask()
    np.testing.assert_allclose(np.abs(third - near[2]).sum(axis=1), 0.1)
