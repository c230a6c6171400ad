"""What a search evaluated becomes poses with weights; and how those are scored on an instance."""

import numpy as np
import pytest

from posefit.niching.instance import APART_MM, apart_mm, niche_instance
from posefit.niching.reports import REPORTED, best_apart, boltzmann
from posefit.niching.scores import LEVELS_MM, scored
from posefit.uncertainty.modes import Posterior


def test_weights_are_those_of_boltzmann() -> None:
    assert boltzmann(np.array([3.0, 3.0])) == pytest.approx([0.5, 0.5])
    assert boltzmann(np.array([1.0, 1.0 + np.log(3.0)])) == pytest.approx([0.75, 0.25])
    assert boltzmann(np.array([1.0, 1.0 + np.log(9.0)]), temperature=2.0) == pytest.approx([0.75, 0.25])


def test_the_best_come_first_and_are_apart() -> None:
    posed = niche_instance(1)
    proposals = np.concatenate([posed.problem.space.draw(np.random.default_rng(0), 300), posed.proposals])
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


@pytest.mark.parametrize(
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
