"""The hypotheses of a frame: poses with their motion, which no clip need contain."""

from typing import NamedTuple, Self

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Task
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES, JOINTS, root_centred
from posefit_exemplars.kernels import Rows

# Metres, the standard deviation of the joints of poses that count as the same, with one
# camera: see `same_distance`.
SAME_DISTANCE = 0.03


def same_distance(cameras: int) -> float:
    """Return the distance, metres, at which hypotheses count as the same pose.

    Nearer ones continue as one. It is also the standard deviation of the mean that is
    reported. The more cameras show the person, the better they tell similar poses
    apart.
    """
    return SAME_DISTANCE / cameras**2


class Hypotheses(NamedTuple):
    """The hypotheses of one frame."""

    poses: Array  # (n, 66)
    places: Array  # (n, 3)
    joints: Array  # (n, 27, 3) metres, the root at the origin
    # the changes since the frame before, 0 for fresh hypotheses
    turns: Array  # (n, 66) radians
    shifts: Array  # (n, 3) metres
    rates: Array  # (n, 27, 3) metres

    @classmethod
    def none(cls) -> Self:
        """Return no hypotheses, for the time before the first frame."""
        poses = np.empty((0, ANGLES))
        places = np.empty((0, 3))
        joints = np.empty((0, len(JOINTS), 3))
        return cls(poses, places, joints, poses, places, joints)

    @classmethod
    def of(
        cls,
        task: Task,
        poses: Array,
        places: Array,
        parents: Rows,
        before: "Hypotheses",
    ) -> Self:
        """Return hypotheses with their motion since the frame before.

        Args:
            task: The task, for the skeleton of its body.
            poses: (n, 66).
            places: (n, 3) metres.
            parents: (n,) the rows of `before` that they continue, or -1 for fresh ones.
            before: The hypotheses of the frame before.
        """
        joints = root_centred(task.body.skeleton.joints(poses))
        turns = np.zeros_like(poses)
        shifts = np.zeros_like(places)
        rates = np.zeros_like(joints)
        continued = parents >= 0
        rows = parents[parents >= 0]
        turns[continued] = wrapped(poses[continued] - before.poses[rows])
        shifts[continued] = places[continued] - before.places[rows]
        rates[continued] = joints[continued] - before.joints[rows]
        return cls(poses, places, joints, turns, shifts, rates)

    def continued(self, rows: Rows) -> tuple[Array, Array]:
        """Return poses (n, 66) and places (n, 3) one frame later, at the same speed."""
        poses = self.poses[rows] + self.turns[rows]
        places = self.places[rows] + self.shifts[rows]
        return poses, places

    def squares_from(self, row: int) -> Array:
        """Return the mean squared distances (n,) of joints from one row's, metres^2."""
        offsets = self.joints - self.joints[row]  # (n, 27, 3)
        return np.asarray((offsets**2).sum(axis=2).mean(axis=1))
