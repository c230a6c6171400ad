"""SAPSO, algorithm 1, step 2c, as Interpretation S7 has it: what leaves the box is drawn again, a coordinate at a time."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import ks_2samp

from posefit.arrays import Array
from posefit_swarm import kernels

OMEGA, ACCELERATION = 0.9, 2.0
REACH = 0.5  # the largest speed


def redrawn(
    position: list[float], velocity: list[float], best: list[float], target: list[float], count: int, redraws: int = 100
) -> tuple[Array, NDArray[np.bool_]]:
    """Return where so many copies of a particle fly to, and which of them are stuck."""
    rng, d = np.random.default_rng(3), len(position)
    where, speeds, bests = (np.tile(one, (count, 1)) for one in (position, velocity, best))
    limits = np.full(d, -REACH), np.full(d, REACH), np.zeros(d, dtype=bool), True
    swarm = where, np.zeros(count), bests, np.zeros(count), speeds, *limits
    flown, moved, stuck = np.empty((count, d)), np.empty((count, d)), np.empty(count, dtype=bool)
    rand, spare = rng.random(2 * count * d), rng.random(2 * redraws * d * (count + 1))
    pull = OMEGA, ACCELERATION, np.array(target)
    kernels.move(np.arange(count), 0, rand, spare, 0, redraws, *pull, swarm, flown, moved, stuck)
    np.testing.assert_allclose(moved[~stuck], (where + flown)[~stuck], atol=1e-15)
    np.testing.assert_array_equal(flown[stuck], 0.0)
    return moved, stuck


# From 0.9 with a velocity of 0.1, the best at 0.95 and the swarm's at 0.9: 0.9 + 0.9 * 0.1 + 2 rand() * 0.05, uniform
# from 0.99 to 1.09. The box leaves 0.99 to 1 of it, one draw in ten.
SELDOM = (0.9, 0.1, 0.95, 0.9)
# 0.9 + 0.9 * 0.2 is out of the box, and no pull leads back.
NEVER = (0.9, 0.2, 0.9, 0.9)


def particle(*coordinates: tuple[float, float, float, float]) -> list[list[float]]:
    """Return position, velocity, best and target (d,) of a particle with such coordinates."""
    return [list(one) for one in zip(*coordinates, strict=True)]


def test_redrawing_coordinates_has_the_distribution_of_redrawing_particles() -> None:  # Interpretation S7
    # in the box: r1 + r2 <= 0.6, 18 in 100; r1 <= 0.5 r2 + 0.05, 30 in 100; always
    three = particle((0.85, 0.1, 0.9, 0.9), (-0.9, -0.1, -1.0, -0.85), (0.3, 0.1, 0.5, 0.4))
    apart, stuck = redrawn(*three, 3000)
    assert not stuck.any()
    # the twin draws whole particles, and keeps those with all coordinates in the box
    position, velocity, best, target = map(np.array, three)
    r1, r2 = np.random.default_rng(4).random((2, 120_000, 3))
    speed = OMEGA * velocity + ACCELERATION * (r1 * (best - position) + r2 * (target - position))
    whole = position + np.clip(speed, -REACH, REACH)
    inside = (np.abs(whole) <= 1.0).all(axis=1)
    assert inside.mean() == pytest.approx(0.18 * 0.30, abs=0.003)
    whole = whole[inside]
    for direction in (*np.eye(3), [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 1.0]):
        assert ks_2samp(apart @ direction, whole @ direction).pvalue > 0.01
    # the standard error of a correlation of 3,000 is 0.018
    assert np.abs(np.corrcoef(apart.T)[np.triu_indices(3, 1)]).max() < 0.06


def test_a_coordinate_is_redrawn_as_often_as_asked_and_no_oftener() -> None:  # Interpretation S7
    for redraws, failing in [(0, 0.9), (1, 0.81), (4, 0.59049), (20, 0.109419)]:
        moved, stuck = redrawn(*particle(SELDOM), 4000, redraws)
        # where coordinates are not redrawn by themselves, none is stopped: the particle as a whole may be redrawn
        failed = moved[:, 0] == 1.0 if redraws else moved[:, 0] > 1.0
        deviation = np.sqrt(failing * (1.0 - failing) / 4000)
        assert failed.mean() == pytest.approx(failing, abs=3.5 * deviation)  # 0.9^(1 + redraws)
        np.testing.assert_array_equal(stuck, failed if redraws else False)


def test_a_particle_that_is_out_whatever_is_drawn_is_not_redrawn_at_all() -> None:  # Interpretation S7
    moved, stuck = redrawn(*particle(NEVER, SELDOM), 1000)
    assert stuck.all()
    assert (moved[:, 1] == 1.0).mean() == pytest.approx(0.9, abs=0.04)  # clipped; not a single one was brought back


def test_a_coordinate_is_out_of_reach_if_no_rand_could_keep_it_in_the_box() -> None:  # Interpretation S7
    rng, found = np.random.default_rng(2), set()
    for _ in range(600):
        x, best = rng.uniform(-1.0, 1.0, 2)
        one = OMEGA, ACCELERATION, x, rng.uniform(-0.3, 0.3), best, 0.99, -0.15, 0.15
        # rand() of 0 or 1 gives the extremes, and all between them can be had
        ends = [kernels.step(r1, r2, *one, False, True)[1] for r1 in (0.0, 1.0) for r2 in (0.0, 1.0)]
        reachable = kernels.reachable(*one, False, True)
        assert reachable == (min(ends) <= 1.0 and max(ends) >= -1.0)
        found.add(reachable)
    assert found == {False, True}
