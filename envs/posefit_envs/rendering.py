"""Pictures of an environment: the silhouettes on each other, the body from its side, and the cost in words."""

import numpy as np
from gymnasium import error
from numpy.typing import NDArray

from posefit import Problem
from posefit.arrays import Array
from posefit.output.drawing import blank, side_view, write
from posefit.output.picture import OVERLAP, panel_of
from posefit.silhouette.cost import project

MODES = ("rgb_array",)  # Gymnasium shows the pictures of "human" in its own window
HEIGHT = 240  # pixels
STRIP = 30  # pixels for the words below

Picture = NDArray[np.uint8]  # (height, width, 3) red, green, blue


def check_mode(mode: str | None) -> None:
    """Raise gymnasium.error.UnsupportedMode for an unknown render mode."""
    if mode is not None and mode not in MODES:
        raise error.UnsupportedMode(
            f"render_mode must be one of {', '.join(MODES)}, got {mode!r}"
        )


def render_frame(
    problem: Problem, pose: Array | None, translation: Array | None, label: str
) -> Picture:
    """Return the picture: each view with both, missed and spilled pixels in three colours, and the body's side."""
    panels = []
    for camera, silhouette in zip(problem.cameras, problem.silhouettes, strict=True):
        mask = silhouette.mask
        body = np.zeros_like(mask)
        if pose is not None and translation is not None:
            body = project(problem.body, camera, pose, translation)
        panels.append(
            OVERLAP[
                panel_of(
                    mask.view(np.uint8) + 2 * body.view(np.uint8), HEIGHT, sharp=True
                )
            ]
        )
    if pose is not None and translation is not None:
        panels.append(
            side_view(problem.body, problem.cameras[0], pose, translation, HEIGHT)
        )
    else:
        panels.append(blank(HEIGHT, HEIGHT))
    image = np.hstack(panels)
    words = blank(STRIP, image.shape[1])
    write(words, label, (8, 21), scale=0.6)
    return np.ascontiguousarray(np.vstack([image, words])[..., ::-1])
