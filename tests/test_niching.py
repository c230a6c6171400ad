"""Each known pose of an instance really is nearly as good as the true one, apart from the others, and in the box."""

import subprocess
import sys

import numpy as np
import pytest

from posefit.fitting.box import displacement, draw_population, wrap
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion import built_in
from posefit.niching import (
    APART_MM,
    ARMS,
    BOUND,
    COUNT,
    HILL,
    KINDS,
    LEVELS_MM,
    REPORTED,
    STEPS,
    LegsAndArms,
    apart_mm,
    best_apart,
    legs_and_arms,
    niche_instance,
    niche_space,
    scored,
    stride_poses,
)
from posefit.uncertainty.modes import Posterior
from posefit.uncertainty.searches import boltzmann_weights
from tests.cases import each


@each("number", [0, 1, 2, 10_001])
def test_known_poses_cost_nearly_the_same_are_apart_and_have_hills_between_them(number: int) -> None:
    posed, space = niche_instance(number), niche_space()
    assert posed.kind == KINDS[number % 3]
    assert len(posed.known) >= 2
    places = np.tile(posed.problem.space.anchor, (len(posed.known), 1))
    costs = posed.problem.cost(posed.known, places)
    assert np.array_equal(costs, posed.costs)
    assert np.abs(costs - costs[posed.true]).max() <= BOUND
    away = posed.distances_mm(posed.known)
    pairs = np.transpose(np.triu_indices(len(away), 1))
    assert np.diag(away).max() < 1e-9
    assert min(away[i, j] for i, j in pairs) >= APART_MM
    assert space.feasible(posed.proposals).all()
    assert space.decode(posed.proposals)[0][:, 3:] == pytest.approx(posed.known[:, 3:], abs=1e-9)
    assert posed.problem.evaluate(posed.proposals) == pytest.approx(posed.costs, abs=0.05)
    for i, j in pairs:
        way = displacement(space, posed.proposals[i], posed.proposals[j])
        between = posed.problem.evaluate(wrap(space, posed.proposals[i] + STEPS[:, None] * way))
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
    code = "from posefit.niching import niche_instance as n; i = n(4); print(i.true, i.known.tobytes().hex())"
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    posed = niche_instance(4)
    assert int(other[0]) == posed.true
    assert bytes.fromhex(other[1]) == posed.known.tobytes()


def test_instances_differ_and_any_known_pose_may_be_the_true_one() -> None:
    posed = [niche_instance(number) for number in range(0, 24, 3)]
    assert len({one.known.tobytes() for one in posed}) == len(posed)
    assert {one.true for one in posed} == {0, 1}


def test_a_number_out_of_range_is_named() -> None:
    for number in (-1, COUNT, 1.5, "1", True, None):
        with pytest.raises(ValueError, match=f"instance must be a whole number from 0 to {COUNT - 1}, got {number!r}"):
            niche_instance(number)  # type: ignore[arg-type]


def test_the_box_holds_the_mirror_image_of_what_it_holds() -> None:
    skeleton, prior = built_in.average_skeleton(), legs_and_arms()
    held = prior.clipped(stride_poses()[::97])
    mirrored = mirrored_poses(skeleton, held)
    assert prior.clipped(mirrored)[:, 3:] == pytest.approx(mirrored[:, 3:], abs=1e-9)
    assert prior.clipped(held) == pytest.approx(held, abs=1e-12)


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


def test_weights_are_those_of_boltzmann() -> None:
    assert boltzmann_weights(np.array([3.0, 3.0]), 1.0) == pytest.approx([0.5, 0.5])
    assert boltzmann_weights(np.array([1.0, 1.0 + np.log(3.0)]), 1.0) == pytest.approx([0.75, 0.25])
    assert boltzmann_weights(np.array([1.0, 1.0 + np.log(9.0)]), temperature=2.0) == pytest.approx([0.75, 0.25])


def test_the_best_come_first_and_are_apart() -> None:
    posed = niche_instance(1)
    proposals = np.concatenate([draw_population(posed.problem.space, np.random.default_rng(0), 300), posed.proposals])
    costs = posed.problem.evaluate(proposals)
    report = best_apart(posed.problem, proposals, costs)
    found = posed.problem.cost(report.poses, report.translations)
    assert len(report) == REPORTED
    assert (np.diff(found) >= 0.0).all()
    assert found[0] == costs.min()
    away = apart_mm(posed.problem.body, report.poses, report.poses)
    assert away[np.triu_indices(len(away), 1)].min() > APART_MM


def test_known_poses_reported_with_all_the_weight_on_the_true_one_are_perfect() -> None:
    posed = niche_instance(1)
    report = best_apart(posed.problem, posed.proposals, posed.costs)
    score = scored(posed, report)
    assert score.peak_ratio == dict.fromkeys(LEVELS_MM, 1.0)
    assert sum(score.weights) == pytest.approx(1.0)
    sure = Posterior(report.poses[:1], report.translations[:1], np.ones(1))
    alone = scored(posed, sure)
    assert alone.peak_ratio == dict.fromkeys(LEVELS_MM, 1 / len(posed.known))
    assert (alone.brier, alone.reported) == (
        (0.0, 1) if posed.distances_mm(sure.poses).argmin() == posed.true else (2.0, 1)
    )


def test_only_the_ten_heaviest_poses_count() -> None:
    posed = niche_instance(1)
    far = np.tile(posed.known[0], (10, 1))
    far[:, 0] += np.pi / 2
    poses = np.concatenate([posed.known[:1], far])
    report = Posterior(poses, np.zeros((11, 3)), np.array([0.01, *np.full(10, 0.1)]))
    score = scored(posed, report)
    assert score.reported == 10
    assert set(score.peak_ratio.values()) == {0.0}


@each(
    ("proposals", "costs", "temperature", "said"),
    [
        (2, [1.0], 1.0, r"costs must be one a proposal \(2\), got shape \(1,\)"),
        (2, [np.nan, np.inf], 1.0, "costs must be numbers, got none among 2"),
        (1, [1.0], 0.0, "temperature must be above 0, got 0.0"),
    ],
)
def test_what_makes_no_report_is_refused(proposals: int, costs: list[float], temperature: float, said: str) -> None:
    problem = niche_instance(1).problem
    with pytest.raises(ValueError, match=said):
        best_apart(problem, np.zeros((proposals, 8)), np.array(costs), temperature=temperature)
