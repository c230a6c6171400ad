"""A number means the same in an environment as in a sweep, and many scenes together what the library has of each."""

import importlib
import pkgutil
from typing import Any

import numpy as np
import pytest

import posefit_envs
from posefit import Camera, Problem, project
from posefit.motion.instances import TRAINING
from posefit.silhouette.corruption import CORRUPTIONS
from posefit.sweep.cell import cell_scene
from posefit.sweep.plan import Plan
from posefit_envs.stage import Stage, first_scene
from posefit_envs.world import SPLITS, FirstFrame, instance, world_of
from tests.cases import each


def azimuth(camera: Camera) -> float:
    """Return from where around the person a camera looks, in radians."""
    towards = -camera.rotation[2]
    return float(np.arctan2(towards[0], towards[2]))


def both(motion: str, number: int, frames: int, **arguments):
    """Return the scene of a cell, and an environment's instance of the same number."""
    spec = {
        "method": "random@pca",
        "motion": motion,
        "instance": number,
        "frames": frames,
        "view_degrees": [45, 90],
    }
    (cell,) = Plan.of({"cells": [spec]})
    arguments |= {"view_degrees": (45.0, 90.0), "held_out_people": False}
    world = world_of(motion=motion, **arguments)
    return cell_scene(cell), instance(world, number, frames, 10)


def test_what_is_kept_of_instances_is_limited():
    """Memory grows until each training instance was met, and not further."""
    for module in pkgutil.iter_modules(posefit_envs.__path__, "posefit_envs."):
        for value in vars(importlib.import_module(module.name)).values():
            if hasattr(value, "cache_parameters"):
                assert 0 < value.cache_parameters()["maxsize"] <= len(TRAINING), value
    scene = first_scene(world_of(), 17)
    assert sum(column.nbytes for column in scene) < 5000


@each("number", [0, 17, 10_017])
def test_a_built_in_motion_and_its_views_are_the_same(number):
    cell, made = both("walk", number, 6)
    assert made.truth.poses.tobytes() == cell.truth.poses.tobytes()
    assert made.truth.translations.tobytes() == cell.truth.translations.tobytes()
    for camera, expected in zip(made.task.cameras, cell.cameras, strict=True):
        assert azimuth(camera) == pytest.approx(azimuth(expected), abs=1e-9)


def test_other_random_draws_change_neither_the_motion_nor_the_cameras():
    _, plain = both("walk", 17, 3)
    _, noisy = both(
        "walk",
        17,
        3,
        noise={"holes": 0.5},
        mismatch_percent=10.0,
        translation="searched",
    )
    assert noisy.truth.poses.tobytes() == plain.truth.poses.tobytes()
    for camera, expected in zip(noisy.task.cameras, plain.task.cameras, strict=True):
        assert camera.rotation.tobytes() == expected.rotation.tobytes()
    masks = [made.observations[0].silhouettes[0].mask for made in (plain, noisy)]
    assert not np.array_equal(*masks)


def test_the_test_split_is_held_out_by_number():
    for split, numbers_of in SPLITS.items():
        world = world_of(split=split)
        rng = np.random.default_rng(0)
        numbers = {world.next_instance(rng) for _ in range(20)}
        assert len(numbers) > 15
        assert all(number in numbers_of for number in numbers)
    assert SPLITS["train"][-1] + 1 == SPLITS["test"][0]


@each("name", CORRUPTIONS)
def test_each_corruption_changes_the_silhouette_more_the_stronger_it_is(name):
    def masks(noise):
        world = world_of(noise=noise, size=(160, 120))
        return np.stack(
            [FirstFrame(world, number).silhouettes[0].mask for number in range(12)]
        )

    clean = masks(None)
    changed = [
        (masks({name: strength}) != clean).mean() for strength in (0.1, 0.4, 1.0)
    ]
    assert 0.0 <= changed[0] < changed[1] < changed[2] < 0.5
    assert (masks({name: 0.0}) == clean).all()


WORLDS: list[dict[str, Any]] = [
    {},
    {
        "view_degrees": (0.0, 90.0),
        "translation": "searched",
        "mismatch_percent": 10.0,
        "size": (130, 70),
    },
    {
        "prior": "full",
        "translation": "aligned",
        "mismatch_percent": 20.0,
        "noise": {"holes": 0.5},
    },
]


