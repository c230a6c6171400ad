"""From video frames to masks of people: background models, cleaning, hole filling.

Frames and backgrounds are (height, width, 3) uint8. Frames are not kept, so a video may
have any length.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.errors import InputError
from posefit.silhouette.mask import Mask, padded_box, touches_border
from posefit.silhouette.pieces import people_in

Image = NDArray[np.uint8]  # (height, width, 3)

SPREADS = 4.0  # a pixel is foreground this many standard deviations from the background
MIN_DIFFERENCE_LEVELS = 18.0  # and differs by at least this many grey levels
SHADE = (0.45, 0.95)  # a shadow keeps this share of the background's brightness
TINT = 14.0  # a shadow keeps its colour, after scaling, to within this many levels
NOISE = 3  # pixels: the side of the square whose majority decides about a pixel
SPECK = 0.004  # share of the image's height: an opening removes smaller specks
GAP = 0.012  # share of the image's height: a closing joins smaller gaps
# share of the person's height: shadow in smaller gaps between parts of the person is
# clothing
BRIDGE = 0.15
BRIGHT = 127  # brighter pixels of a mask belong to the person
MAX_HOLE_AREA = 0.02  # share of the person's area: smaller holes are filled
SAMPLES = 40  # frames of a median, spread over a film
HISTORY = 500  # frames that a mixture remembers
# squared standard deviations: a pixel farther from its nearest Gaussian is foreground
THRESHOLD = 25.0


class Film(Protocol):
    """A video at its working size, cut to the roi, for a segmenter to learn from.

    Example:
        >>> import numpy as np
        >>> from posefit.testing.segmenter_rules import painted
        >>> film, _ = painted()
        >>> np.median(list(film.frames(step=10)), axis=0).shape
        (240, 320, 3)
    """

    def __len__(self) -> int:
        """The number of frames."""
        ...

    def frames(
        self, start: int = 0, stop: int | None = None, step: int = 1
    ) -> Iterator[Image]:
        """Yield every `step`th frame from `start` to before `stop`."""
        ...

    def picture(self, path: str) -> Image:
        """Return the picture at a path, with the size and cut of the video.

        Raises InputError if there is no such picture.
        """
        ...


class Segmenter(Protocol):
    """Separates a person from the rest of an image. It gets each frame once, in order.

    A segmenter may have these attributes:

    - `background` (height, width, 3), the still picture that frames are compared with.
      It is then checked for a person who was learned into it.
    - `facing`, the direction in which the person in the latest frame faces: radians, 0
      towards the camera, increasing to the image's right; NaN if there is nobody.
    - `landmarks` (27, 3), the column, row and confidence of the person's joints in the
      latest frame; the confidence is 0 to 1, and 0 for an unknown joint.

    Example:
        >>> import numpy as np
        >>> class Dark:
        ...     def __init__(self, film, *, limit: int = 60):
        ...         self.limit = limit
        ...
        ...     def segment(self, image):
        ...         person = image.max(axis=2) < self.limit
        ...         return person, np.zeros_like(person)  # no shadow
        >>> person, shadow = Dark(None).segment(np.full((2, 2, 3), 30, np.uint8))
        >>> int(person.sum())
        4
    """

    def segment(self, image: Image) -> tuple[Mask, Mask]:
        """Return the mask of the person in an image, and that of shadow.

        Args:
            image: (height, width, 3) uint8.

        Returns:
            Two masks (height, width): the person, and pixels that may be their shadow.
        """
        ...


# takes a `Film`, and settings as keywords
SegmenterFactory = Callable[..., Segmenter]


@dataclass(frozen=True)
class Still:
    """A still background: one colour and one spread for each pixel.

    VSMM 1.1 and 1.2 use the mean colour.
    """

    middle: NDArray[np.float32] = field(repr=False)  # (height, width, 3)
    spread: NDArray[np.float32] = field(repr=False)  # (height, width)

    @property
    def background(self) -> Image:
        """The picture that frames are compared with."""
        return self.middle.round().astype(np.uint8)

    def segment(self, image: Image) -> tuple[Mask, Mask]:
        """Return where an image differs from the background, and where it is darker."""
        away = cv2.absdiff(image, self.background)
        difference = cv2.max(cv2.max(away[..., 0], away[..., 1]), away[..., 2])
        changed = np.asarray(
            difference > np.maximum(MIN_DIFFERENCE_LEVELS, SPREADS * self.spread)
        )
        # only changed pixels can be shadow
        before = self.middle[changed]
        now = image[changed].astype(np.float32)
        share = (now.mean(axis=1) + 1.0) / (before.mean(axis=1) + 1.0)
        tint = np.abs(now - before * share[:, None]).max(axis=1)
        shadow = np.zeros_like(changed)
        shadow[changed] = (share > SHADE[0]) & (share < SHADE[1]) & (tint < TINT)
        return changed & ~shadow, shadow


def mean_background(images: Iterable[Image]) -> Still:
    """Return the mean of images without a person as the background.

    Raises InputError if there are no images.
    """
    count = 0
    total = np.zeros(())
    squares = np.zeros(())
    for image in images:
        values = image.astype(np.float64)
        count += 1
        total = total + values
        squares = squares + values**2
    if not count:
        raise InputError("background must contain at least one frame, got none")
    middle = total / count
    variance = np.maximum(squares / count - middle**2, 0.0).max(axis=-1)
    return Still(middle.astype(np.float32), np.sqrt(variance).astype(np.float32))


def median_background(images: Iterable[Image]) -> Still:
    """Return the median of images as the background; a person may move in them.

    All images are in memory at once. Raises InputError if there are none.
    """
    stack = images if isinstance(images, np.ndarray) else np.stack(list(images))
    if not len(stack):
        raise InputError("background must contain at least one frame, got none")
    middle = np.median(stack, axis=0).astype(np.float32)
    away = np.median(np.abs(stack.astype(np.float32) - middle), axis=0).max(axis=-1)
    return Still(middle, (1.4826 * away).astype(np.float32))


class Mixture:
    """OpenCV's adaptive mixture of Gaussians, as in the SAPSO paper.

    It learns from all frames before it segments the first one.
    """

    def __init__(
        self,
        images: Iterable[Image],
        history: int = HISTORY,
        threshold: float = THRESHOLD,
    ) -> None:
        self._model: Any = cv2.createBackgroundSubtractorMOG2(history, threshold, True)
        count = 0
        for image in images:
            self._model.apply(image)
            count += 1
        if not count:
            raise InputError("background must contain at least one frame, got none")

    @property
    def background(self) -> Image:
        """The most probable colour of each pixel."""
        return np.asarray(self._model.getBackgroundImage(), dtype=np.uint8)

    def segment(self, image: Image) -> tuple[Mask, Mask]:
        """Return the mixture's foreground and its shadow."""
        label = self._model.apply(image, learningRate=0.0)
        return np.asarray(label == 255), np.asarray(label == 127)


