"""Auger and Hansen 2005: restarts with a growing population."""

import numpy as np

from posefit.testing.toy import Toy, sphere
from posefit_evolution.cma import CMAES


def test_a_search_that_stagnates_starts_again_with_twice_the_population() -> None:  # AUGER2005 (restart)
    optimiser = CMAES(Toy(3), np.random.default_rng(0))
    sizes = []
    for _ in range(400):
        proposals = optimiser.ask()
        sizes.append(len(proposals))
        optimiser.tell(proposals, sphere(proposals))
    assert sizes[0] == 7
    assert set(sizes) >= {7, 14, 28}
    assert sorted(sizes) == sizes


def test_without_growth_it_starts_again_as_it_was() -> None:
    optimiser = CMAES(Toy(3), np.random.default_rng(0), growth=1)
    spreads = []
    for _ in range(300):
        proposals = optimiser.ask()
        assert len(proposals) == 7
        spreads.append(proposals.std())
        optimiser.tell(proposals, sphere(proposals))
    assert min(spreads) < 1e-6
    assert spreads[-1] > 1e-6 or (np.diff(np.log(spreads)) > 5.0).any()  # it has spread out again
