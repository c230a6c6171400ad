"""Segmenters are registered like all plugins, and the kit separates right ones from wrong ones."""

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

from posefit.registry import registry
from posefit.silhouette.foreground import Film, Mixture
from posefit.testing import check_segmenter


def test_the_kit_passes_the_built_in_ones() -> None:
    offers = registry().offers["segmenter"]
    for name in ("masks", "mean", "median", "mixture"):
        assert offers[name].distribution == "posefit"
        report = check_segmenter(
            offers[name].factory,
            settings={"background": "0:6"} if name == "mean" else {},
        )
        assert report, str(report)
        assert len(report.of("passed")) >= 7


@pytest.mark.skipif(find_spec("mediapipe") is None, reason="without mediapipe")
def test_the_kit_passes_mediapipe() -> None:
    result = check_segmenter(registry().offer("segmenter", "mediapipe").factory)
    assert result, str(result)


class Sound(Mixture):
    """Nothing is wrong with it, and the others each spoil one thing."""

    def __init__(self, footage: Film) -> None:
        super().__init__(footage.frames())


def spoiled(change: Callable[[Any, Any, Any], Any]) -> type[Sound]:
    """Return a segmenter whose images and masks (image, person, shadow) are changed."""

    class Spoiled(Sound):
        def segment(self, image: Any) -> Any:
            return change(image, *super().segment(image))

    return Spoiled


def paint(image: Any, person: Any, shadow: Any) -> Any:
    image[person] = 0
    return person, shadow


class WrongBackground(Sound):
    background = np.zeros((3, 3), dtype=np.uint8)


class Swallows(Sound):
    def __init__(self, footage: Film, **settings: Any) -> None:
        super().__init__(footage)


class TakesNonsense(Sound):
    def __init__(self, footage: Film, *, levels: int = 3) -> None:
        super().__init__(footage)


def test_the_kit_fails_planted_faults() -> None:
    for factory, broken in (
        (Sound, set()),
        (spoiled(lambda image, person, shadow: person), {"masks", "overlap"}),
        (
            spoiled(lambda image, person, shadow: (person.astype(np.float32), shadow)),
            {"masks", "overlap"},
        ),
        (
            spoiled(lambda image, person, shadow: (person[::2], shadow[::2])),
            {"masks", "overlap"},
        ),
        (
            spoiled(lambda image, person, shadow: (shadow & ~shadow, shadow)),
            {"overlap"},
        ),
        (
            spoiled(
                lambda image, person, shadow: (
                    person & (np.random.random(person.shape) < 0.95),  # noqa: NPY002
                    shadow,
                )
            ),
            {"same_again", "global_randomness"},
        ),
        (spoiled(paint), {"inputs"}),
        (WrongBackground, {"background"}),
        (Swallows, {"construction"}),
        (TakesNonsense, {"nonsense_settings"}),
    ):
        failed = {result.name for result in check_segmenter(factory).of("failed")}
        assert broken - {"overlap"} <= failed <= broken, factory
        assert failed or not broken
