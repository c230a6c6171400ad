"""Rules of a segmenter: two masks of the image's size, repetition, a visible person."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import cv2
import numpy as np

from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS
from posefit.motion import built_in
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image, Segmenter
from posefit.silhouette.mask import Mask
from posefit.testing import common
from posefit.testing.common import PluginCase, check_speed, unchanged
from posefit.testing.results import SkippedError, expect

SIZE = (320, 240)
# the film shows an empty scene first, then a person who walks through it
EMPTY = 8
FRAMES = 40
# IoU of mask and person: half of a poor background model's
OVERLAP = 0.3
MAX_SECONDS = 1.0  # for a picture of SIZE
# blue, green, red
SKIN = (150.0, 175.0, 225.0)
SHIRT = (235.0, 235.0, 235.0)
TROUSERS = (200.0, 150.0, 130.0)


@dataclass(frozen=True)
class PaintedFilm:
    """A film in memory: a person in light clothes walks past a dark wall."""

    images: list[Image] = field(repr=False)

    def __len__(self) -> int:
        return len(self.images)

    def frames(
        self, start: int = 0, stop: int | None = None, step: int = 1
    ) -> Iterator[Image]:
        """Yield every `step`th frame of start to stop."""
        return (image.copy() for image in self.images[start:stop:step])

    def picture(self, _path: str) -> Image:
        """Return the first frame, which shows nobody, for any path."""
        return self.images[0].copy()


@lru_cache(maxsize=1)
def painted() -> tuple[PaintedFilm, list[Mask]]:
    """Return a film and the true mask of each of its frames."""
    rng = np.random.default_rng(0)
    motion = built_in.motion("walk", frames=FRAMES)
    places = motion.translations.copy()
    places[:, 2] = np.linspace(-1.2, 1.2, FRAMES)
    motion = replace(motion, translations=places)
    camera = Camera.around(np.array([0.0, 0.9, 0.0]), np.pi / 2, 4.0, SIZE)
    body = Body.of(motion.skeleton)
    # an even wall would be too easy: real backgrounds differ from place to place
    wall = cv2.GaussianBlur(rng.uniform(0.0, 1.0, SIZE[::-1]), (0, 0), 30.0)
    wall = 60.0 + 15.0 * (wall - wall.mean())[..., None] / wall.std()
    empty = np.zeros((SIZE[1], SIZE[0]), dtype=bool)
    masks = [empty] * EMPTY
    for pose, place in zip(motion.poses, motion.translations, strict=True):
        masks.append(project(body, camera, pose, place))
    images = []
    for mask in masks:
        rows = np.flatnonzero(mask.any(axis=1))
        below = np.arange(SIZE[1]) - rows.min(initial=SIZE[1])  # rows below the head
        height = max(1, len(rows))
        down = (below / height)[:, None, None]  # 0 at the head, 1 at the feet
        colour = np.where(down < 0.14, SKIN, np.where(down < 0.5, SHIRT, TROUSERS))
        depth = cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 3)[..., None]
        # darker towards the outline, as a round body is
        person = colour * (0.7 + 0.3 * np.minimum(1.0, depth / 6.0))
        noise = rng.normal(0.0, 2.0, (*mask.shape, 3))
        image = np.where(mask[..., None], person, wall) + noise
        blurred = cv2.GaussianBlur(image, (0, 0), 0.6)
        images.append(np.clip(blurred, 0.0, 255.0).astype(np.uint8))
    return PaintedFilm(images), masks


class Case(PluginCase):
    """A segmenter's factory with its settings."""

    arguments = ("film",)

    def build(self, **more: Any) -> Segmenter:
        """Return a segmenter that has looked at the painted film."""
        segmenter: Segmenter = self.factory(painted()[0], **{**self.settings, **more})
        return segmenter

    def use(self, **more: Any) -> None:
        """Segment two frames."""
        segmenter = self.build(**more)
        # frames of the empty scene are enough to show an invalid setting
        for image in painted()[0].frames(stop=EMPTY, step=4):
            segmenter.segment(image)

    def use_fully(self) -> list[tuple[Mask, Mask]]:
        """Return the masks and shadows of every fourth frame, in order."""
        segmenter = self.build()
        pairs = list[tuple[Mask, Mask]]()
        for image in painted()[0].frames(step=4):
            pair = segmenter.segment(image)
            expect(
                isinstance(pair, tuple) and len(pair) == 2,
                f"segment must return two masks, got {type(pair).__name__}",
            )
            pairs.append((np.asarray(pair[0]), np.asarray(pair[1])))
        return pairs

    @cached_property
    def masks(self) -> list[tuple[Mask, Mask]]:
        """What `use_fully` returns. All rules share it."""
        return self.use_fully()


