"""Many proposals at once, and looking at a small picture first."""

from dataclasses import replace

import numpy as np
import pytest

from posefit import Body, Camera, PoseProblem, SearchSpace, Silhouette
from posefit.fitting.box import draw_population
from posefit.motion import built_in
from posefit.silhouette.cost import project
from posefit.silhouette.drawn import PoseCount
from posefit_priors.pca import PCA
from tests.cases import each


@pytest.fixture(scope="module")
def problem() -> PoseProblem:
    motion = built_in.motion("walk", frames=2)
    angles = np.concatenate([built_in.motion(style).poses[:, 3:] for style in ("walk-a", "walk-b")])
    body = Body.of(motion.skeleton)
    cameras = [Camera.around(motion.translations[0], azimuth, 3.5, (160, 120)) for azimuth in (0.8, 2.1)]
    seen = [Silhouette.of(project(body, camera, motion.poses[0], motion.translations[0])) for camera in cameras]
    space = SearchSpace(PCA().fit(angles), np.zeros(3), np.radians([45.0, 15.0, 15.0]), motion.translations[0])
    return PoseProblem(body, cameras, seen, space)


@each("translation", ["known", "searched", "aligned"])
def test_a_thousand_proposals_cost_what_each_of_them_costs(problem: PoseProblem, translation: str) -> None:
    problem = replace(problem, space=replace(problem.space, translation=translation))
    proposals = draw_population(problem.space, np.random.default_rng(0), 1000)
    together = problem.evaluate(proposals)
    shared = replace(problem, threads=3)
    np.testing.assert_array_equal(shared.evaluate(proposals), together)
    np.testing.assert_array_equal(
        np.concatenate([problem.evaluate(proposals[k : k + 7]) for k in range(0, 1000, 7)]), together
    )
    np.testing.assert_array_equal(problem.cost(*problem.decode(proposals)), together)
    assert problem.evaluate(proposals[:0]).shape == (0,)


@each("threads", [1, 2])
def test_a_mistake_among_a_thousand_is_named_as_among_few(problem: PoseProblem, threads: int) -> None:
    problem = replace(problem, threads=threads)
    with pytest.raises(ValueError, match=r"proposals must have shape \(n, 9\), got \(1000, 8\)"):
        problem.evaluate(np.zeros((1000, 8)))
    with pytest.raises(ValueError, match=r"proposals must have shape \(n, 9\), got \(1000,\)"):
        problem.evaluate(np.zeros(1000))
    spoilt = np.zeros((1000, 9))
    spoilt[900, 3] = np.nan
    with pytest.raises(ValueError, match="proposals must be finite"):
        problem.evaluate(spoilt)


@each("threads", [1, 2])
def test_a_thousand_proposals_are_counted_once_a_view(problem: PoseProblem, threads: int) -> None:
    count = PoseCount()
    with count.counting():
        replace(problem, threads=threads).evaluate(np.zeros((1000, 9)))
    assert count.poses == 2000


@each("translation", ["known", "searched", "aligned"])
def test_a_proposal_means_the_same_pose_at_every_size(problem: PoseProblem, translation: str) -> None:
    problem = replace(problem, space=replace(problem.space, translation=translation))
    proposals = draw_population(problem.space, np.random.default_rng(1), 50)
    half, quarter = problem.coarser(2), problem.coarser(4)
    assert problem.coarser(2) is half
    assert [camera.width for camera in (*half.cameras, *quarter.cameras)] == [80, 80, 40, 40]
    for mine, theirs in zip(problem.decode(proposals), half.decode(proposals), strict=True):
        np.testing.assert_allclose(theirs, mine, atol=1e-9)


def test_a_pose_that_fits_perfectly_costs_nothing_at_any_size(problem: PoseProblem) -> None:
    motion = built_in.motion("walk", frames=2)
    for factor in (1, 2, 4):
        assert problem.coarser(factor).cost(motion.poses[:1], motion.translations[:1]).tolist() == [0.0]


def test_small_pictures_rank_random_poses_as_the_whole_one_does(problem: PoseProblem) -> None:
    proposals = draw_population(problem.space, np.random.default_rng(2), 300)
    costs = np.array([problem.coarser(factor).evaluate(proposals) for factor in (1, 2, 4)])
    ranks = costs.argsort(axis=1).argsort(axis=1)
    whole, half, quarter = ranks - ranks.mean()
    # Spearman's rank correlations; a quarter of 160 x 120 is a body of about twenty pixels
    assert (whole @ half) / (whole @ whole) > 0.99
    assert (whole @ quarter) / (whole @ whole) > 0.95
