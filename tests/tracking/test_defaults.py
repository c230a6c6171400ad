"""The method of a source and what it learns from, by default."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import posefit
from posefit.footage.source import scene_of
from posefit.motion import recorded
from posefit.progress import Progress
from posefit.registry import registry
from posefit.tracking import method
from posefit.tracking.method import resolved
from posefit.tracking.options import TrackOptions

WALKS = ("walk-a", "walk-b", "walk-c")


def test_the_method_and_the_training_motions_depend_on_the_source() -> None:
    for source, given, expected, train in (
        ("walk", {}, "annealed@pca", WALKS),
        ("run-a", {}, "annealed@pca", ("run-b",)),
        ("16_15", {}, "exemplars", ["library"]),
        ("16_15.amc", {"method": "exemplars"}, "exemplars", ["library"]),
        ("16_15", {"method": "sapso"}, "sapso@pca", WALKS),
        ("a.mp4", {}, "exemplars", ["library"]),
        ("a.npz", {}, "exemplars", ["library"]),
        ("masks/", {"method": "exemplars"}, "exemplars", ["library"]),
        ("a.npz", {"train": ["library:-16"]}, "exemplars", ["library:-16"]),
        ("a.npz", {"method": "annealed"}, "annealed@loose", WALKS),
        ("a.npz", {"method": "@pca"}, "annealed@pca", WALKS),
        ("a.npz", {"settings": {"sapso.cooling": 0.9}}, "sapso@loose", WALKS),
        ("a.npz", {"settings": {"tracker.floor": 0.1}}, "annealed@loose", WALKS),
        ("a.npz", {"settings": {"exemplars.lag": 0}}, "exemplars", ["library"]),
        ("a.npz", {"method": "vsmm"}, "vsmm", WALKS),
    ):
        options = resolved(source, TrackOptions(**given))
        assert (options.method, options.train) == (expected, train), (source, given)
        again = resolved(source, TrackOptions(**{**given, "method": options.method}))
        assert (again.method, again.train) == (expected, train), (source, given)


def test_footage_is_searched_where_the_tracker_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    without = replace(registry(), plugins=tuple(plugin for plugin in registry().plugins if plugin.name != "exemplars"))
    monkeypatch.setattr(method, "registry", lambda: without)
    options = resolved("a.npz", TrackOptions())
    assert (options.method, options.train) == ("annealed@loose", WALKS)


def test_masks_are_followed_through_the_library_once_and_a_build_is_fitted(tmp_path: Path) -> None:
    scene, log = scene_of(["09_01"], frames=(0, 8), size=(120, 90)), list[str]()
    masks = [observation.silhouettes[0].mask for observation in scene.observations]
    np.savez(tmp_path / "masks.npz", masks=masks)
    track = posefit.track(tmp_path / "masks.npz", evaluations=400, body_frames=5, progress=Progress(log.append))
    assert track.summary["method"] == "exemplars"
    assert track.summary["train"] == [clip.name for clip in recorded.clips()]
    assert track.summary["body"] is not None
    assert not any("looking for the first pose" in line for line in log)
    assert "fitting the person's build to 5 frames" in log
    more = {"train": ["walk-a"], "restarts": 1, "body_frames": 0}
    posefit.track(tmp_path / "masks.npz", evaluations=400, progress=Progress(log.append), **more)
    assert "looking for the first pose, 1 times" in log
