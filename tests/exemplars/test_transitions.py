"""What steps cost, said by somebody else."""

import numpy as np
import pytest

from posefit.arrays import Array
from posefit_exemplars import beam
from posefit_exemplars.beam import Transition
from posefit_exemplars.factory import exemplars
from tests.cases import cases
from tests.exemplars.conftest import Walk


def as_clips_go(transition: Transition) -> Array:
    """Return what a tracker of this walk asks of a step by itself."""
    steps = beam.Steps(0.03, np.radians(4.0), 12.0, 0.01, 0.03, 0.008)
    return beam.transition_costs(transition, steps=steps)


def too_few(transition: Transition) -> Array:
    """Return a cost of each state of the next frame only."""
    return np.zeros(len(transition.beam))


def no_numbers(transition: Transition) -> Array:
    """Return costs that are none."""
    return np.full((len(transition.before), len(transition.beam)), np.nan)


def poses(walk: Walk, transitions: str) -> Array:
    tracker = exemplars(walk.told(evaluations=300), transitions=transitions, lag=2)
    return np.array([frame.pose for frame in tracker.track(walk.seen[:4], np.random.default_rng(0))])


def test_a_model_of_ones_own_is_asked_for_every_step(walker: Walk) -> None:
    np.testing.assert_array_equal(poses(walker, f"{__name__}:as_clips_go"), poses(walker, "clips"))


def test_costs_that_are_not_a_number_for_every_step_are_refused(walker: Walk) -> None:
    for name in cases(["too_few", "no_numbers"]):
        with pytest.raises(ValueError, match=r"transitions must return finite costs of shape \(\d+, \d+\), got shape"):
            poses(walker, f"{__name__}:{name}")
