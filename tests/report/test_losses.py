"""A method that loses tracks does not lead one that is as good and loses none, in simulated sweeps."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posefit.report.contest import Contest
from posefit.report.leaderboard import Standings, leaderboard
from posefit.report.summary import leader_sentences
from posefit.report.tracks import LOSS, error_with_losses
from tests.report.contests import contest_of_errors, full

INSTANCES = 8
SEEDS = 3
RUNS = INSTANCES * SEEDS
METHODS = ("all-kept", "lossy", "worse", "worst")
LOSSY = METHODS.index("lossy")
BASELINE = 2.8  # degrees, of the mean training pose
LOST = 4  # of 24 tracks, 17 %
SWEEPS = 150


@pytest.fixture(scope="module")
def contest(tmp_path_factory: pytest.TempPathFactory) -> Contest:
    """Return a contest of as many runs as the plan `default` has of a method."""
    errors = full(dict.fromkeys(METHODS, 1.0), INSTANCES, SEEDS)
    return contest_of_errors(tmp_path_factory.mktemp("losses"), errors)


def sweeps(
    contest: Contest, count: int, error_of_lost: float, rng: np.random.Generator
) -> Iterator[Contest]:
    """Yield sweeps in which all methods but the last two are as good, but one loses tracks.

    Half of the frames of a lost track are lost, and its error is `error_of_lost` times a kept one's.
    """
    hardness = np.resize(np.linspace(0.6, 1.4, INSTANCES), RUNS)
    scale = np.array([1.0, 1.0, 2.0, 3.0])[:, None]
    place = {name: m for m, name in enumerate(contest.runs.methods)}
    order = [place[name] for name in METHODS]
    for _ in range(count):
        errors = hardness * scale * rng.gamma(16.0, 1.0 / 16.0, (len(METHODS), RUNS))
        lost = np.zeros(errors.shape)
        tracks = rng.choice(RUNS, LOST, replace=False)
        lost[LOSSY, tracks] = 0.5
        errors[LOSSY, tracks] *= error_of_lost
        rows: Any = [
            {
                "error_degrees": {"mean": error},
                "lost_rate": share,
                "baselines_degrees": {"mean_pose": BASELINE},
            }
            for error, share in zip(errors.ravel(), lost.ravel(), strict=True)
        ]
        scores = np.array([error_with_losses(row) for row in rows])
        drawn = {LOSS: scores, "error_degrees.mean": errors, "lost_rate": lost}
        figures = dict(contest.runs.figures)
        for name, values in drawn.items():
            figures[name] = figures[name].copy()
            figures[name][contest.blocks[order]] = values.reshape(errors.shape)
        yield replace(contest, runs=replace(contest.runs, figures=figures))


@pytest.mark.parametrize("error_of_lost", [1.0, 3.0])
def test_a_method_that_loses_tracks_never_leads_an_otherwise_equal_one(
    contest: Contest, error_of_lost: float
) -> None:
    first = dict.fromkeys(METHODS, 0)
    for sweep in sweeps(contest, SWEEPS, error_of_lost, np.random.default_rng(5)):
        board = leaderboard(sweep)
        first[board[0].name] += 1
        sentence = leader_sentences(Standings(sweep, board, []))[0]
        assert sentence.startswith("all-kept lost frames in none of 24 tracks")
        assert "; it leads " in sentence
    assert first == {"all-kept": SWEEPS, "lossy": 0, "worse": 0, "worst": 0}