class GivenMasks:
    """A segmenter for frames that are masks: bright pixels are the person."""

    def segment(self, image: Image) -> tuple[Mask, Mask]:
        """Return the bright pixels, and an empty shadow."""
        bright = np.asarray(image.max(axis=2) > BRIGHT)
        return bright, np.zeros_like(bright)


@dataclass(frozen=True)
class Person:
    """A person's mask in one frame, and figures of its quality."""

    mask: Mask = field(repr=False)
    # False for unknown pixels: shadow, and ignored pixels
    valid: Mask = field(repr=False)
    area: int  # pixels
    # pieces of the foreground that are large enough to be part of a person
    pieces: int
    # area of the largest piece outside this person, as a share of the person's area
    rival: float
    touches_border: bool


def people(
    foreground: Mask,
    shadow: Mask,
    roi: tuple[int, int, int, int] | None,
    ignore: Mask | None,
) -> list[Person]:
    """Return the people in a foreground, the largest first.

    Noise and specks are removed, gaps closed, nearby pieces joined and small holes
    filled. Shadow between parts of the person is dark clothing, and so belongs to the
    person; any other shadow is unknown.

    Args:
        foreground: (height, width).
        shadow: (height, width) pixels that may be shadow.
        roi: x, y, width, height; people are only searched for there.
        ignore: (height, width) pixels that count as unknown.

    Returns:
        At least one person, who is empty if nobody is found. The others are at least a
        quarter as large as the first.
    """
    height = foreground.shape[0]
    inside = np.ones(foreground.shape, dtype=bool)
    if roi is not None:
        x, y, wide, tall = roi
        inside[:] = False
        inside[y : y + tall, x : x + wide] = True
    known = ~shadow
    if ignore is not None:
        inside &= ~ignore
        known &= ~ignore
    smooth = cv2.medianBlur(foreground.astype(np.uint8), NOISE)
    changed = np.asarray(smooth > 0) & inside
    largest = people_in(_cleaned(changed, height) & inside)
    if not largest:
        return [Person(np.zeros_like(changed), known, 0, 0, 0.0, False)]
    size = int(np.ptp(np.flatnonzero(largest[0].mask.any(axis=1)))) + 1
    bridged = _morphed(foreground & inside, cv2.MORPH_CLOSE, BRIDGE * size)
    dark = bridged & shadow & inside
    result = list[Person]()
    for part in people_in(_cleaned(changed | dark, height) & inside):
        mask = without_holes(part.mask)
        border = touches_border(mask)
        area = int(mask.sum())
        result.append(Person(mask, known | mask, area, part.pieces, part.rival, border))
    return result


def _cleaned(mask: Mask, height: int) -> Mask:
    """Return a mask without gaps and specks, relative to the image's height."""
    closed = _morphed(mask, cv2.MORPH_CLOSE, GAP * height)
    return _morphed(closed, cv2.MORPH_OPEN, SPECK * height)


def _morphed(mask: Mask, operation: int, size: float) -> Mask:
    """Return a mask after a morphological operation with a disc of `size` pixels."""
    side = 2 * max(1, round(0.5 * size)) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
    box = padded_box(mask, side)
    morphed = np.zeros_like(mask)
    morphed[box] = cv2.morphologyEx(mask[box].astype(np.uint8), operation, kernel) > 0
    return morphed


def without_holes(mask: Mask, most: float = MAX_HOLE_AREA) -> Mask:
    """Return a mask with its holes filled, up to `most` of the mask's area each."""
    box = padded_box(mask, 1)
    filled = mask.copy()
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        (~mask[box]).astype(np.uint8), connectivity=4
    )
    height, width = labels.shape
    lefts, tops, widths, heights, areas = stats[:count].T
    enclosed = (
        (lefts > 0) & (tops > 0) & (lefts + widths < width) & (tops + heights < height)
    )
    fills = enclosed & (areas <= most * mask.sum())
    fills[0] = False  # the person
    filled[box] |= fills[labels]
    return filled
