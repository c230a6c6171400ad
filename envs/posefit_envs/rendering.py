"""Rendered frames: overlaid silhouettes, the body from the side, and the cost."""

from typing import Any

import numpy as np
from gymnasium import error
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.output.drawing import blank, side_view, write
from posefit.output.picture import OVERLAP, panel_of
from posefit.silhouette.cost import project

MODES = ("rgb_array",)  # Gymnasium shows the pictures of "human" in its own window
HEIGHT = 240  # pixels
STRIP = 30  # pixels of the strip below the picture, for the label

Picture = NDArray[np.uint8]  # (height, width, 3) red, green, blue


def check_mode(mode: str | None) -> None:
    """Raise gymnasium.error.UnsupportedMode for an unknown render mode."""
    if mode is not None and mode not in MODES:
        wrap = ""
        if mode == "human":
            wrap = ": Gymnasium's wrapper HumanRendering shows these in a window"
        raise error.UnsupportedMode(
            f"render_mode must be one of {', '.join(MODES)}, got {mode!r}{wrap}"
        )


def render_frame(
    cost: Any, proposed: tuple[Array, Array] | None, label: str
) -> Picture:
    """Return the picture of a frame: overlap in each view, and a side view.

    Overlapping, missed and spilled pixels have three colours.

    Args:
        cost: The cost function of the frame.
        proposed: A pose (66,) and its translation (3,), or None.
        label: The text below the picture.
    """
    panels = []
    for camera, silhouette in zip(cost.cameras, cost.silhouettes, strict=True):
        mask = silhouette.mask
        body = np.zeros_like(mask)
        if proposed is not None:
            body = project(cost.body, camera, *proposed)
        # 0 for neither, 1 for the mask, 2 for the body, 3 for both
        overlap = mask.view(np.uint8) + 2 * body.view(np.uint8)
        panels.append(OVERLAP[panel_of(overlap, HEIGHT, sharp=True), 0])
    if proposed is not None:
        panels.append(side_view(cost.body, cost.cameras[0], *proposed, HEIGHT))
    else:
        panels.append(blank(HEIGHT, HEIGHT))
    image = np.hstack(panels)
    # OpenCV draws blue, green, red; the last line reverses the order of the channels
    words = blank(STRIP, image.shape[1])
    write(words, label, (8, 21), scale=0.6)
    return np.ascontiguousarray(np.vstack([image, words])[..., ::-1])
