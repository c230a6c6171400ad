"""The person by MediaPipe's pose model in each frame."""

import math
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.fitting.check import between
from posefit.geometry.skeleton import JOINTS
from posefit.silhouette.foreground import Film, Image
from posefit.silhouette.mask import Mask

# shoulder and hip, in the model's numbers; x goes to the right, and z away
LEFT = (11, 23)
RIGHT = (12, 24)
SIDES = (1.0, 1.0, -1.0, -1.0)
# bones whose ends are joints of the model, in its numbers: those of the left, then 1 more for the right
_LEFT_POINTS = {
    "clavicle": 11,
    "humerus": 13,
    "radius": 15,
    "hipjoint": 23,
    "femur": 25,
    "tibia": 27,
    "toes": 31,
}
POINTS = {
    f"{side}{bone}": number + k
    for k, side in enumerate("lr")
    for bone, number in _LEFT_POINTS.items()
}


class MediaPipe:
    """One person by MediaPipe's pose model: detected in the picture, then followed from frame to frame.

    Of several people it takes the one detected most surely, and stays with them; a roi chooses another. It needs no
    still background and no still camera.

    Settings:
        confidence: how sure it has to be that a person is there, 0 to 1; lower detects small or distant people.
        threshold: of the soft mask, from which on a pixel is the person's, between 0 and 1.
    """

    def __init__(
        self, film: Film, *, confidence: float = 0.3, threshold: float = 0.5
    ) -> None:
        between("confidence", confidence, 0.0, 1.0)
        between("threshold", threshold, 0.0, 1.0, ends=False)
        self._threshold = threshold
        # in the latest picture: by the model's shoulders and hips
        self.facing = math.nan
        self.landmarks = np.zeros((len(JOINTS), 3))  # in the latest picture
        self._model = _model(confidence)

    def segment(self, image: Image) -> tuple[Mask, Mask]:
        """Return where the soft mask of the person is above the threshold, and that nothing is a shadow."""
        empty = np.zeros(image.shape[:2], dtype=bool)
        with warnings.catch_warnings():  # of its own use of protobuf
            warnings.simplefilter("ignore")
            result = self._model.process(np.ascontiguousarray(image[..., ::-1]))
        soft = result.segmentation_mask
        self.facing = _facing(result.pose_world_landmarks)
        self.landmarks = _landmarks(result.pose_landmarks, image.shape[:2])
        return (
            empty if soft is None else np.asarray(soft > self._threshold)
        ), empty.copy()


def _facing(landmarks: Any) -> float:
    """Return which way the person faces, as `Segmenter.facing`, by the model's joints in metres; NaN without one."""
    if landmarks is None:
        return math.nan
    points = [landmarks.landmark[k] for k in (*LEFT, *RIGHT)]
    across, away = (
        sum(getattr(p, axis) * sign for p, sign in zip(points, SIDES, strict=True))
        for axis in "xz"
    )
    return math.atan2(away, across)


def _landmarks(landmarks: Any, shape: tuple[int, ...]) -> Array:
    """Return the model's joints (27, 3), as `Segmenter.landmarks`, in a picture of a shape."""
    result = np.zeros((len(JOINTS), 3))
    if landmarks is not None:
        for joint, k in POINTS.items():
            point = landmarks.landmark[k]
            result[JOINTS.index(joint)] = (
                point.x * shape[1],
                point.y * shape[0],
                point.visibility,
            )
    return result


def _model(confidence: float) -> Any:
    with _silent(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from mediapipe.python.solutions.pose import Pose

        # smoothing mixes a frame with those before it, and silhouettes would lag behind
        model = Pose(
            model_complexity=1,
            enable_segmentation=True,
            smooth_segmentation=False,
            smooth_landmarks=False,
            min_detection_confidence=confidence,
            min_tracking_confidence=confidence,
        )
        # its log messages come with its first picture
        model.process(np.zeros((64, 64, 3), dtype=np.uint8))
    return model


@contextmanager
def _silent() -> Iterator[None]:
    """Discard what is written to stderr: the model's libraries log for their own developers there."""
    sys.stderr.flush()
    stderr = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(nowhere)
