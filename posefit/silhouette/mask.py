"""Masks, the silhouette of one view as bit images, and both smaller: every second pixel of every second row."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, Bits
from posefit.errors import InputError
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.reading import quoted
from posefit.silhouette.rasteriser import strips_and_words
from posefit.silhouette.spans import STRIP_PIXELS

Mask = NDArray[np.bool_]  # (height, width)
Areas = NDArray[np.int64]  # (..., 3): R, B, Y

# of the largest piece's pixels, ours: a smaller one is left out of the person's borders
MIN_PIECE_PIXELS = 0.06


def pack(mask: Mask) -> Bits:
    """Return the bit image (strips, words) of a mask (height, width)."""
    height, width = mask.shape
    strips, words = strips_and_words(width, height)
    octets = np.zeros((2 * words, STRIP_PIXELS // 8 * strips), dtype=np.uint8)
    packed = np.packbits(mask, axis=1, bitorder="little")
    octets[:height, : packed.shape[1]] = packed
    return np.ascontiguousarray(octets.view("<u4").T.astype(np.uint32)).view(np.uint64)


def unpack(bits: Bits, width: int, height: int) -> Mask:
    """Return the mask (..., height, width) of a bit image (..., strips, words)."""
    rows = bits.view(np.uint32).swapaxes(-1, -2)[..., :height, :]
    octets = np.ascontiguousarray(rows.astype("<u4")).view(np.uint8)
    return np.unpackbits(octets, axis=-1, count=width, bitorder="little").view(bool)


def box_of(mask: Mask) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom of a mask with pixels; the last two are the first outside."""
    rows = np.flatnonzero(mask.any(axis=1))
    columns = np.flatnonzero(mask.any(axis=0))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def touches_border(mask: Mask) -> bool:
    """Return whether a mask touches the picture's border."""
    return bool(mask[[0, -1]].any() or mask[:, [0, -1]].any())


def padded_box(mask: Mask, margin: int) -> tuple[slice, slice]:
    """Return the rows and columns of a mask's box with a margin in pixels; the first pixel where it is empty."""
    left, top, wide, tall = cv2.boundingRect(mask.astype(np.uint8))
    if not wide:
        return slice(1), slice(1)
    return slice(max(top - margin, 0), top + tall + margin), slice(
        max(left - margin, 0), left + wide + margin
    )


def without_small_pieces(mask: Mask) -> Mask:
    """Return a mask without its small pieces, which are not the person."""
    box = padded_box(mask, 0)  # in less time than in the whole mask
    count, numbers, pieces, _ = cv2.connectedComponentsWithStats(
        mask[box].astype(np.uint8), connectivity=8
    )
    if count <= 2:
        return mask
    sizes = pieces[:, cv2.CC_STAT_AREA]
    cleaned = np.zeros_like(mask)
    large = sizes >= MIN_PIECE_PIXELS * sizes[1:].max()
    large[0] = False  # the background
    cleaned[box] = large[numbers]
    return cleaned


