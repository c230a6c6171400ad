"""The search around a pose of the path."""

from functools import partial

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.geometry.skeleton import ANGLES
from posefit.registry import registry
from posefit_exemplars.exemplars import Exemplars
from posefit_exemplars.refinement import CARRIED, REACH, YAW, Surroundings, refined, surroundings
from tests.cases import each


def around(exemplars: Exemplars, off: Array | None = None) -> Surroundings:
    """Return the surroundings of a state, begun at an offset."""
    return surroundings(exemplars, exemplars.poses[9], exemplars.codes[9], np.zeros(ANGLES) if off is None else off)


def test_the_axes_are_principal_components_of_similar_poses(two: Exemplars) -> None:
    space = around(two)
    np.testing.assert_array_equal(space.poses(np.zeros((1, space.dimensions)))[0], two.poses[9])
    # all of the few poses are similar
    angles = two.poses - two.poses[9]
    covariance = np.cov(angles[:, 1:].T, bias=True)
    own = space.axes[:-1, 1:]
    np.testing.assert_allclose(own.T @ own, covariance, atol=1e-3)
    assert np.trace(own.T @ own) == pytest.approx(np.trace(covariance), rel=0.01)
    np.testing.assert_array_equal(space.axes[-1], np.eye(1, ANGLES)[0] * YAW)
    assert not space.axes[:-1, 0].any()  # the yaw is the last coordinate


def test_a_search_begins_near_the_offset_of_the_frame_before(two: Exemplars) -> None:
    plain = around(two)
    away = np.zeros(plain.dimensions)
    away[0], away[-1] = 0.4, -0.2  # in the box
    off = plain.poses(away[None])[0] - plain.pose
    space = around(two, off)
    np.testing.assert_allclose(space.start.mean, CARRIED * away, atol=1e-6)
    far = around(two, 100.0 * off)  # no farther than two standard deviations
    assert np.abs(far.start.mean).max() == pytest.approx(2.0 / REACH)


@each("name", ["cma", "sapso"])
@each("pull", [0.0, 0.3, 30.0])
def test_a_refined_pose_is_never_worse_than_the_first(two: Exemplars, name: str, pull: float) -> None:
    off = np.zeros(ANGLES)
    off[[0, 12, 20]] = 0.05, 0.2, -0.1
    space = around(two, off)
    target = two.poses[9] + 0.1 * space.axes[:3].sum(axis=0)
    evaluations = 0

    def cost(poses: Array) -> Array:
        nonlocal evaluations
        evaluations += len(poses)
        return np.asarray(50.0 * np.linalg.norm(poses - target, axis=1))

    def total_cost(pose: Array) -> float:
        """Return the cost and the pull, by the pose's coordinates along the orthogonal axes."""
        at = (pose - space.pose) @ np.linalg.pinv(space.axes)
        first = REACH * space.start.mean
        return float(cost(pose[None])[0] + 0.5 * pull * ((at**2).sum() + ((at - first) ** 2).sum()))

    make = partial(registry().optimiser(name))
    pose, used = refined(space, cost, make, pull, 300, np.random.default_rng(0))
    assert used == evaluations <= 301
    begin = space.poses(space.start.mean[None])[0]
    assert total_cost(pose) < total_cost(begin)

    def spike(poses: Array) -> Array:
        return np.asarray(100.0 * (poses != begin).any(axis=1))

    unchanged, _ = refined(space, spike, make, 0.0, 100, np.random.default_rng(0))
    np.testing.assert_array_equal(unchanged, begin)
