"""Auger and Hansen 2005: restarts with a growing population."""

import numpy as np

from posefit.fitting.cma import CMAES
from posefit.testing.toy import Toy, sphere


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
