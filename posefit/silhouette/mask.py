"""Masks and silhouettes, as bit images and at smaller sizes."""

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
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

# Share of the largest piece's pixels: the person's extent leaves out smaller pieces.
# The value is ours.
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
    """Return left, top, right and bottom of a mask that is not empty.

    Right and bottom are the first column and row outside.
    """
    rows = np.flatnonzero(mask.any(axis=1))
    columns = np.flatnonzero(mask.any(axis=0))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def touches_border(mask: Mask) -> bool:
    """Return whether a mask touches the image's border."""
    return bool(mask[[0, -1]].any() or mask[:, [0, -1]].any())


def padded_box(mask: Mask, margin: int) -> tuple[slice, slice]:
    """Return the rows and columns of a mask's box with a margin in pixels.

    For an empty mask it is the first pixel's box.
    """
    left, top, wide, tall = cv2.boundingRect(mask.astype(np.uint8))
    if not wide:
        return slice(1), slice(1)
    rows = slice(max(top - margin, 0), top + tall + margin)
    columns = slice(max(left - margin, 0), left + wide + margin)
    return rows, columns


def without_small_pieces(mask: Mask) -> Mask:
    """Return a mask without its small pieces, which are not part of the person."""
    box = padded_box(mask, 0)  # faster than the whole mask
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
    """The person's pixels in one camera's image, and which pixels are known.

    `Silhouette.of` makes one from a mask.

    Attributes:
        mask: The person's pixels (height, width). Unknown pixels are False.
        valid: The known pixels (height, width).
        scale: The silhouette has every `scale`th pixel of every `scale`th row of the
            full-size one.
        device: The device that draws poses and counts their pixels; None for the CPU.
        full_extent: The extent at full size, in pixels of this silhouette; () if this
            is the full size.

    Example:
        >>> import numpy as np
        >>> from posefit import Silhouette
        >>> silhouette = Silhouette.of(np.eye(8, dtype=bool))
        >>> silhouette.mask.shape, silhouette.known
        ((8, 8), True)
    """

    mask: Mask = field(repr=False)  # (height, width)
    valid: Mask = field(repr=False)  # (height, width)
    scale: int = 1
    device: "Device | None" = None
    full_extent: tuple[float, ...] = field(default=(), repr=False)

    @classmethod
    def of(
        cls, mask: NDArray[np.generic], valid: NDArray[np.generic] | None = None
    ) -> "Silhouette":
        """Return the silhouette of a mask.

        Args:
            mask: (height, width); any value but 0 is the person.
            valid: (height, width); pixels where it is 0 are unknown and not counted.
                None if all pixels are known.

        Returns:
            The silhouette. Its arrays are read-only, so that a method cannot change
            the data by which it is judged.

        Raises:
            InputError: The mask is not (height, width), or the shapes differ.
        """
        values = np.asarray(mask)
        if values.ndim != 2 or 0 in values.shape:
            raise InputError(
                f"mask must have shape (height, width), got {values.shape}"
            )
        if valid is None:
            known = _all_known(values.shape)
        else:
            known = np.array(valid, dtype=bool)
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
        """The number of the person's pixels."""
        return int(np.count_nonzero(self.mask))

    @cached_property
    def known(self) -> bool:
        """Whether any pixel is known."""
        return bool(self.valid.any())

    @cached_property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, top, right and bottom border of the person in pixels.

        A border at the image's edge is NaN, and so are all borders of an empty mask.
        Small separate pieces are left out: a stray pixel would move the centre by half
        its distance.
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


@lru_cache(maxsize=4)
def _all_known(shape: tuple[int, ...]) -> Mask:
    """Return the pixels of an image that are all known.

    The silhouettes of a film share them, which is half of the memory of its masks.
    """
    return np.ones(shape, dtype=bool)


class Device(Protocol):
    """Draws poses and counts their areas on other hardware than the CPU.

    Example:
        >>> from dataclasses import replace
        >>> from posefit.plugin import areas
        >>> from posefit.testing.tracker_rules import scene
        >>> class Twin:
        ...     def areas(self, body, camera, silhouette, poses, translations):
        ...         here = replace(silhouette, device=None)  # the CPU counts
        ...         return areas(body, camera, here, poses, translations)
        >>> task, walk, observations = scene()
        >>> silhouette = observations[0].silhouettes[0]
        >>> scenery = (task.body, task.cameras[0], silhouette)
        >>> Twin().areas(*scenery, walk.poses[:1], walk.translations[:1]).shape
        (1, 3)
    """

    def areas(
        self,
        body: Body,
        camera: Camera,
        silhouette: Silhouette,
        poses: Array,
        translations: Array,
    ) -> Areas:
        """Return the areas of poses.

        Args:
            body: The body.
            camera: The camera.
            silhouette: The silhouette in the camera's image.
            poses: (n, 66); the caller has checked the shape.
            translations: (n, 3) metres; the caller has checked the shape.

        Returns:
            R, B, Y (n, 3) in pixels, equal to the result of
            `posefit.silhouette.cost.areas` on a CPU.
        """


def coarser_camera(camera: Camera, factor: int) -> Camera:
    """Return the camera that has every `factor`th pixel of every `factor`th row.

    The pixels' centres see the same rays. So each pixel of a body drawn by it equals
    the pixel at the same place of the body drawn at full size. The first pixel and row
    are number `factor // 2`. Raises InputError if the image has no such pixel.
    """
    first = _first(factor, (camera.width, camera.height))
    width = len(range(first, camera.width, factor))
    height = len(range(first, camera.height, factor))
    centre = (camera.centre - first - 0.5) / factor + 0.5
    return replace(
        camera, width=width, height=height, focal=camera.focal / factor, centre=centre
    )


def coarser_silhouette(silhouette: Silhouette, factor: int) -> Silhouette:
    """Return a silhouette as `coarser_camera` sees it, with the full-size extent.

    Areas times the square of `factor` are estimates of the full-size areas, and a pose
    that fits perfectly costs 0. This would not hold if each pixel were the majority of
    a block, since no camera takes such an image of a body.
    """
    first = _first(factor, silhouette.size)
    mask = silhouette.mask[first::factor, first::factor]
    valid = silhouette.valid[first::factor, first::factor]
    # the full-size extent, so that poses are aligned as at full size
    extent = tuple((np.array(silhouette.extent) - first - 0.5) / factor + 0.5)
    scale = silhouette.scale * factor
    device = silhouette.device
    return replace(
        Silhouette.of(mask, valid), scale=scale, device=device, full_extent=extent
    )


def _first(factor: int, size: tuple[int, int]) -> int:
    """Return the number of the first pixel that is kept."""
    whole = isinstance(factor, int | np.integer) and not isinstance(factor, bool)
    if not whole or not 1 <= factor <= min(size):
        raise InputError(
            f"factor must be a whole number from 1 to the smaller side {min(size)}, "
            f"got {quoted(factor)}"
        )
    return int(factor) // 2
