"""Segments the person with MediaPipe's pose model in each frame."""

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

# shoulder and hip in the model's numbering; x goes to the right, z away
LEFT = (11, 23)
RIGHT = (12, 24)
SIDES = (1.0, 1.0, -1.0, -1.0)
# bones that end in a joint of the model, with its number on the left; on the right it
# is 1 more
_LEFT_POINTS = {
    "clavicle": 11,
    "humerus": 13,
    "radius": 15,
    "hipjoint": 23,
    "femur": 25,
    "tibia": 27,
    "toes": 31,
}
POINTS = {f"l{bone}": number for bone, number in _LEFT_POINTS.items()}
# MediaPipe numbers the right side's points one higher
POINTS |= {f"r{bone}": number + 1 for bone, number in _LEFT_POINTS.items()}


class MediaPipe:
    """One person, detected by MediaPipe's pose model, then followed through the frames.

    Of several people it takes the one detected with the highest confidence, and stays
    with them; a roi chooses another. It needs neither a still background nor a still
    camera.

    Settings:
        confidence: Minimum confidence of a detection, 0 to 1; lower values detect small
            or distant people.
        threshold: Value of the soft mask above which a pixel is the person's, between 0
            and 1.
    """

    def __init__(
        self, film: Film, *, confidence: float = 0.3, threshold: float = 0.5
    ) -> None:
        between("confidence", confidence, 0.0, 1.0)
        between("threshold", threshold, 0.0, 1.0, ends=False)
        self._threshold = threshold
        # in the latest picture; the direction is from the model's shoulders and hips
        self.facing = math.nan
        self.landmarks = np.zeros((len(JOINTS), 3))
        self._model = _model(confidence)

    def segment(self, image: Image) -> tuple[Mask, Mask]:
        """Return the soft mask above the threshold, and an empty mask of shadows."""
        empty = np.zeros(image.shape[:2], dtype=bool)
        with warnings.catch_warnings():  # about MediaPipe's use of protobuf
            warnings.simplefilter("ignore")
            result = self._model.process(np.ascontiguousarray(image[..., ::-1]))
        soft = result.segmentation_mask
        self.facing = _facing(result.pose_world_landmarks)
        self.landmarks = _landmarks(result.pose_landmarks, image.shape[:2])
        if soft is None:
            person = empty
        else:
            person = np.asarray(soft > self._threshold)
        return person, empty.copy()


def _facing(landmarks: Any) -> float:
    """Return the person's direction, as `Segmenter.facing`, or NaN without joints."""
    if landmarks is None:
        return math.nan
    points = [landmarks.landmark[k] for k in (*LEFT, *RIGHT)]
    across = 0.0
    away = 0.0
    for point, sign in zip(points, SIDES, strict=True):
        across += point.x * sign
        away += point.z * sign
    return math.atan2(away, across)


def _landmarks(landmarks: Any, shape: tuple[int, ...]) -> Array:
    """Return the model's joints (27, 3), as `Segmenter.landmarks`, in pixels."""
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

        # with smoothing, silhouettes would lag behind the frames
        model = Pose(
            model_complexity=1,
            enable_segmentation=True,
            smooth_segmentation=False,
            smooth_landmarks=False,
            min_detection_confidence=confidence,
            min_tracking_confidence=confidence,
        )
        # the first picture triggers log messages
        model.process(np.zeros((64, 64, 3), dtype=np.uint8))
    return model


@contextmanager
def _silent() -> Iterator[None]:
    """Discard stderr, where the model's libraries log for their own developers."""
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
