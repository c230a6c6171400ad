"""What ways do not know of their own error: by what is seen in a frame."""

import math
from dataclasses import replace

import numpy as np
import pytest

from posefit.fitting.tracker import Observation
from posefit.geometry.symmetry import facing, mirrored_poses, reflected_poses
from posefit.motion import built_in
from posefit.motion.built_in import average_skeleton
from posefit.uncertainty.modes import Posterior
from posefit_exemplars.calibration import evidence, recalibrated, stored_calibration
from posefit_exemplars.factory import exemplars
from posefit_exemplars.frame_costs import FrameCosts
from tests.cases import cases
from tests.exemplars.conftest import EMPTY, Walk, walk_of

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


def test_whoever_fits_badly_is_less_sure() -> None:
    good, bad = (recalibrated(drawn(0.1), np.zeros(66), cost, Shown()).recalibration for cost in (2.0, 20.0))  # type: ignore[arg-type]
    assert good is not None
    assert bad is not None
    assert (bad.joint_spreads[1:] > good.joint_spreads[1:]).all()


def test_nobody_is_more_in_doubt_than_where_nothing_is_seen() -> None:
    blind = Shown()
    blind.usable = False  # type: ignore[misc]
    for cost in (0.0, 5.0):
        told = recalibrated(drawn(0.1), np.zeros(66), cost, blind).recalibration  # type: ignore[arg-type]
        assert told is not None
        most = math.exp(stored_calibration().range[1])
        np.testing.assert_allclose(told.joint_spreads, most * stored_calibration().joint_spreads)


def test_every_level_is_wider_than_the_one_before() -> None:
    doubt = stored_calibration()
    assert doubt.joint_factors.shape == (3, 27)
    assert doubt.angle_factors.shape == (3, 66)
    assert (doubt.joint_factors[:, 1:] > 0.0).all()
    assert doubt.slopes[1] > 0.0
    assert replace(doubt).as_dict() == doubt.as_dict()


def test_frames_are_told_with_their_recalibration(walker: Walk) -> None:
    tracker = exemplars(walker.told(), samples=4)
    for frame in tracker.track(walker.seen[:3], np.random.default_rng(0)):
        assert frame.posterior is not None
        assert frame.posterior.recalibration is not None
        assert frame.posterior.recalibration.sharpness == stored_calibration().sharpness


def test_the_greater_the_doubt_the_likelier_no_mode_is_right() -> None:
    none = [stored_calibration().none_right(log) for log in np.linspace(stored_calibration().range[0], -1.0, 20)]
    assert np.all(np.diff(none) > 0.0)
    assert none[0] < 0.05
    assert none[-1] > 0.5
    assert recalibrated(drawn(0.1), np.zeros(66), 5.0, Shown()).recalibration.none > 0.0  # type: ignore[arg-type, union-attr]


def test_twins_cost_what_the_mirrored_and_each_reflected_pose_costs() -> None:
    for views in cases([(45.0,), (45.0, 135.0)]):
        walk = walk_of(built_in.motion("walk-a", frames=1), views)
        look, pose, place = FrameCosts(walk.task, walk.seen[0]), walk.motion.poses[0], walk.motion.translations[0]
        skeleton = walk.motion.skeleton
        turned = [reflected_poses(skeleton, pose[None], facing(camera, place)) for camera in walk.task.cameras]
        for cost, twin in zip(look.twins(pose, place), [mirrored_poses(skeleton, pose[None]), *turned], strict=True):
            assert cost == pytest.approx(look.measured(twin[0], place)[0])


def test_twins_of_who_is_seen_from_the_side_cost_little_and_by_a_second_camera_more() -> None:
    motion = built_in.motion("walk-a", frames=6)

    def costs(*views: float) -> tuple[float, float]:
        walk = walk_of(motion, views)
        told = zip(walk.seen, motion.poses, motion.translations, strict=True)
        twins = np.array([FrameCosts(walk.task, seen).twins(pose, place) for seen, pose, place in told])
        return float(twins[:, 0].mean()), float(twins[:, 1:].min(axis=1).mean())

    aside, oblique, both = costs(90.0), costs(45.0), costs(90.0, 0.0)
    assert oblique[0] > 3.0 * aside[0]  # whom a camera sees obliquely it sees mirrored at once
    assert min(both) > 1.5 * min(aside)


def test_a_twin_of_a_pose_that_is_aligned_is_aligned_as_that_is() -> None:
    walk = walk_of(built_in.motion("walk-a", frames=1))
    look, pose = FrameCosts(walk.told(translation="aligned"), walk.seen[0]), walk.motion.poses[0]
    place = walk.motion.translations[0] + [0.02, -0.01, 0.0]  # where smoothing has moved it
    poses = np.concatenate([pose[None], mirrored_poses(walk.motion.skeleton, pose[None])])
    placed = look.placed(poses, np.repeat(place[None], 2, axis=0))
    moved = placed[1] + place - placed[0]
    assert look.twins(pose, place)[0] == pytest.approx(look.measured(poses[1], moved)[0])


def test_frames_say_what_their_twins_cost_and_count_them(walker: Walk) -> None:
    seen = [*walker.seen[:2], Observation(EMPTY, None, usable=False)]
    told, plain = (
        list(exemplars(walker.told(), samples=samples).track(seen, np.random.default_rng(0))) for samples in (4, 0)
    )
    for one, other in zip(told[:2], plain[:2], strict=True):
        np.testing.assert_array_equal(one.pose, other.pose)
        assert one.evaluations == other.evaluations + 2
        look = FrameCosts(walker.told(), seen[told.index(one)])
        np.testing.assert_allclose(one.details["twins"], look.twins(one.pose, one.translation), atol=1e-9)
        assert "twins" not in other.details
    assert len(told[2].details["twins"]) == 0
    assert told[2].evaluations == 1
