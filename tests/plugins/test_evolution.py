"""`cma` at the sides of its box, and round a circle."""

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.fitting.box import Start, displacement
from posefit.testing.toy import Toy
from posefit_evolution.cma import CMAES
from tests.cases import each


@each(("redraws", "share"), [(0, 0.4602), (4, 0.4602**5)])
def test_what_leaves_the_box_is_drawn_again_before_it_is_moved_to_its_side(redraws: int, share: float) -> None:
    # a tenth of a standard deviation from the side, 46.02 % of all draws are beyond it
    space = Toy(2, start=Start(np.array([0.99, 0.0]), np.array([0.1, 0.01]), np.zeros(2)))
    asked = CMAES(space, np.random.default_rng(0), population_size=4000, redraws=redraws).ask()
    assert space.feasible(asked).all()
    assert (asked[:, 0] == 1.0).mean() == pytest.approx(share, abs=0.02)


@each("wrapping", [1, 2])
def test_a_target_at_the_seam_of_a_circle_is_found(wrapping: int) -> None:
    space = Toy(5, wrapping=wrapping)
    target = np.where(space.periodic, 0.98, 0.3)

    def away(proposals: Array) -> Array:
        return np.asarray((displacement(space, target, proposals) ** 2).sum(axis=1))

    optimiser = CMAES(space, np.random.default_rng(0))
    for _ in range(100):
        proposals = optimiser.ask()
        assert space.feasible(proposals).all()
        optimiser.tell(proposals, away(proposals))
    assert away(proposals).max() < 1e-6


def test_settings_out_of_range_are_refused_by_name() -> None:
    for wrong in ({"population_size": 4}, {"spread": 0.0}, {"growth": 0}, {"redraws": -1}, {"lag": -0.1}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            CMAES(Toy(2), np.random.default_rng(0), **wrong)
