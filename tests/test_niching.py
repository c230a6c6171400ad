"""The known poses of an instance: nearly as good as the true one, apart from the others, and in the box."""

import itertools

import numpy as np
import pytest

from posefit.fitting.box import displacement, draw_population, wrap
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
    best_apart,
    legs_and_arms,
    niche_instance,
    niche_space,
    scored,
)
from posefit.uncertainty.modes import Posterior, poses_apart
from tests.cases import each


@each("number", [0, 1, 2, 10_001])
def test_known_poses_cost_nearly_the_same_are_apart_and_have_hills_between_them(number: int) -> None:
    instance, space = niche_instance(number), niche_space()
    assert instance.kind == KINDS[number % 3]
    assert len(instance.known) >= 2
    places = np.tile(instance.problem.space.anchor, (len(instance.known), 1))
    costs = instance.problem.cost(instance.known, places)
    assert np.array_equal(costs, instance.costs)
    assert np.abs(costs - costs[instance.true]).max() <= BOUND
    away = instance.distances_mm(instance.known)
    pairs = np.transpose(np.triu_indices(len(away), 1))
    assert np.diag(away).max() < 1e-9
    assert min(away[i, j] for i, j in pairs) >= APART_MM
    assert space.feasible(instance.proposals).all()
    assert space.decode(instance.proposals)[0][:, 3:] == pytest.approx(instance.known[:, 3:], abs=1e-9)
    assert instance.problem.evaluate(instance.proposals) == pytest.approx(instance.costs, abs=0.05)
    for i, j in pairs:
        way = displacement(space, instance.proposals[i], instance.proposals[j])
        between = instance.problem.evaluate(wrap(space, instance.proposals[i] + STEPS[:, None] * way))
        assert between.max() >= instance.costs[[i, j]].max() + HILL - 0.05


def test_instances_are_of_their_kind() -> None:
    strides, turns, arms = (niche_instance(number).known for number in (0, 1, 2))
    yaws = [np.degrees(np.abs(np.angle(np.exp(1j * np.ptp(known[:2, 0]))))) for known in (strides, turns)]
    assert yaws[0] <= 40.0  # the view is 20 degrees from the side, at most
    assert yaws[1] >= 80.0  # the view is 50 degrees from the front or from behind, at most
    legs, pairs = np.setdiff1d(np.arange(66), ARMS), itertools.combinations(arms, 2)
    same = [np.abs(one - other)[ARMS].max() for one, other in pairs if np.allclose(one[legs], other[legs], atol=1e-6)]
    assert same
    assert min(same) > 0.1


def test_a_number_out_of_range_is_named() -> None:
    for number in (-1, COUNT, 1.5, "1", True, None):
        with pytest.raises(ValueError, match=f"instance must be .*, got {number!r}"):
            niche_instance(number)  # type: ignore[arg-type]


def test_legs_do_not_move_the_arms() -> None:
    prior = legs_and_arms()
    latents = np.random.default_rng(0).uniform(prior.low, prior.high, (7, len(prior.low)))
    angles = prior.inverse_transform(latents)
    moved = latents.copy()
    moved[:, :3] = 0.0
    assert np.array_equal(prior.inverse_transform(moved)[:, ARMS - 3], angles[:, ARMS - 3])
    assert prior.transform(angles) == pytest.approx(latents, abs=1e-9)


def test_the_best_come_first_and_are_apart() -> None:
    instance = niche_instance(1)
    proposals = np.concatenate(
        [draw_population(instance.problem.space, np.random.default_rng(0), 300), instance.proposals]
    )
    costs = instance.problem.evaluate(proposals)
    report = best_apart(instance.problem, proposals, costs)
    reported = instance.problem.cost(report.poses, report.translations)
    assert len(report) == REPORTED
    assert (np.diff(reported) >= 0.0).all()
    assert reported[0] == costs.min()
    away = 1e3 * poses_apart(instance.problem.body.skeleton, report.poses, report.poses)
    assert away[np.triu_indices(len(away), 1)].min() > APART_MM


def test_a_perfect_report_has_perfect_scores() -> None:
    instance = niche_instance(1)
    report = best_apart(instance.problem, instance.proposals, instance.costs)
    score = scored(instance, report)
    assert score.peak_ratio == dict.fromkeys(LEVELS_MM, 1.0)
    assert sum(score.weights) == pytest.approx(1.0)
    sure = Posterior(report.poses[:1], report.translations[:1], np.ones(1))
    alone = scored(instance, sure)
    assert alone.peak_ratio == dict.fromkeys(LEVELS_MM, 1 / len(instance.known))
    right = instance.distances_mm(sure.poses).argmin() == instance.true
    assert (alone.brier, alone.reported) == (0.0 if right else 2.0, 1)


def test_only_the_ten_heaviest_poses_count() -> None:
    instance = niche_instance(1)
    far = np.tile(instance.known[0], (10, 1))
    far[:, 0] += np.pi / 2
    poses = np.concatenate([instance.known[:1], far])
    report = Posterior(poses, np.zeros((11, 3)), np.array([0.01, *np.full(10, 0.1)]))
    score = scored(instance, report)
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
def test_wrong_proposals_are_refused(proposals: int, costs: list[float], temperature: float, said: str) -> None:
    problem = niche_instance(1).problem
    with pytest.raises(ValueError, match=said):
        best_apart(problem, np.zeros((proposals, 8)), np.array(costs), temperature=temperature)
