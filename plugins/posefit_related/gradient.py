"""Gauss-Newton steps from the predicted pose to the contours of the masks.

S. Wachter, H.-H. Nagel, Tracking persons in monocular image sequences, Computer Vision
and Image Understanding 74(3), 1999. An iterated extended Kalman filter tracks a body of
cones. It predicts the motion at constant velocity. From there, iterated linearisation
finds the pose that fits the picture's edges best.

Interpretations: the edges are the masks' contours, fitted like posefit's smoothing of
footage, robust against outliers. The covariance of the prediction is diagonal and the
same in all frames. Region information is not used. A step counts as the number of
evaluations that take the same time. The first pose is the best of some training poses.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from posefit.plugin import (
    Array,
    Frame,
    Observation,
    Task,
    at_least,
    contour_fit,
    positive,
)
from posefit_related.frames import costs_of, first_poses, frame_of, place_of

FIRST_SHARE = 0.5  # ours: of a first frame's evaluations, to find the first pose
# ours: standard deviations of a known and of a predicted root, in metres
KNOWN_SHIFT = 0.003
SHIFT = 0.05


class Gradient:
    """A prediction at constant velocity, and iterated steps to the contours.

    Settings:
        turn_degrees: Standard deviation of an angle from its prediction, above 0.
        damping: Share of the velocity that the prediction retains, 0 or more.
    """

    def __init__(
        self, task: Task, *, turn_degrees: float = 8.0, damping: float = 1.0
    ) -> None:
        positive("turn_degrees", turn_degrees)
        at_least("damping", damping, 0.0)
        self.task = task
        self.turn = float(np.radians(turn_degrees))
        self.damping = damping

    def track(
        self, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        """Yield a frame for each observation."""
        # poses and places of the last two frames
        latest: list[tuple[Array, Array]] = []
        for observation in observations:
            if not latest:
                pose, place, used = self._first(observation, rng)
            else:
                pose, place = predicted(latest, self.damping)
                used = 0
            if observation.translation is not None:
                place = np.array(observation.translation, dtype=np.float64)
            if observation.usable:
                shift = KNOWN_SHIFT
                if observation.translation is None:
                    shift = SHIFT
                pose, moved, effort = contour_fit(
                    self.task,
                    observation,
                    (pose, place),
                    (self.turn, shift),
                    self.task.evaluations - used - 1,
                )
                if observation.translation is None:
                    place = moved
                used = used + effort
            elif latest:
                pose = latest[-1][0]
                if observation.translation is None:
                    place = latest[-1][1]
            latest = [*latest, (pose, place)][-2:]
            yield frame_of(self.task, observation, pose, place, used)

    def _first(
        self, observation: Observation, rng: np.random.Generator
    ) -> tuple[Array, Array, int]:
        """Return the first pose and place, and the evaluations that they took."""
        count = max(int(FIRST_SHARE * self.task.evaluations), 1)
        poses = first_poses(self.task, rng, count)
        place, drawn = place_of(
            self.task,
            observation,
            poses[0],
            np.array(self.task.anchor, dtype=np.float64),
        )
        best = costs_of(
            self.task, observation, poses, np.tile(place, (count, 1))
        ).argmin()
        return poses[best], place, count + drawn


def predicted(latest: list[tuple[Array, Array]], damping: float) -> tuple[Array, Array]:
    """Return the pose and place predicted from the last two at constant velocity.

    A single pose and place are returned unchanged.
    """
    pose, place = latest[-1]
    before, place_before = latest[0]
    turns = (pose - before + np.pi) % (2.0 * np.pi) - np.pi
    # WACHTER1999 (prediction)
    return pose + damping * turns, place + damping * (place - place_before)
