"""Pictures of an environment: the silhouettes on each other, the body from its side, and the cost in words."""

import cv2
import numpy as np
from gymnasium import error
from numpy.typing import NDArray

from posefit import PoseProblem
from posefit.arrays import Array
from posefit.output.drawing import BACKGROUND, BOTH, MISSED, SPILLED, TEXT, side_view
from posefit.silhouette.cost import project

MODES = ("rgb_array",)  # Gymnasium shows the pictures of "human" in its own window
HEIGHT = 240  # pixels
STRIP = 30  # pixels for the words below

Picture = NDArray[np.uint8]  # (height, width, 3) red, green, blue


def check_mode(mode: str | None) -> None:
    """Raise gymnasium.error.UnsupportedMode for an unknown render mode."""
    if mode is not None and mode not in MODES:
        raise error.UnsupportedMode(f"render_mode must be one of {', '.join(MODES)}, got {mode!r}")


def render_frame(problem: PoseProblem, pose: Array | None, translation: Array | None, label: str) -> Picture:
    """Return the picture: each view with both, missed and spilled pixels in three colours, and the body's side."""
    panels = []
    for camera, silhouette in zip(problem.cameras, problem.silhouettes, strict=True):
        mask = silhouette.mask
        body = np.zeros_like(mask)
        if pose is not None and translation is not None:
            body = project(problem.body, camera, pose, translation)
        image = np.full((*mask.shape, 3), BACKGROUND, dtype=np.uint8)
        image[mask & ~body], image[body & ~mask], image[mask & body] = MISSED, SPILLED, BOTH
        width = 2 * round(mask.shape[1] * HEIGHT / mask.shape[0] / 2)
        panels.append(cv2.resize(image, (width, HEIGHT), interpolation=cv2.INTER_NEAREST))
    if pose is not None and translation is not None:
        panels.append(side_view(problem.body, problem.cameras[0], pose, translation, HEIGHT))
    else:
        panels.append(np.full((HEIGHT, HEIGHT, 3), BACKGROUND, dtype=np.uint8))
    image = np.hstack(panels)
    words = np.full((STRIP, image.shape[1], 3), BACKGROUND, dtype=np.uint8)
    cv2.putText(words, label, (8, 21), cv2.FONT_HERSHEY_SIMPLEX, 0.6, TEXT, 1, cv2.LINE_AA)
    return np.ascontiguousarray(np.vstack([image, words])[..., ::-1])
