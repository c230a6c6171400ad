"""Masks of a person in a video, made in another way than posefit's own: what a track is held against.

A pixel is changed where the frame differs from the median of the video by more than 18 grey levels in a channel. Gaps
of 11 pixels are closed, and the largest piece is taken, all its holes filled. Cast shadows are part of it.
"""

from collections.abc import Iterator

import cv2
import numpy as np

from posefit.footage.masks import Range
from posefit.footage.segmenting.film import Box
from posefit.footage.video import Video
from posefit.silhouette.foreground import Image, median_background
from posefit.silhouette.mask import Mask

GREY, GAP = 18, 11  # levels, pixels
LEARNED = 40  # frames that the median is of


def references(video: Video, size: tuple[int, int], roi: Box, frames: Range) -> Iterator[Mask]:
    """Yield a mask of the person for each frame, made without any of what `extract` does."""
    count = video.count()
    middle = median_background(list(video.frames(0, None, size, max(1, count // LEARNED)))[:LEARNED]).middle
    start, stop, _ = slice(*frames).indices(count)
    left, top, wide, tall = (round(value * size[0] / video.size[0]) for value in roi)
    for image in video.frames(start, stop, size):
        yield reference(image, middle.round().astype(np.uint8), (left, top, wide, tall))


def reference(image: Image, background: Image, roi: Box) -> Mask:
    """Return the largest closed and filled piece of what differs from the background, within roi."""
    left, top, wide, tall = roi
    changed = np.zeros(image.shape[:2], dtype=np.uint8)
    part = np.s_[top : top + tall, left : left + wide]
    changed[part] = cv2.absdiff(image, background).max(axis=2)[part] > GREY
    closed = cv2.morphologyEx(changed, cv2.MORPH_CLOSE, np.ones((GAP, GAP), dtype=np.uint8))
    outlines, _ = cv2.findContours(closed, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    filled = np.zeros_like(changed)
    cv2.drawContours(filled, [max(outlines, key=cv2.contourArea)], -1, 1, cv2.FILLED)
    return np.asarray(filled > 0)
