"""The detected joints as they are shown: hidden ones are predicted by a Kalman filter of their own. VSMM 2.7.

Each joint has a model of constant velocity with white-noise acceleration. They are for the eye; a hidden joint is no
measurement (Interpretation V9).
"""

import numpy as np

from posefit.arrays import Array

PUSH = 2.0  # pixels a frame squared: the deviation of a joint's acceleration
_STEP = np.kron([[1.0, 1.0], [0.0, 1.0]], np.eye(2))
_NOISE = PUSH**2 * np.kron([[0.25, 0.5], [0.5, 1.0]], np.eye(2))


class Shown:
    """Place and velocity of the 17 points in one image."""

    def __init__(self, points: Array) -> None:
        self._states = np.column_stack([points, np.zeros_like(points)])
        self._covariances = np.tile(np.diag([25.0, 25.0, 9.0, 9.0]), (len(points), 1, 1))

    def follow(self, points: Array, confidence: Array, variances: Array) -> Array:
        """Return the points (17, 2) one frame later, `variances` (17, 2) being those of what was detected."""
        states, covariances = self._states @ _STEP.T, _STEP @ self._covariances @ _STEP.T + _NOISE  # VSMM 2.7
        seen = np.flatnonzero(confidence > 0.0)
        across = covariances[seen][:, :, :2]
        innovation = across[:, :2] + variances[seen][:, :, None] * np.eye(2)
        gain = across @ np.linalg.inv(innovation)
        states[seen] += np.einsum("pij,pj->pi", gain, points[seen] - states[seen, :2])
        covariances[seen] -= gain @ across.transpose(0, 2, 1)
        self._states, self._covariances = states, covariances
        return np.array(states[:, :2])
