"""Arms drawn by hand on a walk: held out to the sides, or one of them waving. No clip of ours shows either alone."""

import numpy as np
from scipy.optimize import least_squares

from posefit.arrays import Array
from posefit.geometry.skeleton import ANGLES, JOINTS, Skeleton, angle_index

PHASES = 48  # of a cycle, at which the arms are drawn
SWING = np.radians(28.0)  # a waving forearm, to either side of upright
WAVES = 2  # in a cycle
BOB = np.radians(5.0)  # arms held out sink and rise once a cycle


def held_out(phases: Array, side: float) -> tuple[Array, Array]:
    """Return where upper arm and forearm point (n, 3) when the arm is held out; `side` is 1 for the left."""
    lift = -0.05 + np.sin(BOB) * side * np.cos(2.0 * np.pi * phases)
    flat = np.full(len(phases), side)
    return np.column_stack([flat, lift, 0.05 + 0.0 * flat]), np.column_stack([flat, lift + 0.1, 0.25 + 0.0 * flat])


def waving(phases: Array, side: float) -> tuple[Array, Array]:
    """Return where upper arm and forearm point (n, 3) when the hand waves beside the head."""
    swing = SWING * np.sin(2.0 * np.pi * WAVES * phases)
    flat = np.full(len(phases), side)
    upper = np.column_stack([flat, -0.15 + 0.0 * flat, 0.2 + 0.0 * flat])
    return upper, np.column_stack([side * np.sin(swing) + 0.1 * side, np.cos(swing), 0.15 + 0.0 * flat])


def drawn(skeleton: Skeleton, side: str, upper: Array, fore: Array) -> tuple[list[int], Array]:
    """Return the angles' places in a pose, and the angles (n, 4), of an arm that points where it should.

    Each pose starts from the one before, so that the angles go on smoothly.
    """
    shoulder, elbow, wrist = (JOINTS.index(side + name) for name in ("clavicle", "humerus", "radius"))
    first, bend = angle_index(elbow), angle_index(wrist)
    places = [first, first + 1, first + 2, bend]

    def residual(angles: Array, upper: Array, fore: Array, before: Array) -> Array:
        pose = np.zeros((1, ANGLES))
        pose[0, places] = angles
        joints = skeleton.joints(pose)[0]
        ways = (joints[elbow] - joints[shoulder], upper), (joints[wrist] - joints[elbow], fore)
        off = [way / np.linalg.norm(way) - wanted / np.linalg.norm(wanted) for way, wanted in ways]
        return np.concatenate([*off, 0.02 * (angles - before)])

    solutions = np.zeros((len(upper), 4))
    guess = np.radians([0.0, 0.0, 0.0, 40.0])
    for k in range(len(upper)):
        guess = np.asarray(least_squares(residual, guess, args=(upper[k], fore[k], guess)).x)
        solutions[k] = guess
    return places, solutions
