"""Kennedy and Eberhart 1995, Clerc and Kennedy 2002: each equation by hand or against a slow twin."""

from typing import Any

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.testing.toy import Toy, sphere
from posefit_swarm.pso import PSO, constriction


def test_chi_of_4_1_is_the_constant_everybody_quotes() -> None:  # CLERC2002 (constriction)
    # 2 / |2 - 4.1 - sqrt(16.81 - 16.4)| = 2 / (2.1 + 0.640312) = 0.729844
    assert constriction(4.1) == pytest.approx(0.729844, abs=1e-6)
    assert constriction(5.0) == pytest.approx(2.0 / (3.0 + np.sqrt(5.0)))


class Twin:
    """The update as the papers print it, particle by particle and coordinate by coordinate, without any box."""

    def __init__(self, positions: Array, velocities: Array, omega: float, acceleration: float, limit: float) -> None:
        self.x, self.v = positions.copy(), velocities.copy()
        self.p, self.cost = positions.copy(), np.full(len(positions), np.inf)
        self.omega, self.acceleration, self.limit = omega, acceleration, limit

    def step(self, costs: Array, rand: Array) -> None:
        for i in range(len(self.x)):
            if costs[i] < self.cost[i]:
                self.p[i], self.cost[i] = self.x[i].copy(), costs[i]
        g = self.p[self.cost.argmin()].copy()
        for i in range(len(self.x)):
            for d in range(self.x.shape[1]):
                v = (
                    self.omega * self.v[i, d]
                    + self.acceleration * rand[0, i, d] * (self.p[i, d] - self.x[i, d])
                    + self.acceleration * rand[1, i, d] * (g[d] - self.x[i, d])
                )
                self.v[i, d] = min(max(v, -self.limit), self.limit)
                self.x[i, d] += self.v[i, d]


def matches_twin(velocity: Any, omega: float, acceleration: float) -> None:
    space = Toy(3)
    pso = PSO(space, np.random.default_rng(3), population_size=8, velocity=velocity, alpha=0.05)
    state = pso._swarm
    twin = Twin(0.2 * state.position, state.velocity, omega, acceleration, 0.05)
    state.position[:], state.best[:], state.moved = twin.x, twin.x, twin.x.copy()  # far from the sides of the box
    rng = np.random.default_rng()
    for _ in range(6):
        rng.bit_generator.state = state._rng.bit_generator.state
        proposals = pso.ask()
        np.testing.assert_allclose(proposals, twin.x, atol=1e-12)
        costs = sphere(proposals)
        pso.tell(proposals, costs)
        rng.random(len(costs))  # the acceptance draws, which PSO does not heed
        twin.step(costs, rng.random((2, *proposals.shape)))


def test_the_original_velocity_keeps_all_of_the_old_one() -> None:  # KENNEDY1995 (velocity)
    matches_twin("original", 1.0, 2.0)


def test_the_constricted_velocity_is_chi_times_all_three_parts() -> None:  # CLERC2002 (velocity)
    chi = constriction(4.1)
    matches_twin("constricted", chi, chi * 2.05)


def test_bests_are_remembered_and_every_move_is_accepted() -> None:  # KENNEDY1995 (pbest, gbest)
    pso = PSO(Toy(2), np.random.default_rng(0), population_size=3, alpha=0.1)
    first = pso.ask()
    pso.tell(first, np.array([3.0, 1.0, 2.0]))
    second = pso.ask()
    pso.tell(second, np.array([5.0, 4.0, 1.5]))
    state = pso._swarm
    np.testing.assert_array_equal(state.position, second)  # worse moves too
    np.testing.assert_array_equal(state.best, [first[0], first[1], second[2]])
    np.testing.assert_array_equal(state.best_cost, [3.0, 1.0, 1.5])


def test_inertia_falls_from_0_9_to_0_1() -> None:
    pso = PSO(Toy(2), np.random.default_rng(0), population_size=3, iterations=10, velocity="inertia")
    weights = []
    for _ in range(12):
        weights.append(pso._weights(pso._iteration))
        pso.tell(pso.ask(), np.zeros(3))
    assert weights[0] == (0.9, 2.0)
    assert weights[10][0] == pytest.approx(0.1)
    assert weights[11][0] == pytest.approx(0.1)
