"""The search around a pose of the path."""

from functools import partial

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.fitting.box import Space, converted, displacement, draw_population, repair, sample_normal, wrap
from posefit.geometry.skeleton import ANGLES
from posefit.registry import registry
from posefit_exemplars.exemplars import Exemplars
from posefit_exemplars.refinement import CARRIED, COMPONENTS, REACH, YAW, Surroundings, refined, surroundings
from tests.cases import each


def around(exemplars: Exemplars, off: Array | None = None) -> Surroundings:
    """Return the surroundings of a state, begun some way off it."""
    return surroundings(exemplars, exemplars.poses[9], exemplars.codes[9], np.zeros(ANGLES) if off is None else off)


def test_it_is_a_space_and_every_draw_lies_in_it(two: Exemplars) -> None:
    space: Space = around(two)
    rng = np.random.default_rng(0)
    assert space.start is not None
    assert 2 < space.dimensions <= COMPONENTS + 1
    for name in ("centre", "half", "periodic"):
        assert getattr(space, name).shape == (space.dimensions,)
    drawn = draw_population(space, rng, 300)
    assert drawn.shape == (300, space.dimensions)
    far = sample_normal(space, rng, drawn, np.full(space.dimensions, 5.0))
    mended = repair(space, 10.0 * drawn, space.start.mean)
    for proposals in (drawn, far, mended):
        assert space.feasible(proposals).all()
    np.testing.assert_array_equal(
        space.feasible(np.array([[1.1], [0.9], [-1.1]]) * np.ones(space.dimensions)), [0, 1, 0]
    )
    np.testing.assert_array_equal(wrap(space, drawn), drawn)
    np.testing.assert_array_equal(displacement(space, drawn, far), far - drawn)
    np.testing.assert_allclose(converted(space, drawn, space), drawn)


def test_its_middle_is_the_path_and_its_axes_are_how_poses_like_it_differ(two: Exemplars) -> None:
    space = around(two)
    np.testing.assert_array_equal(space.poses(np.zeros((1, space.dimensions)))[0], two.poses[9])
    # with no more poses than are taken, standard deviations add up to those of all
    angles = two.poses - two.poses[9]
    covariance = np.cov(angles[:, 1:].T, bias=True)
    own = space.axes[:-1, 1:]
    np.testing.assert_allclose(own.T @ own, covariance, atol=1e-3)
    assert np.trace(own.T @ own) == pytest.approx(np.trace(covariance), rel=0.01)
    np.testing.assert_array_equal(space.axes[-1], np.eye(1, ANGLES)[0] * YAW)
    assert not space.axes[:-1, 0].any()  # the yaw has a coordinate of its own


def test_a_search_begins_nearly_as_far_off_as_the_frame_before(two: Exemplars) -> None:
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
def test_what_is_found_is_never_worse_than_where_it_began(two: Exemplars, name: str, pull: float) -> None:
    off = np.zeros(ANGLES)
    off[[0, 12, 20]] = 0.05, 0.2, -0.1
    space = around(two, off)
    target = two.poses[9] + 0.1 * space.axes[:3].sum(axis=0)
    looked = 0

    def cost(poses: Array) -> Array:
        nonlocal looked
        looked += len(poses)
        return np.asarray(50.0 * np.linalg.norm(poses - target, axis=1))

    def whole(pose: Array) -> float:
        """Return the cost and the pull, from the pose's coordinates: the axes are orthogonal."""
        at = (pose - space.pose) @ np.linalg.pinv(space.axes)
        begun = REACH * space.start.mean
        return float(cost(pose[None])[0] + 0.5 * pull * ((at**2).sum() + ((at - begun) ** 2).sum()))

    make = partial(registry().optimiser(name))
    pose, used = refined(space, cost, make, pull, 300, np.random.default_rng(0))
    assert used == looked <= 301
    begin = space.poses(space.start.mean[None])[0]
    assert whole(pose) < whole(begin)  # and here it is better
    misled, _ = refined(
        space, lambda poses: np.asarray(100.0 * (poses != begin).any(axis=1)), make, 0.0, 100, np.random.default_rng(0)
    )
    np.testing.assert_array_equal(misled, begin)
