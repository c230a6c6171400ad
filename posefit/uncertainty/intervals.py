"""Intervals of joints and angles from weighted poses, blurred by the model's error."""

from typing import Literal

import numpy as np

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton
from posefit.uncertainty.calibration import LEVELS, Recalibration
from posefit.uncertainty.modes import Posterior

HALVINGS = 12  # of the range of a radius: a precision of a 4,096th of the widest
NARROWEST = 1e-6  # metres or radians; the smallest spread about a pose
FARTHEST = 6.0  # spreads that the widest radius reaches beyond the farthest pose
CLOSE = 1e-3  # spreads; the smallest distance by which anything is divided


def joint_intervals(
    skeleton: Skeleton, posterior: Posterior, pose: Array, world: bool = False
) -> Array:
    """Return radii of balls about the joints of a pose that contain the true joints.

    A radius is a quantile of the distance to the joint of a random pose of the
    posterior, which has a normal error along each axis. The quantile is multiplied by a
    factor. The posterior's recalibration has the errors and the factors. If two modes
    are likely, the wider balls reach from one to the other.

    Args:
        skeleton: The skeleton.
        posterior: The weighted poses.
        pose: The pose (66,).
        world: Whether the joints are in the world instead of relative to the root.

    Returns:
        The radii (levels, 27) in metres, for each of the `LEVELS`.

    Example:
        >>> import numpy as np
        >>> from posefit import joint_intervals, load_motion
        >>> from posefit.plugin import Posterior
        >>> walk = load_motion("walk")
        >>> posterior = Posterior(walk.poses[:4], walk.translations[:4], np.ones(4))
        >>> joint_intervals(walk.skeleton, posterior, walk.poses[1]).shape
        (3, 27)
    """
    model = posterior.recalibration or Recalibration()
    if world:
        spreads = model.place_spreads
    else:
        spreads = model.joint_spreads
    offsets = skeleton.joints(posterior.poses) - skeleton.joints(pose)  # (K, 27, 3)
    distances = np.linalg.norm(offsets, axis=2)
    radii = quantiles(distances, posterior.weights, spreads, 3)
    return np.asarray(model.joint_factors * radii)


def angle_intervals(posterior: Posterior, pose: Array) -> Array:
    """Return the intervals of a pose's angles that contain the true angles.

    They are computed in the same way as the radii of `joint_intervals`.

    Args:
        posterior: The weighted poses.
        pose: The pose (66,).

    Returns:
        The width of the interval to either side of each angle (levels, 66) in radians,
        at most half a turn.

    Example:
        >>> import numpy as np
        >>> from posefit import angle_intervals, load_motion
        >>> from posefit.plugin import Posterior
        >>> walk = load_motion("walk")
        >>> posterior = Posterior(walk.poses[:4], walk.translations[:4], np.ones(4))
        >>> angle_intervals(posterior, walk.poses[1]).shape
        (3, 66)
    """
    model = posterior.recalibration or Recalibration()
    distances = np.abs(wrapped(posterior.poses - pose))
    widths = quantiles(distances, posterior.weights, model.angle_spreads, 1)
    return np.asarray(np.minimum(model.angle_factors * widths, np.pi))


def quantiles(
    distances: Array, weights: Array, spreads: Array, dimensions: Literal[1, 3]
) -> Array:
    """Return radii that contain given shares of normal errors about weighted points.

    Args:
        distances: The distances of the points (K, n) from the centres of n balls.
        weights: The weights of the points (K,).
        spreads: The standard deviations of the errors (n,) along each axis.
        dimensions: The number of axes.

    Returns:
        The radii (levels, n), for each of the `LEVELS`.
    """
    from scipy.special import ndtr

    spread = np.maximum(spreads, NARROWEST)
    # A tracker samples its likeliest poses several times: of 24 points, 9 differ.
    points, numbers = np.unique(distances, axis=0, return_inverse=True)
    shares = np.bincount(numbers.ravel(), weights)
    away = np.maximum(points, CLOSE * spread)
    levels = np.array(LEVELS)[:, None]
    low = np.zeros((len(LEVELS), len(spread)))
    high = np.tile(away.max(axis=0) + FARTHEST * spread, (len(LEVELS), 1))
    # a mixture's distribution has no inverse in closed form: it is found by bisection
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        near = (middle[:, None] - away) / spread  # (levels, K, n)
        far = (middle[:, None] + away) / spread
        inside = ndtr(near) - ndtr(-far)
        # the distribution of the noncentral chi with three degrees of freedom
        if dimensions == 3:
            densities = np.exp(-0.5 * near**2) - np.exp(-0.5 * far**2)
            inside -= spread / away * densities / np.sqrt(2.0 * np.pi)
        within = np.einsum("k,lkn->ln", shares, inside) >= levels
        low = np.where(within, low, middle)
        high = np.where(within, middle, high)
    return high
