"""The search space, the problem and the loop that drives an optimiser."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from posefit import Body, Camera, PoseProblem, SearchSpace, Silhouette, minimise
from posefit.arrays import Array
from posefit.fitting.alignment import align
from posefit.fitting.box import displacement, draw_population
from posefit.fitting.optimiser import BudgetError, populations
from posefit.motion import built_in
from posefit.silhouette.cost import project
from posefit_priors.pca import PCA
from posefit_swarm.random import Random
from posefit_swarm.sapso import SAPSO
from tests.cases import each


@pytest.fixture(scope="module")
def problem() -> PoseProblem:
    motion = built_in.motion("walk", frames=2)
    angles = np.concatenate([built_in.motion(style).poses[:, 3:] for style in ("walk-a", "walk-b")])
    body = Body.of(motion.skeleton)
    camera = Camera.around(motion.translations[0], 0.8, 3.5, (160, 120))
    silhouette = Silhouette.of(project(body, camera, motion.poses[0], motion.translations[0]))
    space = SearchSpace(PCA().fit(angles), np.zeros(3), np.radians([45.0, 15.0, 15.0]), motion.translations[0])
    return PoseProblem(body, [camera], [silhouette], space)


@each("threads", [1, 2])
def test_a_cost_has_the_same_bits_whatever_stands_beside_it(problem: PoseProblem, threads: int) -> None:
    problem = replace(problem, threads=threads)
    proposals = draw_population(problem.space, np.random.default_rng(0), 300)
    together = problem.evaluate(proposals)
    np.testing.assert_array_equal(problem.evaluate(proposals[:40]), together[:40])
    np.testing.assert_array_equal([problem.evaluate(one[None])[0] for one in proposals[:20]], together[:20])
    np.testing.assert_array_equal(problem.evaluate(proposals[::-1])[::-1], together)


@each("threads", [1, 2])
def test_a_search_is_told_the_costs_of_the_areas_and_a_view_that_knows_nothing_has_no_say(
    problem: PoseProblem, threads: int
) -> None:
    seen = problem.silhouettes[0]
    half = Silhouette.of(seen.mask, np.ones_like(seen.mask) & (np.arange(seen.size[0]) < 80))
    blind = Silhouette.of(np.zeros_like(seen.mask), np.zeros_like(seen.mask))
    cameras = [problem.cameras[0]] * 3
    several = replace(problem, cameras=cameras, silhouettes=[blind, seen, half], beta=0.3, threads=threads)
    proposals = draw_population(several.space, np.random.default_rng(1), 40)
    counts = several.areas(*several.decode(proposals))
    np.testing.assert_array_equal(several.evaluate(proposals), several.cost(*several.decode(proposals)))
    shares = np.array([100.0 * (0.7 * b / (b + y) + 0.3 * r / (r + y)) for r, b, y in np.concatenate(counts[1:])])
    np.testing.assert_allclose(several.evaluate(proposals), shares.reshape(2, -1).mean(axis=0))
    nothing = replace(several, silhouettes=[blind] * 3, blank=True)
    np.testing.assert_array_equal(nothing.evaluate(proposals), 100.0)  # Interpretation S2


def test_proposals_and_coordinates_are_inverse(problem: PoseProblem) -> None:
    proposals = draw_population(problem.space, np.random.default_rng(0), 30)
    back = [problem.space.proposals(one) for one in problem.space.coordinates(proposals)]
    np.testing.assert_allclose(back, proposals, atol=1e-12)


def test_a_searched_translation_has_three_more_dimensions(problem: PoseProblem) -> None:
    space = replace(problem.space, translation="searched", anchor=np.array([1.0, 2.0, 3.0]))
    assert space.dimensions == problem.space.dimensions + 3 == 12
    poses, translations = space.decode(np.array([[0.0] * 3 + [1.0, 0.0, -0.5] + [0.0] * 6]))
    np.testing.assert_allclose(translations, [[1.5, 2.0, 2.75]])
    np.testing.assert_allclose(poses[0, :3], 0.0)


def test_several_views_are_averaged(problem: PoseProblem) -> None:
    other = Camera.around(problem.space.anchor, 2.1, 3.5, (100, 90))
    motion = built_in.motion("walk", frames=2)
    seen = Silhouette.of(project(problem.body, other, motion.poses[0], motion.translations[0]))
    second = replace(problem, cameras=[other], silhouettes=[seen])
    both = replace(problem, cameras=[problem.cameras[0], other], silhouettes=[problem.silhouettes[0], seen])
    proposals = draw_population(problem.space, np.random.default_rng(0), 20)
    np.testing.assert_allclose(both.evaluate(proposals), (problem.evaluate(proposals) + second.evaluate(proposals)) / 2)


def test_unknown_pixels_count_for_nothing(problem: PoseProblem) -> None:
    mask = problem.silhouettes[0].mask
    valid = np.ones_like(mask)
    valid[60:] = False
    spoilt = mask.copy()
    spoilt[60:] = np.random.default_rng(0).random(spoilt[60:].shape) < 0.5
    proposals = draw_population(problem.space, np.random.default_rng(0), 20)
    clean, dirty = (replace(problem, silhouettes=[Silhouette.of(m, valid)]) for m in (mask, spoilt))
    np.testing.assert_array_equal(clean.evaluate(proposals), dirty.evaluate(proposals))


def test_aligning_finds_the_true_translation(problem: PoseProblem) -> None:
    motion = built_in.motion("walk", frames=8)
    camera = problem.cameras[0]
    for pose, translation in zip(motion.poses, motion.translations, strict=True):
        where = translation + [0.2, -0.1, 0.3]
        silhouette = Silhouette.of(project(problem.body, camera, pose, where))
        found = align(problem.body, [camera], [silhouette], pose[None], translation[None])[0]
        sideways, depth = camera.rotation[:2] @ (found - where), camera.rotation[2] @ (found - where)
        assert np.abs(sideways).max() < 0.02  # metres; a pixel is 0.016 m here
        assert abs(depth) < 0.15


def test_a_problem_can_be_pickled(problem: PoseProblem) -> None:
    proposals = draw_population(problem.space, np.random.default_rng(0), 5)
    again = pickle.loads(pickle.dumps(problem))
    np.testing.assert_array_equal(again.evaluate(proposals), problem.evaluate(proposals))


def test_mistakes_are_named(problem: PoseProblem) -> None:
    with pytest.raises(ValueError, match=r"proposals must have shape \(n, 9\), got \(4, 8\)"):
        problem.evaluate(np.zeros((4, 8)))
    with pytest.raises(ValueError, match="proposals must be finite"):
        problem.evaluate(np.full((1, 9), np.nan))
    with pytest.raises(ValueError, match=r"mask must have shape \(120, 160\), the camera's, got \(160, 120\)"):
        replace(problem, silhouettes=[Silhouette.of(np.ones((160, 120)))])
    with pytest.raises(ValueError, match="translation must be one of known, searched, aligned, got 'free'"):
        replace(problem.space, translation="free")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"silhouettes must be one a camera \(1\), got 0"):
        replace(problem, silhouettes=[])


class Walker:
    """Proposes fixed populations, whatever they cost."""

    def __init__(self, size: int) -> None:
        self.size, self.told = size, []  # type: ignore[var-annotated]

    def ask(self) -> Array:
        return np.full((self.size, 1), float(len(self.told)))

    def tell(self, proposals: Array, costs: Array) -> None:
        self.told.append((proposals, costs))


def test_the_budget_is_spent_in_whole_populations() -> None:
    walker = Walker(7)
    best = minimise(lambda x: -x[:, 0], walker, 40)
    assert best.evaluations == 35
    assert len(walker.told) == 5
    assert best.cost == -4.0
    assert best.history.tolist() == [0.0, -1.0, -2.0, -3.0, -4.0]
    assert best.spent.tolist() == [7, 14, 21, 28, 35]


def test_the_loop_tells_the_costs_of_a_population_before_it_asks_for_the_next() -> None:
    walker = Walker(2)
    seen = []
    for proposals, costs in populations(walker, lambda x: 10.0 * x[:, 0], 6):
        assert len(walker.told) == len(seen)
        seen.append((proposals, costs))
    assert [costs.tolist() for _, costs in seen] == [[0.0, 0.0], [10.0, 10.0], [20.0, 20.0]]
    assert all(told[0] is ours[0] and told[1] is ours[1] for told, ours in zip(walker.told, seen, strict=True))
    assert len(walker.told) == 3


def test_nan_is_never_the_best_cost() -> None:
    best = minimise(lambda x: np.where(x[:, 0] == 1.0, 5.0, np.nan), Walker(3), 9)
    assert best.cost == 5.0
    with pytest.raises(ValueError, match="costs must be numbers, got nan for all 9 proposals"):
        minimise(lambda x: x[:, 0] * np.nan, Walker(3), 9)


def test_a_budget_below_one_population_is_refused() -> None:
    with pytest.raises(BudgetError, match="evaluations must hold one population of 7, got 6"):
        minimise(lambda x: x[:, 0], Walker(7), 6)


def test_sapso_beats_random_search_at_the_same_cost(problem: PoseProblem) -> None:
    found = {
        factory: np.median(
            [minimise(problem.evaluate, factory(problem.space, np.random.default_rng(s)), 2440).cost for s in range(20)]
        )
        for factory in (SAPSO, Random)
    }
    assert found[SAPSO] < 0.7 * found[Random]


def test_a_full_circle_of_yaw_wraps(problem: PoseProblem) -> None:
    space = replace(problem.space, root_range=np.array([np.pi, 0.2, 0.2]))
    assert space.periodic.tolist() == [True] + [False] * 8
    assert displacement(space, np.array([0.9] + [0.0] * 8), np.array([-0.9] + [0.0] * 8))[0] == pytest.approx(0.2)
