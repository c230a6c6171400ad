"""Nobody and nothing of the test split is in a training instance, whatever the motion."""

from functools import cache
from itertools import combinations
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import posefit_envs  # noqa: F401, registers them
from posefit.motion import built_in
from posefit_envs.stage import first_scene
from posefit_envs.world import (
    HELD_OUT_PEOPLE,
    SPLITS,
    ArgumentError,
    FirstFrame,
    instance,
    world_of,
)
from tests.cases import each

KINDS = world_of(motion="all").motion
TRAINED = SPLITS["train"][:400]
TESTED = SPLITS["test"][:60]


@cache
def silhouettes(kind: str, split: str) -> Any:
    """Return the packed silhouettes (n, bytes) of instances of a kind of motion."""
    world = world_of(motion=kind)
    numbers = TRAINED if split == "train" else TESTED
    return np.stack([first_scene(world, number).masks.ravel() for number in numbers])


def distances(some: Any, others: Any) -> Any:
    """Return the pixels (n,) in which silhouettes differ from their nearest others."""
    return np.array(
        [np.bitwise_count(one ^ others).sum(axis=1, dtype=int).min() for one in some]
    )


@each("motion", [*KINDS, "all"])
def test_a_test_instance_shows_a_person_of_whom_training_has_nothing(
    motion: str,
) -> None:
    world = world_of(motion=motion)
    people = {
        split: {
            built_in.person_of(world.motion_of(number))
            for number in numbers[: 4 * len(world.motion)]
        }
        for split, numbers in SPLITS.items()
    }
    assert people["test"] <= set(HELD_OUT_PEOPLE)
    assert people["train"].isdisjoint(HELD_OUT_PEOPLE)
    assert {built_in.person_of(style) for style in world.training} == people["train"]


def test_no_body_is_shown_twice() -> None:
    world = world_of()
    bodies = [
        instance(world, number).task.body.radii.tobytes()
        for numbers in (TRAINED, TESTED)
        for number in numbers
    ]
    assert len(set(bodies)) == len(bodies)


def test_no_test_silhouette_occurs_in_any_training() -> None:
    trained = {one.tobytes() for kind in KINDS for one in silhouettes(kind, "train")}
    tested = {one.tobytes() for kind in KINDS for one in silhouettes(kind, "test")}
    assert trained.isdisjoint(tested)


@each("kind", KINDS)
def test_test_silhouettes_are_farther_from_training_than_training_from_itself(
    kind: str,
) -> None:
    trained = silhouettes(kind, "train")
    half = len(trained) // 2
    within = distances(trained[:half], trained[half:])
    away = distances(silhouettes(kind, "test"), trained)
    print(
        f"{kind}: pixels to the nearest training silhouette: test {np.median(away):.0f}"
        f" (least {away.min()}), training {np.median(within):.0f}"
    )
    assert away.min() > 0
    assert np.median(away) > np.median(within)


@each("name", ["FitImage", "Track", "Race"])
def test_version_0_is_the_variant_that_shows_the_same_people(name: str) -> None:
    with pytest.warns(DeprecationWarning, match="out of date"):
        known: Any = gym.make(f"posefit/{name}-v0").unwrapped
    assert known.world == world_of(held_out_people=False)
    held_out: Any = gym.make(f"posefit/{name}-v1").unwrapped
    assert held_out.world == world_of()


def test_with_a_single_person_no_people_are_held_out() -> None:
    for motion in ("walk-a", "walk.bvh", ["walk", "run-a"]):
        with pytest.raises(
            ArgumentError, match="with held-out people, got .*: held_out_people=False"
        ):
            world_of(motion=motion)


def test_people_differ_and_a_number_is_always_the_same_person() -> None:
    world = world_of(view_degrees=(45.0, 135.0), noise={"holes": 0.5})
    plain = world_of()
    for first, second in combinations(range(3), 2):
        one, other = (instance(plain, number).task.body for number in (first, second))
        assert not np.array_equal(one.skeleton.offsets, other.skeleton.offsets)
    for number in (3, 10_003):
        one, other = (FirstFrame(each_world, number) for each_world in (world, plain))
        assert one.body.radii.tobytes() == other.body.radii.tobytes()
        assert (
            one.instance.truth.poses.tobytes() == other.instance.truth.poses.tobytes()
        )


def test_levels_are_registrations_and_each_asks_for_more() -> None:
    worlds = {}
    for level in ("easy-", "", "medium-", "hard-"):
        name = f"posefit/FitImage-{level}v1"
        env: Any = gym.make(name).unwrapped
        vector: Any = gym.make_vec(name, 2).unwrapped
        assert vector.world == env.world
        worlds[level] = env.world
    held_out = [world.held_out_people for world in worlds.values()]
    assert held_out == [False, True, True, True]
    motions = [len(world.motion) for world in worlds.values()]
    assert motions == [1, 1, len(KINDS), len(KINDS)]
    assert worlds["hard-"].yaw == "unknown"
    assert worlds["hard-"].noise