@dataclass(frozen=True, eq=False)
class Silhouette:
    """The person's pixels in one camera's image, and which pixels are known at all."""

    mask: Mask = field(repr=False)  # (height, width); unknown pixels are False
    valid: Mask = field(repr=False)  # (height, width)
    # every so many pixels of every so many rows of the full-size silhouette
    scale: int = 1
    # where poses are drawn to be compared with it; None is the CPU
    device: "Device | None" = None
    # at full size, in these pixels; () where it is
    full_extent: tuple[float, ...] = field(default=(), repr=False)

    @classmethod
    def of(
        cls, mask: NDArray[np.generic], valid: NDArray[np.generic] | None = None
    ) -> "Silhouette":
        """Return the silhouette of a mask (height, width), any value but 0 being the person.

        Pixels where `valid` is 0 are unknown and count for nothing. Both arrays are read-only: what a method writes
        into them would falsify its own audit. Raises InputError where shapes differ.
        """
        values = np.asarray(mask)
        if values.ndim != 2 or 0 in values.shape:
            raise InputError(
                f"mask must have shape (height, width), got {values.shape}"
            )
        known = (
            np.ones(values.shape, dtype=bool)
            if valid is None
            else np.array(valid, dtype=bool)
        )
        if known.shape != values.shape:
            raise InputError(
                f"valid must have the mask's shape {values.shape}, got {known.shape}"
            )
        person = values.astype(bool, copy=False) & known
        for plane in (person, known):
            plane.flags.writeable = False
        return cls(person, known)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.mask.shape[1], self.mask.shape[0]

    @cached_property
    def bits(self) -> tuple[Bits, Bits]:
        """The bit images of `mask` and `valid`."""
        return pack(self.mask), pack(self.valid)

    @cached_property
    def pixels(self) -> int:
        """How many pixels the person has."""
        return int(np.count_nonzero(self.mask))

    @cached_property
    def known(self) -> bool:
        """Whether anything is known at all."""
        return bool(self.valid.any())

    @cached_property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, top, right and bottom border of the person in pixels; NaN at the image's edge, and where none is there.

        Small pieces that lie apart are not the person: a stray pixel would move them by half its distance.
        """
        if self.full_extent:
            left, top, right, bottom = self.full_extent
            return left, top, right, bottom
        if not self.mask.any():
            return (np.nan,) * 4
        left, top, right, bottom = box_of(without_small_pieces(self.mask))
        width, height = self.size
        return (
            float(left) if left > 0 else np.nan,
            float(top) if top > 0 else np.nan,
            float(right) if right < width else np.nan,
            float(bottom) if bottom < height else np.nan,
        )


class Device(Protocol):
    """Draws poses and counts their areas somewhere else than on the CPU; plugins register some."""

    def areas(
        self,
        body: Body,
        camera: Camera,
        silhouette: Silhouette,
        poses: Array,
        translations: Array,
    ) -> Areas:
        """Return R, B, Y (n, 3) in pixels of poses (n, 66) at translations (n, 3).

        They are those that `posefit.silhouette.cost.areas` counts on a CPU, where shapes have been checked.
        """


def coarser_camera(camera: Camera, factor: int) -> Camera:
    """Return the camera whose pixels are every `factor`th of every `factor`th row: their centres see the same rays.

    So a body drawn by it is the same body drawn at full size and looked at there, pixel for pixel. The first one is
    number `factor // 2`. Raises InputError where that is no pixel.
    """
    first = _first(factor, (camera.width, camera.height))
    width, height = (
        len(range(first, side, factor)) for side in (camera.width, camera.height)
    )
    centre = (camera.centre - first - 0.5) / factor + 0.5
    return replace(
        camera, width=width, height=height, focal=camera.focal / factor, centre=centre
    )


def coarser_silhouette(silhouette: Silhouette, factor: int) -> Silhouette:
    """Return what `coarser_camera` saw of a silhouette, with the borders of the full-size one.

    Areas times the square of `factor` are estimates of the full ones, and a pose that fits perfectly costs 0. The
    majority of each block, the other way to make a mask smaller, is no picture that such a camera takes of a body.
    """
    first = _first(factor, silhouette.size)
    mask, valid = (
        pixels[first::factor, first::factor]
        for pixels in (silhouette.mask, silhouette.valid)
    )
    # the full-size borders, so that poses aligned to them stand where they stand at full size
    extent = tuple((np.array(silhouette.extent) - first - 0.5) / factor + 0.5)
    scale = silhouette.scale * factor
    device = silhouette.device
    return replace(
        Silhouette.of(mask, valid), scale=scale, device=device, full_extent=extent
    )


def _first(factor: int, size: tuple[int, int]) -> int:
    if (
        isinstance(factor, bool)
        or not isinstance(factor, int | np.integer)
        or not 1 <= factor <= min(size)
    ):
        raise InputError(
            f"factor must be a whole number from 1 to the smaller side {min(size)}, got {quoted(factor)}"
        )
    return int(factor) // 2
