"""Segmenters are registered like all plugins, and the kit separates right ones from wrong ones."""

from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

from posefit.registry import registry
from posefit.silhouette.foreground import Footage, Mixture
from posefit.testing import check_segmenter

BUILT_IN = ("masks", "mean", "median", "mixture")


def test_the_kit_passes_the_built_in_ones() -> None:
    offers = registry().offers["segmenter"]
    for name in BUILT_IN:
        assert offers[name].distribution == "posefit"
        settings = {"background": "0:6"} if name == "mean" else {}
        report = check_segmenter(registry().offer("segmenter", name).factory, settings=settings)
        assert report, str(report)
        assert len(report.of("passed")) >= 7


@pytest.mark.skipif(find_spec("mediapipe") is None, reason="without mediapipe")
def test_the_kit_passes_mediapipe() -> None:
    result = check_segmenter(registry().offer("segmenter", "mediapipe").factory)
    assert result, str(result)


class Sound(Mixture):
    """Nothing is wrong with it, and the others each spoil one thing."""

    def __init__(self, footage: Footage) -> None:
        super().__init__(footage.frames())


class OneMask(Sound):
    def segment(self, image: Any) -> Any:
        return super().segment(image)[0]


class SoftMasks(Sound):
    def segment(self, image: Any) -> Any:
        person, shadow = super().segment(image)
        return person.astype(np.float32), shadow


class Smaller(Sound):
    def segment(self, image: Any) -> Any:
        person, shadow = super().segment(image)
        return person[::2], shadow[::2]


class Blind(Sound):
    def segment(self, image: Any) -> Any:
        return np.zeros(image.shape[:2], dtype=bool), np.zeros(image.shape[:2], dtype=bool)


class Draws(Sound):
    def segment(self, image: Any) -> Any:
        person, shadow = super().segment(image)
        return person & (np.random.random(person.shape) < 0.95), shadow  # noqa: NPY002


class Paints(Sound):
    def segment(self, image: Any) -> Any:
        masks = super().segment(image)
        image[masks[0]] = 0
        return masks


class WrongBackground(Sound):
    background = np.zeros((3, 3), dtype=np.uint8)  # type: ignore[assignment]


class Swallows(Sound):
    def __init__(self, footage: Footage, **settings: Any) -> None:
        super().__init__(footage)


class TakesNonsense(Sound):
    def __init__(self, footage: Footage, *, levels: int = 3) -> None:
        super().__init__(footage)


def test_the_kit_fails_what_was_planted() -> None:
    planted: dict[Any, set[str]] = {
        Sound: set(),
        OneMask: {"masks", "overlap"},
        SoftMasks: {"masks"},
        Smaller: {"masks"},
        Blind: {"overlap"},
        Draws: {"same_again", "global_randomness"},
        Paints: {"inputs"},
        WrongBackground: {"background"},
        Swallows: {"construction"},
        TakesNonsense: {"nonsense_settings"},
    }
    for factory, broken in planted.items():
        failed = {result.name for result in check_segmenter(factory).of("failed")}
        assert broken <= failed, factory
        assert failed <= broken | ({"overlap"} if factory in (SoftMasks, Smaller) else set()), factory
