"""Each known pose of an instance really is nearly as good as the true one, apart from the others, and in the box."""

import subprocess
import sys

import numpy as np
import pytest

from posefit.geometry.alike import mirrored_poses
from posefit.motion import built_in
from posefit.niching.instance import (
    APART_MM,
    BOUND,
    COUNT,
    HILL,
    KINDS,
    STEPS,
    niche_instance,
    niche_space,
)
from posefit.niching.space import ARMS, LegsAndArms, legs_and_arms, stride_poses

NUMBERS = (0, 1, 2, 3, 4, 5, 10_000, 10_001, 10_002)


@pytest.mark.parametrize("number", NUMBERS)
def test_the_kernel_finds_every_known_pose_within_the_bound_of_the_true_one(number: int) -> None:
    posed = niche_instance(number)
    assert posed.kind == KINDS[number % 3]
    assert len(posed.known) >= 2
    places = np.tile(posed.problem.space.anchor, (len(posed.known), 1))
    costs = posed.problem.cost(posed.known, places)
    assert np.array_equal(costs, posed.costs)
    assert np.abs(costs - costs[posed.true]).max() <= BOUND


@pytest.mark.parametrize("number", NUMBERS)
def test_known_poses_are_apart_in_the_box_and_have_hills_between_them(number: int) -> None:
    posed, space = niche_instance(number), niche_space()
    away = posed.distances_mm(posed.known)
    pairs = np.transpose(np.triu_indices(len(away), 1))
    assert np.diag(away).max() < 1e-9
    assert min(away[i, j] for i, j in pairs) >= APART_MM
    assert space.feasible(posed.proposals).all()
    assert space.decode(posed.proposals)[0][:, 3:] == pytest.approx(posed.known[:, 3:], abs=1e-9)
    assert posed.problem.evaluate(posed.proposals) == pytest.approx(posed.costs, abs=0.05)
    for i, j in pairs:
        way = space.towards(posed.proposals[i], posed.proposals[j])
        between = posed.problem.evaluate(space.wrap(posed.proposals[i] + STEPS[:, None] * way))
        assert between.max() >= posed.costs[[i, j]].max() + HILL - 0.05


def test_a_kind_has_what_its_name_says() -> None:
    strides, turns, arms = (niche_instance(number) for number in (0, 1, 2))
    yaws = [np.degrees(np.abs(np.angle(np.exp(1j * np.ptp(one.known[:2, 0]))))) for one in (strides, turns)]
    assert yaws[0] <= 40.0  # seen from 20 degrees before or behind the side, at most
    assert yaws[1] >= 80.0  # at most 50 degrees from in front, or from behind
    legs = np.setdiff1d(np.arange(66), ARMS)
    same = [
        (i, j)
        for i in range(len(arms.known))
        for j in range(i)
        if np.allclose(arms.known[i, legs], arms.known[j, legs], atol=1e-6)
    ]
    assert same
    assert all(np.abs(arms.known[i, ARMS] - arms.known[j, ARMS]).max() > 0.1 for i, j in same)


def test_an_instance_is_the_same_in_another_process() -> None:
    code = "from posefit.niching.instance import niche_instance as n; i = n(4); print(i.true, i.known.tobytes().hex())"
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    posed = niche_instance(4)
    assert int(other[0]) == posed.true
    assert bytes.fromhex(other[1]) == posed.known.tobytes()


def test_instances_differ_and_any_known_pose_may_be_the_true_one() -> None:
    posed = [niche_instance(number) for number in range(0, 24, 3)]
    assert len({one.known.tobytes() for one in posed}) == len(posed)
    assert {one.true for one in posed} == {0, 1}


@pytest.mark.parametrize("number", [-1, COUNT, 1.5, "1", True, None])
def test_a_number_that_there_is_not_is_named(number: object) -> None:
    with pytest.raises(ValueError, match=f"instance must be a whole number from 0 to {COUNT - 1}, got {number!r}"):
        niche_instance(number)  # type: ignore[arg-type]


def test_the_box_holds_the_mirror_image_of_what_it_holds() -> None:
    skeleton, prior = built_in.average_skeleton(), legs_and_arms()
    held = prior.held(stride_poses()[::97])
    mirrored = mirrored_poses(skeleton, held)
    assert prior.held(mirrored)[:, 3:] == pytest.approx(mirrored[:, 3:], abs=1e-9)
    assert prior.held(held) == pytest.approx(held, abs=1e-12)


def test_legs_do_not_move_the_arms_and_rows_have_the_same_bits_in_any_company() -> None:
    prior: LegsAndArms = legs_and_arms()
    latents = np.random.default_rng(0).uniform(prior.low, prior.high, (7, len(prior.low)))
    angles = prior.inverse_transform(latents)
    assert all(
        np.array_equal(prior.inverse_transform(one[None])[0], row) for one, row in zip(latents, angles, strict=True)
    )
    moved = latents.copy()
    moved[:, :3] = 0.0
    assert np.array_equal(prior.inverse_transform(moved)[:, ARMS - 3], angles[:, ARMS - 3])
    assert prior.transform(angles) == pytest.approx(latents, abs=1e-9)
