"""The effort that a track reports is the poses that were drawn for it, whatever the method, the start and the stages."""

from typing import Any

import numpy as np
import pytest

import posefit
from posefit.silhouette.drawn import PoseCount
from posefit.tracking.result import Track
from tests.tracking.scenes import masks_of, walk

SMALL = (120, 90)
# how each case tracks: frames, the views of the masks in degrees, and options
CASES: dict[str, tuple[int, tuple[float, ...], dict[str, Any]]] = {
    "an image, by default": (1, (60.0,), {}),
    "an image by two cameras, by default": (1, (0.0, 90.0), {}),
    "an image, a swarm": (1, (60.0,), {"method": "sapso@pca", "evaluations": 400}),
    "an image, a small budget": (1, (60.0,), {"method": "cma", "evaluations": 80}),
    "an image, particles": (1, (60.0,), {"method": "particle", "evaluations": 300}),
    "an image, any start": (
        1,
        (60.0,),
        {"method": "cma", "evaluations": 200, "settings": ["tracker.start=blind"]},
    ),
    "an image, not polished": (
        1,
        (60.0,),
        {"method": "cma", "evaluations": 200, "smooth": False},
    ),
    "frames, no restart": (
        3,
        (60.0,),
        {"method": "cma", "evaluations": 120, "restarts": 0, "body_frames": 0},
    ),
    "frames, restarts": (
        3,
        (60.0,),
        {"method": "sapso@pca", "evaluations": 120, "restarts": 2, "body_frames": 0},
    ),
    "frames, a build": (
        6,
        (60.0,),
        {"method": "cma", "evaluations": 120, "restarts": 1, "body_frames": 6},
    ),
    "frames by two cameras": (
        3,
        (0.0, 90.0),
        {"method": "cma", "evaluations": 120, "restarts": 1, "body_frames": 0},
    ),
    "frames, exemplars": (
        3,
        (60.0,),
        {"method": "exemplars", "evaluations": 1000, "train": ["walk-b"]},
    ),
    "frames, passes": (
        3,
        (0.0, 90.0),
        {"method": "exemplars", "evaluations": 4880, "train": ["walk-b"]},
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_the_effort_reported_is_what_was_drawn(case: str) -> None:
    frames, views, options = CASES[case]
    scene = walk(frames, views, SMALL)
    masks = [np.stack(masks_of(scene, view)) for view in range(len(views))]
    drawn = PoseCount()
    with drawn.counting():
        track = _track(scene, masks, options)
    assert track.measures.effort is not None
    reported = sum(track.measures.effort.values())
    assert track.measures.evaluations == reported
    # small pictures count by their share of the pixels: each frame and stage is rounded
    rounded = 2 * frames + len(track.measures.effort)
    assert reported == pytest.approx(drawn.poses / len(views), abs=rounded)
    assert not [line for line in track.log.warnings if "evaluations" in line]


def _track(scene: Any, masks: list[Any], options: dict[str, Any]) -> Track:
    if len(masks) > 1:
        cameras = list(scene.cameras)
        return posefit.track(masks, camera=cameras, seed=1, **options)
    return posefit.track(masks[0], seed=1, **options)


def test_a_known_motion_is_drawn_for_its_frames_alone() -> None:
    drawn = PoseCount()
    with drawn.counting():
        track = posefit.track("walk", frames=(0, 3), size=SMALL, evaluations=120)
    assert track.measures.effort == {"frames": int(drawn.poses)}


def test_a_budget_for_one_image_is_kept() -> None:
    masks = masks_of(walk(1, (60.0,), (320, 240)))
    for evaluations in (400, 2440):
        fit = posefit.fit(masks[0], method="sapso@pca", evaluations=evaluations)
        assert fit.track.measures.evaluations <= evaluations