def masks(case: Case) -> None:
    """The method segment returns two boolean masks of the picture's size."""
    for pair in case.masks:
        for mask in pair:
            expect(
                mask.shape == SIZE[::-1],
                f"a mask must have shape {SIZE[::-1]}, got {mask.shape}",
            )
            expect(mask.dtype == np.bool_, f"a mask must be boolean, got {mask.dtype}")


def overlap(case: Case) -> str:
    """The mask shows the person in at least half of the frames."""
    true = painted()[1][::4]
    overlaps = []
    for (estimate, _), mask in zip(case.masks, true, strict=True):
        if mask.any():
            overlaps.append(float((estimate & mask).sum() / (estimate | mask).sum()))
    middle = float(np.median(overlaps))
    expect(
        middle > OVERLAP,
        "the mask must show the person, "
        f"got an overlap of {middle:.2f} in half of the frames",
    )
    return f"overlap {middle:.2f}"


def same_again(case: Case) -> None:
    """The same film gives the same masks."""
    same = np.array_equal(case.masks, case.use_fully())
    expect(same, "two segmenters of one film must give the same masks, but did not")


def inputs(case: Case) -> None:
    """The method segment does not modify the image."""
    image = painted()[0].images[20].copy()
    same = unchanged(image)
    case.build().segment(image)
    expect(same(), "an image must not change, got another")


def background(case: Case) -> str:
    """The background, if the segmenter gives one, is a picture of the film's size."""
    shown = getattr(case.build(), "background", None)
    if shown is None:
        raise SkippedError("it shows no background")
    expect(
        np.shape(shown) == (*SIZE[::-1], 3),
        f"background must have shape {*SIZE[::-1], 3}, got {np.shape(shown)}",
    )
    expect(shown.dtype == np.uint8, f"background must be uint8, got {shown.dtype}")
    return ""


def landmarks(case: Case) -> str:
    """Each joint's landmark is a column, a row and a confidence of 0 or more."""
    segmenter = case.build()
    segmenter.segment(painted()[0].images[20].copy())
    given = getattr(segmenter, "landmarks", None)
    if given is None:
        raise SkippedError("it gives no landmarks")
    shape = len(JOINTS), 3
    expect(
        np.shape(given) == shape,
        f"landmarks must have shape {shape}, got {np.shape(given)}",
    )
    fine = np.isfinite(given).all() and np.min(np.asarray(given)[:, 2]) >= 0.0
    expect(fine, "landmarks must be finite, with confidences of 0 or more")
    return ""


def speed(case: Case) -> str:
    """A picture of 320 x 240 takes less than a second."""
    segmenter = case.build()
    images = painted()[0].images[16:20]

    def segment_all(_: int) -> int:
        for image in images:
            segmenter.segment(image)
        return len(images)

    return check_speed("a picture", MAX_SECONDS, segment_all)


RULES = [
    common.construction,
    masks,
    overlap,
    same_again,
    inputs,
    background,
    landmarks,
    common.global_randomness,
    common.silence,
    common.nonsense_settings,
    speed,
]
