"""Intervals of joints and angles from weighted poses, each blurred by the model's error."""

from typing import Literal

import numpy as np

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton
from posefit.uncertainty.calibration import LEVELS, Recalibration
from posefit.uncertainty.modes import Posterior

HALVINGS = 12  # of where a radius may be: to a quarter of a thousandth of the widest
NARROWEST = 1e-6  # metres or radians: the least error of every pose
FARTHEST = 6.0  # spreads: the widest radius searched
CLOSE = 1e-3  # spreads: the least distance that a difference is divided by


def joint_intervals(
    skeleton: Skeleton, posterior: Posterior, pose: Array, world: bool = False
) -> Array:
    """Return the radii (levels, 27), metres, of the balls about the joints of a `pose` (66,) that hold the true ones.

    Joints are relative to the root, or in the `world`. A radius is the quantile, at each of the `LEVELS`, of the
    distance to a joint of a pose drawn by weight, with a normal error along each axis, times a factor; the posterior's
    recalibration has both. Where two modes are likely, the wider balls reach from one to the other.
    """
    model = posterior.recalibration or Recalibration()
    spreads = model.place_spreads if world else model.joint_spreads
    distances = np.linalg.norm(
        skeleton.joints(posterior.poses) - skeleton.joints(pose), axis=2
    )
    return np.asarray(
        model.joint_factors * quantiles(distances, posterior.weights, spreads, 3)
    )


def angle_intervals(posterior: Posterior, pose: Array) -> Array:
    """Return the intervals (levels, 66), radians, to either side of the angles of a `pose` (66,) for the true ones.

    As for joints, but an interval is never more than half a turn to either side.
    """
    model = posterior.recalibration or Recalibration()
    distances = np.abs(wrapped(posterior.poses - pose))
    halves = model.angle_factors * quantiles(
        distances, posterior.weights, model.angle_spreads, 1
    )
    return np.asarray(np.minimum(halves, np.pi))


def quantiles(
    distances: Array, weights: Array, spreads: Array, dimensions: Literal[1, 3]
) -> Array:
    """Return the radii (levels, n) that hold such shares of normal errors about points at distances (K, n)."""
    from scipy.special import ndtr

    spread = np.maximum(spreads, NARROWEST)
    away = np.maximum(distances, CLOSE * spread)
    levels = np.array(LEVELS)[:, None]
    low = np.zeros((len(LEVELS), len(spread)))
    high = np.tile(away.max(axis=0) + FARTHEST * spread, (len(LEVELS), 1))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        near, far = ((middle[:, None] + sign * away) / spread for sign in (-1.0, 1.0))
        inside = ndtr(near) - ndtr(-far)
        # the law of the noncentral chi with three degrees of freedom
        if dimensions == 3:
            inside -= (
                spread
                / away
                * (np.exp(-0.5 * near**2) - np.exp(-0.5 * far**2))
                / np.sqrt(2.0 * np.pi)
            )
        within = np.einsum("k,lkn->ln", weights, inside) >= levels
        low = np.where(within, low, middle)
        high = np.where(within, middle, high)
    return high
