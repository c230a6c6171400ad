"""What ways do not know of their own error: by what is seen in a frame."""

import math
from dataclasses import replace

import numpy as np
import pytest

from posefit.motion.built_in import average_skeleton
from posefit.posterior.modes import Posterior
from posefit_exemplars.doubt import evidence, learned, recalibrated
from posefit_exemplars.factory import exemplars
from tests.exemplars.conftest import Walk

SKELETON = average_skeleton()


class Shown:
    """A look at a person by one camera."""

    skeleton, cameras, usable = SKELETON, 1, True


def drawn(apart: float) -> Posterior:
    poses = apart * np.random.default_rng(0).standard_normal((24, 66))
    return Posterior(poses, np.zeros((24, 3)), np.ones(24))


def test_evidence_is_of_cost_spread_and_cameras() -> None:
    one, two = (evidence(SKELETON, drawn(0.1), np.zeros(66), 5.0, cameras) for cameras in (1, 2))
    assert (one[0], one[1], one[3], two[3]) == (1.0, math.log(5.0), 0.0, 1.0)
    assert evidence(SKELETON, drawn(0.3), np.zeros(66), 5.0, 1)[2] > one[2]
    assert np.isfinite(evidence(SKELETON, drawn(0.0), np.zeros(66), 0.0, 1)).all()


def test_whoever_fits_badly_is_less_sure_and_sides_are_sooner_unknown() -> None:
    good, bad = (recalibrated(drawn(0.1), np.zeros(66), cost, Shown()).recalibration for cost in (2.0, 20.0))  # type: ignore[arg-type]
    assert good is not None
    assert bad is not None
    assert (bad.joint_spreads[1:] > good.joint_spreads[1:]).all()
    assert bad.second_side <= good.second_side


def test_nobody_is_more_in_doubt_than_where_nothing_is_seen() -> None:
    blind = Shown()
    blind.usable = False  # type: ignore[misc]
    for cost in (0.0, 5.0):
        told = recalibrated(drawn(0.1), np.zeros(66), cost, blind).recalibration  # type: ignore[arg-type]
        assert told is not None
        most = math.exp(learned().range[1])
        np.testing.assert_allclose(told.joint_spreads, most * learned().joint_spreads)


def test_every_level_is_wider_than_the_one_before() -> None:
    doubt = learned()
    assert doubt.joint_factors.shape == (3, 27)
    assert doubt.angle_factors.shape == (3, 66)
    assert (doubt.joint_factors[:, 1:] > 0.0).all()
    assert doubt.sides[1] > 0.0
    assert doubt.slopes[1] > 0.0
    assert replace(doubt).as_dict() == doubt.as_dict()


def test_frames_are_told_with_their_recalibration(walker: Walk) -> None:
    tracker = exemplars(walker.told(), samples=4)
    for frame in tracker.track(walker.seen[:3], np.random.default_rng(0)):
        assert frame.posterior is not None
        assert frame.posterior.recalibration is not None
        assert frame.posterior.recalibration.sharpness == learned().sharpness


@pytest.mark.parametrize("log", [-4.0, -2.0, -0.5])
def test_sides_are_unknown_from_the_probability_on_that_is_held(log: float) -> None:
    doubt = learned()
    least = doubt.second_side(log)
    probable = 1.0 / (1.0 + math.exp(-(doubt.sides @ [1.0, least, log])))
    assert 0.0 <= least <= 1.0
    if 0.0 < least < 1.0:
        assert probable == pytest.approx(doubt.unknown)
