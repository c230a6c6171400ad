"""A number means the same motion, speed, phase and view in an environment as in a sweep."""

import numpy as np
import pytest

from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.sweep.cell import cell_scene
from posefit.sweep.plan import Plan
from posefit_envs.instance import SPLITS, instance, select
from tests.cases import each


def azimuth(camera: Camera) -> float:
    """Return from where around the person a camera looks, in radians."""
    towards = -camera.rotation[2]
    return float(np.arctan2(towards[0], towards[2]))


def both(motion: str, number: int, frames: int, **arguments):
    """Return the scene of a cell, and an environment's instance of the same number."""
    spec = {"method": "random@pca", "motion": motion, "instance": number, "frames": frames, "view_degrees": [45, 90]}
    (cell,) = Plan.of({"cells": [spec]})
    return cell_scene(cell), instance(
        select(motion=motion, view_degrees=(45.0, 90.0), **arguments).world, number, frames, 10
    )


@each("number", [0, 17, 10_017])
def test_a_built_in_motion_is_the_same_and_is_seen_from_the_same_side(number):
    cell, made = both("walk", number, 6)
    assert cell.truth is not None
    assert made.truth.poses.tobytes() == cell.truth.poses.tobytes()
    assert made.truth.translations.tobytes() == cell.truth.translations.tobytes()
    for one, other in zip(made.task.cameras, cell.cameras, strict=True):
        assert azimuth(one) == pytest.approx(azimuth(other), abs=1e-9)


def test_instance_0_is_the_motion_as_it_is():
    _, made = both("run", 0, 5)
    assert made.truth.poses.tobytes() == built_in.motion("run", frames=5).poses.tobytes()
    assert azimuth(made.task.cameras[1]) - made.truth.poses[0, 0] == pytest.approx(np.pi / 2.0)


def test_what_is_drawn_besides_changes_neither_the_motion_nor_the_cameras():
    _, plain = both("walk", 17, 3)
    _, spoilt = both("walk", 17, 3, noise={"holes": 0.5}, mismatch_percent=10.0, translation="searched")
    assert spoilt.truth.poses.tobytes() == plain.truth.poses.tobytes()
    for one, other in zip(spoilt.task.cameras, plain.task.cameras, strict=True):
        assert one.rotation.tobytes() == other.rotation.tobytes()
    masks = [[silhouette.mask for silhouette in made.observations[0].silhouettes] for made in (plain, spoilt)]
    assert not np.array_equal(masks[0][0], masks[1][0])


def test_the_splits_share_no_motion():
    starts = {split: range(*SPLITS[split]) for split in ("train", "test")}
    assert not set(starts["train"]) & set(starts["test"])
    assert 0 in starts["train"]