def staged(
    numbers: tuple[int, ...], **arguments: Any
) -> tuple[Stage, list[FirstFrame]]:
    world = world_of(**arguments)
    stage = Stage(world, len(numbers))
    for row, number in enumerate(numbers):
        stage.set_scene(row, first_scene(world, number))
    return stage, [FirstFrame(world, number) for number in numbers]


@each("arguments", WORLDS)
def test_scenes_in_one_call_equal_the_library_scene_by_scene(
    arguments: dict[str, Any],
) -> None:
    stage, frames = staged((3, 17, 17, 9_000), **arguments)
    rng = np.random.default_rng(0)
    proposals = rng.uniform(-1.0, 1.0, (len(frames), 5, frames[0].space.dimensions))
    costs = stage.costs(proposals, stage.all_rows)
    evaluation = stage.draw(proposals[:, 0], stage.all_rows)
    for row, frame in enumerate(frames):
        problem = Problem(frame, frame.space)
        np.testing.assert_array_equal(costs[row], problem(proposals[row]))
        poses, places = problem.decode(proposals[row, :1])
        np.testing.assert_array_equal(evaluation.poses[row], poses[0])
        np.testing.assert_array_equal(evaluation.translations[row], places[0])
        assert evaluation.costs[row] == costs[row, 0]
        for view, camera in enumerate(problem.cameras):
            body = project(problem.body, camera, poses[0], places[0])
            mask = problem.silhouettes[view].mask
            np.testing.assert_array_equal(
                evaluation.pictures[row, ..., 2 * view + 1], 255 * body
            )
            np.testing.assert_array_equal(
                evaluation.pictures[row, ..., 2 * view], 255 * mask
            )
            areas = [(mask & ~body).sum(), (body & ~mask).sum(), (body & mask).sum()]
            np.testing.assert_array_equal(evaluation.areas[row, view], areas)


@pytest.mark.pure
def test_rows_that_are_left_out_show_nothing_proposed() -> None:
    stage, frames = staged((3, 17))
    for rows in (np.array([1]), np.array([], dtype=np.int64)):
        evaluation = stage.draw(np.zeros((2, 9)), rows)
        mask = frames[0].silhouettes[0].mask
        np.testing.assert_array_equal(
            evaluation.pictures[0], np.stack([255 * mask, 0 * mask], axis=-1)
        )
        assert not evaluation.areas[0].any()
        assert evaluation.areas[1].any() == bool(len(rows))


def test_motions_take_turns_and_so_do_the_people_of_each():
    world = world_of(motion=["walk", "run"])
    assert [world.motion_of(number) for number in range(4)] == [
        "walk-b",
        "run-b",
        "walk-c",
        "run-b",
    ]
    known = world_of(motion="all", held_out_people=False)
    kinds = known.motion
    assert {"walk", "walk-a"} & set(kinds) == {"walk"}
    assert [known.motion_of(number) for number in range(len(kinds))] == list(kinds)


def test_the_truth_is_the_proposal_that_decodes_to_the_true_pose():
    for arguments in ({}, {"yaw": "unknown", "translation": "searched"}):
        frame = FirstFrame(world_of(prior="full", **arguments), 17)
        poses, places = frame.decode(frame.truth[None])
        truth = frame.instance.truth
        np.testing.assert_allclose(np.cos(poses[0] - truth.poses[0]), 1.0, atol=1e-6)
        np.testing.assert_allclose(places[0], truth.translations[0], atol=1e-9)


def test_an_unknown_yaw_is_anywhere_about_the_camera_and_a_searched_place_is_not_the_boxs_middle():
    plain = world_of()
    unknown = world_of(yaw="unknown", translation="searched")
    turns = []
    places = []
    for number in range(40):
        frame = FirstFrame(unknown, number)
        from_camera = frame.space.root_centre[0] - azimuth(frame.cameras[0])
        assert np.cos(from_camera) == pytest.approx(1.0, abs=1e-9)
        assert (
            frame.instance.truth.poses.tobytes()
            == FirstFrame(plain, number).instance.truth.poses.tobytes()
        )
        turns.append(frame.truth[0])
        places.append(frame.truth[3:6])
    assert min(turns) < -0.7 < 0.7 < max(turns)
    # half a metre is 1, and guesses are up to a quarter of it off
    assert 0.1 < np.abs(places).mean() < 0.4
