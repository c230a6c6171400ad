"""Kennedy and Eberhart 1995, Clerc and Kennedy 2002: each equation by hand or against a slow twin."""

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.testing.toy import Toy, sphere
from posefit_swarm.pso import PSO, constriction


# CLERC2002 (constriction)
def test_chi_of_4_1_is_the_constant_everybody_quotes() -> None:
    # 2 / |2 - 4.1 - sqrt(16.81 - 16.4)| = 2 / (2.1 + 0.640312) = 0.729844
    assert constriction(4.1) == pytest.approx(0.729844, abs=1e-6)
    assert constriction(5.0) == pytest.approx(2.0 / (3.0 + np.sqrt(5.0)))


class Twin:
    """The update as the papers print it, particle by particle and coordinate by coordinate, without any box."""

    def __init__(
        self,
        positions: Array,
        velocities: Array,
        omega: float,
        acceleration: float,
        limit: float,
    ) -> None:
        self.x, self.v = positions.copy(), velocities.copy()
        self.p, self.cost = positions.copy(), np.full(len(positions), np.inf)
        self.omega = omega
        self.acceleration = acceleration
        self.limit = limit

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


# CLERC2002 (velocity)
def test_the_constricted_velocity_is_chi_times_all_three_parts() -> None:
    pso = PSO(Toy(3), np.random.default_rng(3), population_size=8, alpha=0.05)
    pso.x *= 0.2  # far from the sides of the box
    pso.pbest = pso.x.copy()
    twin = Twin(pso.x, pso.v, constriction(4.1), constriction(4.1) * 2.05, 0.05)
    rng = np.random.default_rng()
    for _ in range(6):
        rng.bit_generator.state = pso.rng.bit_generator.state
        proposals = pso.ask()
        np.testing.assert_allclose(proposals, twin.x, atol=1e-12)
        costs = sphere(proposals)
        pso.tell(proposals, costs)
        twin.step(costs, rng.random((2, *proposals.shape)))


# KENNEDY1995 (velocity)
def test_each_pull_is_half_of_phi_times_rand_times_the_distance() -> None:
    pso = PSO(Toy(1), np.random.default_rng(0), population_size=2, phi=5.0, alpha=0.9)
    pso.x, pso.v = np.array([[0.1], [0.0]]), np.array([[0.2], [0.0]])
    pso.pbest, pso.pbest_cost = np.array([[0.3], [-0.1]]), np.array([2.0, 1.0])
    r1, r2 = np.random.default_rng(7).random(2)
    pso.rng = np.random.default_rng(7)
    velocity, position = pso.step(np.array([0]))
    expected = constriction(5.0) * (
        0.2 + 2.5 * r1 * (0.3 - 0.1) + 2.5 * r2 * (-0.1 - 0.1)
    )
    np.testing.assert_allclose(
        [velocity[0, 0], position[0, 0]], [expected, 0.1 + expected]
    )


# KENNEDY1995 (pbest, gbest)
def test_bests_are_remembered_and_every_move_is_accepted() -> None:
    pso = PSO(Toy(2), np.random.default_rng(0), population_size=3, alpha=0.1)
    first = pso.ask()
    pso.tell(first, np.array([3.0, 1.0, 2.0]))
    second = pso.ask()
    pso.tell(second, np.array([5.0, 4.0, 1.5]))
    np.testing.assert_array_equal(pso.pbest, [first[0], first[1], second[2]])
    np.testing.assert_array_equal(pso.pbest_cost, [3.0, 1.0, 1.5])
    # it moves on from worse, too
    np.testing.assert_allclose(np.abs(pso.ask() - second).max(), np.abs(pso.v).max())


# KENNEDY1995 (pbest, gbest)
def test_a_cost_that_is_only_as_good_is_no_new_best() -> None:
    pso = PSO(Toy(3), np.random.default_rng(0), population_size=4)
    first = pso.ask()
    for costs in ([5.0, 5.0, 5.0, 5.0], [5.0, 6.0, 5.0, 4.0]):
        moved = pso.ask()
        pso.tell(moved, np.array(costs))
    np.testing.assert_array_equal(pso.pbest[:3], first[:3])
    np.testing.assert_array_equal(pso.pbest[3], moved[3])
