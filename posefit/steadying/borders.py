"""Where the border of a person's mask is, frame by frame, as far as it is known."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.tracker import Observation
from posefit.geometry.camera import Camera
from posefit.silhouette.mask import PIECE, Mask
from posefit.silhouette.pyramid import coarser_camera, coarser_silhouette

FINE = 80.0  # pixels of a metre; of finer masks every second pixel, third, ... is looked at
MARGIN = 48  # pixels around a mask that know how far they are from it
SPAN = 12.0  # millimetres, about, of the border between two points of it

Distances = NDArray[np.float32]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Borders:
    """What one camera knows of the border in T frames; a frame that shows too little has no points."""

    camera: Camera  # whose pixels these are: of fine masks a coarser one than theirs
    metres: Array  # (T,) pixels of a metre where the person is
    step: float  # pixels of the border that a point stands for
    fields: Distances = field(repr=False)  # (T, h, w) pixels outside the mask, below 0 within; 0 where nobody knows
    corners: Integers = field(repr=False)  # (T, 2) column and row of each field's first pixel
    sizes: Integers = field(repr=False)  # (T, 2) rows and columns of each field
    points: Array = field(repr=False)  # (n, 2) pixels: of the borders, frame after frame
    starts: Integers = field(repr=False)  # (T + 1,) where the points of each frame begin

    @classmethod
    def of(cls, camera: Camera, view: int, observations: Sequence[Observation], places: Array) -> Self:
        """Return the borders that a camera, number `view`, saw of a person whose root is about at `places` (T, 3)."""
        far = np.maximum(camera.project(places)[1], 0.1)
        metres = np.sqrt(camera.focal.prod()) / far
        factor = max(int(np.median(metres) / FINE), 1)
        factor = min(factor, camera.width, camera.height)
        camera, metres = coarser_camera(camera, factor), metres / factor
        step = max(int(np.median(metres) * SPAN / 1e3), 1)
        found = [_border(observation, view, factor, step) for observation in observations]
        sizes = np.array([one.shape for _, _, one in found])
        fields = np.zeros((len(found), *sizes.max(axis=0)), dtype=np.float32)
        for whole, (_, _, one) in zip(fields, found, strict=True):
            whole[: one.shape[0], : one.shape[1]] = one
        points = [points for points, _, _ in found]
        starts = np.cumsum([0, *(len(one) for one in points)])
        corners = np.array([corner for _, corner, _ in found])
        return cls(camera, metres, float(step), fields, corners, sizes, np.concatenate(points), starts)


def _border(observation: Observation, view: int, factor: int, step: int) -> tuple[Array, tuple[int, int], Distances]:
    """Return every `step`th point of a mask's border (n, 2), and the corner and the distances about it."""
    nothing = np.empty((0, 2)), (0, 0), np.zeros((1, 1), dtype=np.float32)
    if not observation.usable:
        return nothing
    silhouette = coarser_silhouette(observation.silhouettes[view], factor)
    mask = _large(silhouette.mask)
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return nothing
    top, left = max(int(rows[0]) - MARGIN, 0), max(int(columns[0]) - MARGIN, 0)
    part = np.s_[top : rows[-1] + 1 + MARGIN, left : columns[-1] + 1 + MARGIN]
    mask = mask[part]
    around = silhouette.valid[part] & ~mask  # nobody is seen there
    if not around.any():
        return nothing
    pixels = np.concatenate([_between(mask, around), _between(mask.T, around.T)[:, ::-1]])
    return pixels[::step] + np.array([left, top]), (left, top), distances_outside(mask, around)


def distances_outside(mask: Mask, around: Mask) -> Distances:
    """Return how far pixels (h, w) are outside a mask's border, below 0 within, and 0 where neither is true."""
    out, within = (cv2.distanceTransform((~one).astype(np.uint8), cv2.DIST_L2, 5) - 0.5 for one in (mask, around))
    return np.asarray(np.where(mask, -within, np.where(around, out, 0.0)), dtype=np.float32)


def _between(mask: Mask, around: Mask) -> Array:
    """Return the middles (n, 2) of edges between a pixel of the mask and its neighbour to the side."""
    meet = (mask[:, 1:] & around[:, :-1]) | (mask[:, :-1] & around[:, 1:])
    rows, columns = np.nonzero(meet)
    return np.column_stack([columns + 1.0, rows + 0.5])


def _large(mask: Mask) -> Mask:
    """Return a mask without its small pieces, which are not the person."""
    count, numbers, pieces, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    if count <= 2:
        return mask
    sizes = pieces[1:, cv2.CC_STAT_AREA]
    return np.asarray(np.append(False, sizes >= PIECE * sizes.max())[numbers])
