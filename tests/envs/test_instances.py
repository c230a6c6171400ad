"""A number means the same motion, speed, phase and view in an environment as in a sweep."""

import numpy as np
import pytest

from posefit.geometry.camera import Camera
from posefit.silhouette.corruption import CORRUPTIONS
from posefit.sweep.cell import cell_scene
from posefit.sweep.plan import Plan
from posefit_envs.instance import SPLITS, first_episode, instance, world_of
from tests.cases import each


def azimuth(camera: Camera) -> float:
    """Return from where around the person a camera looks, in radians."""
    towards = -camera.rotation[2]
    return float(np.arctan2(towards[0], towards[2]))


def both(motion: str, number: int, frames: int, **arguments):
    """Return the scene of a cell, and an environment's instance of the same number."""
    spec = {"method": "random@pca", "motion": motion, "instance": number, "frames": frames, "view_degrees": [45, 90]}
    (cell,) = Plan.of({"cells": [spec]})
    world = world_of(motion=motion, view_degrees=(45.0, 90.0), **arguments)
    return cell_scene(cell), instance(world, number, frames, 10)


@each("number", [0, 17, 10_017])
def test_a_built_in_motion_and_its_views_are_the_same(number):
    cell, made = both("walk", number, 6)
    assert cell.truth is not None
    assert made.truth.poses.tobytes() == cell.truth.poses.tobytes()
    assert made.truth.translations.tobytes() == cell.truth.translations.tobytes()
    for camera, expected in zip(made.task.cameras, cell.cameras, strict=True):
        assert azimuth(camera) == pytest.approx(azimuth(expected), abs=1e-9)


def test_what_is_drawn_besides_changes_neither_the_motion_nor_the_cameras():
    _, plain = both("walk", 17, 3)
    _, noisy = both("walk", 17, 3, noise={"holes": 0.5}, mismatch_percent=10.0, translation="searched")
    assert noisy.truth.poses.tobytes() == plain.truth.poses.tobytes()
    for camera, expected in zip(noisy.task.cameras, plain.task.cameras, strict=True):
        assert camera.rotation.tobytes() == expected.rotation.tobytes()
    masks = [made.observations[0].silhouettes[0].mask for made in (plain, noisy)]
    assert not np.array_equal(*masks)


def test_the_test_split_is_held_out_by_number():
    for split, (first, last) in SPLITS.items():
        world, rng = world_of(split=split), np.random.default_rng(0)
        numbers = {world.next_instance(rng) for _ in range(20)}
        assert len(numbers) > 15
        assert all(first <= number < last for number in numbers)
    assert SPLITS["train"] == (0, SPLITS["test"][0])


@each("name", CORRUPTIONS)
def test_each_corruption_changes_the_silhouette_more_the_stronger_it_is(name):
    def masks(noise):
        world = world_of(noise=noise, size=(160, 120))
        return np.stack([first_episode(world, number, 10).problem.silhouettes[0].mask for number in range(12)])

    clean = masks(None)
    changed = [(masks({name: strength}) != clean).mean() for strength in (0.1, 0.4, 1.0)]
    assert 0.0 <= changed[0] < changed[1] < changed[2] < 0.5
    assert (masks({name: 0.0}) == clean).all()
