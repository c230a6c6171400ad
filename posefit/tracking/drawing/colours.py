"""The colours of pictures, as OpenCV has them: blue, green, red; and words in such pictures."""

from typing import Any

import cv2

from posefit.silhouette.foreground import Image

BACKGROUND = (28, 24, 22)
BOTH, MISSED, SPILLED = (186, 214, 168), (90, 90, 235), (235, 160, 70)  # Y, R, B
LEFT, RIGHT, MIDDLE = (80, 150, 245), (225, 165, 85), (205, 205, 205)
OTHER = (198, 156, 227)  # what else a frame may show
TEXT = (240, 240, 240)
LINES = (70, 66, 64)  # of a chart
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def write(image: Image, text: str, at: tuple[int, int], colour: Any = TEXT, scale: float = 0.5) -> None:
    """Write a text into an image."""
    cv2.putText(image, text, at, _FONT, scale, colour, 1, cv2.LINE_AA)


def width_of(text: str, scale: float = 0.5) -> int:
    """Return how many pixels wide a text is."""
    return int(cv2.getTextSize(text, _FONT, scale, 1)[0][0])


def hexadecimal(colour: tuple[int, int, int]) -> str:
    """Return a colour as a page has it."""
    blue, green, red = colour
    return f"#{red:02x}{green:02x}{blue:02x}"
