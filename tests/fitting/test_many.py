"""Many proposals at once, and looking at a small picture first."""

from dataclasses import replace

import numpy as np
import pytest

from posefit import Body, Camera, PoseProblem, SearchSpace, Silhouette, minimise
from posefit.arrays import Array
from posefit.fitting.box import draw_population
from posefit.fitting.problem import CoarseFirst
from posefit.motion import built_in
from posefit.silhouette.cost import project
from posefit.silhouette.drawn import PoseCount
from posefit_priors.pca import PCA
from posefit_swarm.sapso import SAPSO


@pytest.fixture(scope="module")
def problem() -> PoseProblem:
    motion = built_in.motion("walk", frames=2)
    angles = np.concatenate([built_in.motion(style).poses[:, 3:] for style in ("walk-a", "walk-b")])
    body = Body.of(motion.skeleton)
    cameras = [Camera.around(motion.translations[0], azimuth, 3.5, (160, 120)) for azimuth in (0.8, 2.1)]
    seen = [Silhouette.of(project(body, camera, motion.poses[0], motion.translations[0])) for camera in cameras]
    space = SearchSpace(PCA().fit(angles), np.zeros(3), np.radians([45.0, 15.0, 15.0]), motion.translations[0])
    return PoseProblem(body, cameras, seen, space)


@pytest.mark.parametrize("translation", ["known", "searched", "aligned"])
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


@pytest.mark.parametrize("threads", [1, 2])
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


@pytest.mark.parametrize("threads", [1, 2])
def test_a_thousand_proposals_are_counted_once_a_view(problem: PoseProblem, threads: int) -> None:
    count = PoseCount()
    with count.counting():
        replace(problem, threads=threads).evaluate(np.zeros((1000, 9)))
    assert count.poses == 2000
    mine = replace(problem, threads=threads, silhouettes=count.own(problem.silhouettes))
    mine.evaluate(np.zeros((1000, 9)))
    assert count.poses == 4000


@pytest.mark.parametrize("translation", ["known", "searched", "aligned"])
def test_a_proposal_means_the_same_pose_at_every_size(problem: PoseProblem, translation: str) -> None:
    problem = replace(problem, space=replace(problem.space, translation=translation))
    proposals = draw_population(problem.space, np.random.default_rng(1), 50)
    half, quarter = problem.coarser(2), problem.coarser(4)
    assert problem.coarser(2) is half
    assert [camera.width for camera in (*half.cameras, *quarter.cameras)] == [80, 80, 40, 40]
    for mine, theirs in zip(problem.decode(proposals), half.decode(proposals), strict=True):
        np.testing.assert_allclose(theirs, mine, atol=1e-9)
    costs = problem.evaluate_at(proposals)
    assert costs.shape == (3, 50)
    np.testing.assert_array_equal(costs[0], problem.evaluate(proposals))
    np.testing.assert_allclose(costs[1:], [half.evaluate(proposals), quarter.evaluate(proposals)], atol=1e-6)
    np.testing.assert_array_equal(problem.evaluate_at(proposals, (4, 1)), costs[[2, 0]])


def test_a_pose_that_fits_perfectly_costs_nothing_at_any_size(problem: PoseProblem) -> None:
    motion = built_in.motion("walk", frames=2)
    for factor in (1, 2, 4):
        assert problem.coarser(factor).cost(motion.poses[:1], motion.translations[:1]).tolist() == [0.0]


def test_small_pictures_rank_random_poses_as_the_whole_one_does(problem: PoseProblem) -> None:
    costs = problem.evaluate_at(draw_population(problem.space, np.random.default_rng(2), 300))
    ranks = costs.argsort(axis=1).argsort(axis=1)
    whole, half, quarter = ranks - ranks.mean()
    # Spearman's rank correlations; a quarter of 160 x 120 is a body of about twenty pixels
    assert (whole @ half) / (whole @ whole) > 0.99
    assert (whole @ quarter) / (whole @ whole) > 0.95


class Line:
    """Proposes eight points for ever, and keeps what they cost."""

    def __init__(self) -> None:
        self.told: list[tuple[Array, Array]] = []
        self.population = np.linspace(-0.7, 0.7, 8)[:, None] * np.ones(9)

    def ask(self) -> Array:
        return self.population

    def tell(self, proposals: Array, costs: Array) -> None:
        self.told.append((proposals, costs))


def test_only_the_best_of_a_small_look_go_on_and_the_others_cost_no_less() -> None:
    class Small:
        def __init__(self) -> None:
            self.factors: list[int] = []

        def coarser(self, factor: int) -> "Small":
            self.factors.append(factor)
            return self

        def evaluate(self, proposals: Array) -> Array:
            return np.array([5.0, 1.0, 7.0, 3.0, 12.0, 2.0, 8.0, 6.0])

    line, small = Line(), Small()
    first = CoarseFirst(line, small, factor=4, keep=0.25)  # type: ignore[arg-type]
    asked = first.ask()
    np.testing.assert_array_equal(asked, line.population[[1, 5]])
    first.tell(asked, np.array([4.0, 10.0]))
    (proposals, costs) = line.told[0]
    assert proposals is line.population
    # what was seen whole costs what it costs, and nothing else less than the worst of it, 10
    assert costs.tolist() == [10.0, 4.0, 10.0, 10.0, 12.0, 10.0, 10.0, 10.0]
    assert small.factors == [4]
    first.ask()
    first.tell(asked, np.array([np.nan, 6.0]))
    assert line.told[1][1][[0, 4, 5]].tolist() == [6.0, 12.0, 6.0]


def test_a_search_that_looks_coarse_first_reports_what_is_true_at_full_size(problem: PoseProblem) -> None:
    optimiser = SAPSO(problem.space, np.random.default_rng(0), population_size=40, iterations=20)
    best = minimise(problem.evaluate, CoarseFirst(optimiser, problem, factor=4, keep=0.1), 21 * 4)
    assert best.evaluations == 21 * 4
    assert best.cost == problem.evaluate(best.proposal[None])[0]
    assert (np.diff(best.history) <= 0.0).all()
    assert best.cost < best.history[0]


def test_at_least_one_proposal_goes_on_and_an_end_is_an_end(problem: PoseProblem) -> None:
    line = Line()
    assert len(CoarseFirst(line, problem, keep=0.01).ask()) == 1
    assert len(CoarseFirst(line, problem, keep=1.0).ask()) == 8
    line.population = np.empty((0, 9))
    assert len(CoarseFirst(line, problem).ask()) == 0
    for keep in (0.0, -1.0, 1.5, np.nan):
        with pytest.raises(ValueError, match="keep must be above 0 and at most 1"):
            CoarseFirst(line, problem, keep=keep)
