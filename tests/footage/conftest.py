"""A synthetic video of a walk, whose masks are known."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

import posefit
from posefit.footage import edge, extraction
from posefit.footage import segmenter as segmenters
from posefit.footage.kinds import resolve
from posefit.footage.source import views_of_masks
from posefit.footage.views import Range, View
from posefit.geometry.skeleton import JOINTS
from posefit.motion import built_in
from posefit.registry import Offer
from posefit.silhouette.cost import project

Film = tuple[Path, list[Any]]  # a video and the true mask of each frame
SIZE = (160, 120)
NOBODY = np.zeros((SIZE[1], SIZE[0]), dtype=bool)
ALL = (None, None)  # frames
# frames without a person, then frames of a walk across
EMPTY = 12
FRAMES = 48


def iou(first: Any, second: Any) -> float:
    """Return the overlap of two masks."""
    return float((first & second).sum() / max(1, (first | second).sum()))


def walk() -> posefit.Motion:
    """Return a walk of 2.2 m along +z."""
    motion = built_in.motion("walk", frames=FRAMES)
    places = motion.translations.copy()
    places[:, 2] = np.linspace(-1.1, 1.1, FRAMES)
    return replace(motion, translations=places)


def camera(azimuth: float) -> posefit.Camera:
    """Return the camera of a video."""
    return posefit.Camera.around(np.array([0.0, 0.9, 0.0]), azimuth, 4.0, SIZE)


def truth(azimuth: float = np.pi / 2) -> list[Any]:
    """Return the masks of a walk across, viewed by a camera at an azimuth."""
    motion = walk()
    body = posefit.Body.of(motion.skeleton)
    placed = zip(motion.poses, motion.translations, strict=True)
    return [project(body, camera(azimuth), pose, place) for pose, place in placed]


def encoded(path: Path, images: Iterable[Any], codec: str = "MJPG") -> Path:
    """Write a video of images."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 25.0, SIZE)
    for image in images:
        writer.write(image)
    writer.release()
    return path


def film(path: Path, masks: list[Any], others: Iterable[Any] = ()) -> Path:
    """Write a video of a person, and of another in other clothes, before a still, noisy background."""
    rng = np.random.default_rng(0)
    background = cv2.GaussianBlur(
        rng.uniform(90.0, 250.0, (SIZE[1], SIZE[0], 3)), (0, 0), 4.0
    )
    background = (background - background.mean()) * 4.0 + 150.0
    images = []
    for mask, other in zip_longest(masks, others, fillvalue=NOBODY):
        image = background + rng.normal(0.0, 2.0, background.shape)
        image[mask], image[other] = (40.0, 30.0, 120.0), (20.0, 90.0, 20.0)
        images.append(np.clip(image, 0, 255).astype(np.uint8))
    return encoded(path, images)


def stack(path: Path, masks: Sequence[Any], **more: Any) -> Path:
    """Write masks to an .npz file."""
    np.savez(path, masks=np.stack(masks), **more)
    return path


def read_masks(source: Any, frames: Range = ALL, label: int | None = None) -> View:
    """Return the view of masks as they are read, before they are cleaned."""
    (view,) = views_of_masks(resolve(source), frames, label)
    return view


@pytest.fixture(scope="session", name="walk")
def six_masks() -> list[Any]:
    """Six masks of a person who walks."""
    return truth()[10:16]


@pytest.fixture(scope="session")
def filmed(tmp_path_factory: pytest.TempPathFactory) -> Film:
    masks = [NOBODY] * EMPTY + truth()
    return film(tmp_path_factory.mktemp("video") / "walk.avi", masks), masks


class Box:
    """Reports a box on the left as the person; from its second picture on, their facing and a landmark, too."""

    def __init__(self, footage: Any, *, wrong: str = "") -> None:
        self.footage = footage
        self.wrong = wrong
        self.facing = np.nan
        self.landmarks = None
        self.count, self.first, self.pictures = (
            len(footage),
            next(iter(footage.frames())),
            0,
        )

    def segment(self, image: Any) -> Any:
        if self.wrong == "fails":
            raise KeyError("lost")
        if self.pictures:
            self.facing, self.landmarks = (
                0.5,
                np.zeros((len(JOINTS), 2 if self.wrong == "landmarks" else 3)),
            )
            self.landmarks[0] = [5.0, 7.0, 0.5][: self.landmarks.shape[1]]
        self.pictures += 1
        mask = np.zeros(image.shape[:2], dtype=bool)
        mask[20:90, 5 : 5 + image.shape[1] // 6] = True
        if self.wrong == "shape":
            return mask[1:], mask
        return (
            (mask.astype(np.uint8), mask)
            if self.wrong == "type"
            else (mask, np.zeros_like(mask))
        )


@pytest.fixture
def segmenter(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return how a segmenter is registered."""
    registry = extraction.registry()

    def register(name: str, factory: Any, **more: Any) -> None:
        offer = Offer("segmenter", name, factory, "its-maker", "1.0", **more)
        changed = SimpleNamespace(
            offers=registry.offers,
            offer=lambda kind, other: (
                offer if other == name else registry.offer(kind, other)
            ),
        )
        for module in (extraction, segmenters, edge):
            monkeypatch.setattr(module, "registry", lambda: changed)

    return register
