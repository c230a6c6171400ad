"""SAPSO, algorithm 1, step 2c, as Interpretation S7 has it: what is no pose has rand() drawn again, and then stays."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import ks_2samp

from posefit.arrays import Array
from posefit_swarm.sapso import Rows, redrawn

FEASIBLE = 0.3  # share of steps that are allowed


def stepped(count: int, redraws: int, feasible: float = FEASIBLE) -> tuple[Array, Array]:
    """Return velocities and positions (n, 2) of particles at -1 whose first coordinate must be below `feasible`."""
    rng = np.random.default_rng(3)

    def step(rows: Rows) -> tuple[Array, Array]:
        moved = rng.random((len(rows), 2))
        return moved + 1.0, moved

    def allowed(_: Array, moved: Array) -> NDArray[np.bool_]:
        return np.asarray(moved[:, 0] < feasible)

    return redrawn(np.full((count, 2), -1.0), step, allowed, redraws)


def test_what_is_drawn_again_has_the_distribution_of_what_is_allowed() -> None:  # Interpretation S7
    velocity, position = stepped(3000, 100)
    np.testing.assert_allclose(velocity, position + 1.0)  # both are of the same draw
    assert position[:, 0].max() < FEASIBLE
    uniform = np.random.default_rng(4).random((3000, 2)) * [FEASIBLE, 1.0]
    for k in range(2):
        assert ks_2samp(position[:, k], uniform[:, k]).pvalue > 0.01


def test_a_particle_is_redrawn_as_often_as_asked_and_then_stays_at_rest() -> None:  # Interpretation S7
    for redraws, failing in [(1, 0.49), (4, 0.16807), (10, 0.019773)]:
        velocity, position = stepped(4000, redraws)
        stays = position[:, 0] == -1.0
        deviation = np.sqrt(failing * (1.0 - failing) / 4000)
        assert stays.mean() == pytest.approx(failing, abs=3.5 * deviation)  # 0.7^(1 + redraws)
        np.testing.assert_array_equal(velocity[stays], 0.0)
        np.testing.assert_array_equal(position[stays], -1.0)


def test_where_all_is_allowed_nothing_is_drawn_again() -> None:
    drawn = np.random.default_rng(3).random((50, 2))
    np.testing.assert_array_equal(stepped(50, 10, feasible=1.0)[1], drawn)
