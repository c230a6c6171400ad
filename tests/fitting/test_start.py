"""Modes of first poses, their projection onto a prior's latents, and populations that are drawn from several."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import posefit
from posefit import Optimiser, SearchSpace, SilhouetteCost
from posefit.fitting.start import MODE_SPREAD, modes_apart, start_in
from posefit.fitting.tracker import Observation, Task, guessed_modes
from posefit.motion import built_in
from posefit.plugin import Posterior, Start, draw_population
from posefit.silhouette.drawn import PoseCount
from posefit.testing.toy import Toy
from tests.cases import each

WALK = built_in.motion("walk-a", frames=40)
PRIOR = posefit.prior("pca")().fit(WALK.poses[:, 3:], WALK.skeleton)
SPACE = SearchSpace(PRIOR, np.zeros(3), np.array([np.pi, 0.3, 0.3]), np.zeros(3))


def weighted(rows: list[int], turns: list[float], weights: list[float]) -> Posterior:
    poses = WALK.poses[rows].copy()
    poses[:, 0] += turns
    return Posterior(poses, WALK.translations[rows], np.array(weights))


def test_a_population_is_drawn_from_all_modes_by_their_weights() -> None:
    count = 4000
    parts = ((-0.5, 0.02, 0.75), (0.5, 0.05, 0.25))
    start, other = (
        Start(np.full(3, mean), np.full(3, spread), np.zeros(3), weight)
        for mean, spread, weight in parts
    )
    drawn = draw_population(
        Toy(3, start=replace(start, others=[other])), np.random.default_rng(0), count
    )
    first = drawn[:, 0] < 0.0
    # binomial, of standard deviation sqrt(p q / n); a mean's error is spread / sqrt(n), that of a spread over sqrt(2)
    assert abs(first.mean() - 0.75) < 4.0 * np.sqrt(0.75 * 0.25 / count)
    for rows, (mean, spread, _) in ((first, parts[0]), (~first, parts[1])):
        error = 4.0 * spread / np.sqrt(rows.sum())
        np.testing.assert_allclose(drawn[rows].mean(axis=0), mean, atol=error)
        np.testing.assert_allclose(drawn[rows].std(axis=0), spread, atol=error)


def cost_of(row: int, turn: float) -> SilhouetteCost:
    """Return the cost whose silhouette is of one of the walker's poses, turned."""
    body = posefit.Body.of(WALK.skeleton)
    place = WALK.translations[row]
    camera = posefit.Camera.around(place, 0.3, 5.0, (160, 120))
    mask = posefit.project(body, camera, WALK.poses[row] + turn * np.eye(66)[0], place)
    return SilhouetteCost(
        body, [camera], [posefit.Silhouette.of(mask)], replace(SPACE, anchor=place)
    )


def test_modes_are_projected_onto_the_latents_of_the_prior_and_weighed_by_their_costs_there() -> (
    None
):
    start = start_in(
        cost_of(20, 2.5),
        modes_apart(WALK.skeleton, weighted([5, 20], [0.0, 2.5], [3.0, 1.0])),
    )
    (other,) = start.others
    # the silhouette is that of the mode whose weight was less
    assert start.weight > other.weight > 0.0
    for mode, row, turn in ((start, 20, 2.5), (other, 5, 0.0)):
        pose = SPACE.decode(mode.mean[None])[0][0]
        np.testing.assert_allclose(np.cos(pose[0] - WALK.poses[row, 0] - turn), 1.0)
        projected = PRIOR.inverse_transform(
            PRIOR.transform(WALK.poses[row : row + 1, 3:])
        )[0]
        np.testing.assert_allclose(pose[3:], projected, atol=1e-9)
        np.testing.assert_array_equal(
            mode.spread, np.full(SPACE.dimensions, MODE_SPREAD)
        )


def test_a_mode_is_around_its_pose_that_costs_least() -> None:
    ((_, mode),) = modes_apart(
        WALK.skeleton, weighted([5, 5, 5], [0.3, 0.2, 0.0], [5.0, 4.0, 1.0])
    )
    start = start_in(cost_of(5, 0.0), [(1.0, mode)])
    np.testing.assert_allclose(
        SPACE.decode(start.mean[None])[0][0, 0], WALK.poses[5, 0], atol=1e-9
    )


def test_nothing_is_guessed_for_a_known_pose_or_an_empty_mask() -> None:
    body = posefit.Body.of(WALK.skeleton)
    camera = posefit.Camera.framing(WALK.joints[0], body.joint_radii(), 0.0, (64, 48))
    observation = Observation([posefit.Silhouette.of(np.ones((48, 64)))])
    guess = SimpleNamespace(posterior=lambda observation: weighted([5], [1.0], [1.0]))
    task = Task(body, [camera], 100, None, np.zeros(3), start=lambda task: guess)
    ((weight, mode),) = guessed_modes(task, observation)
    assert (weight, len(mode)) == (1.0, 1)
    assert not guessed_modes(replace(task, first_pose=WALK.poses[0, 3:]), observation)
    assert not guessed_modes(task, replace(observation, usable=False))
    assert not guessed_modes(replace(task, start=None), observation)


@each("size", [(48, 36), (96, 72), (160, 120)])
@each("evaluations", [100, 200, 400])
@each("views", [1, 2])
def test_a_guess_leaves_most_of_any_budget_to_the_search(
    size: tuple[int, int], evaluations: int, views: int
) -> None:
    body = posefit.Body.of(WALK.skeleton)
    place = WALK.translations[20]
    cameras = [posefit.Camera.around(place, 0.3 + k, 5.0, size) for k in range(views)]
    masks = [posefit.project(body, each, WALK.poses[20], place) for each in cameras]
    observation = Observation([posefit.Silhouette.of(mask) for mask in masks])
    # two modes, of many poses that are nearly the same
    rows = [20] * 240
    turns = [*np.linspace(-0.05, 0.05, 120), *np.linspace(2.0, 2.1, 120)]
    guess = SimpleNamespace(posterior=lambda _: weighted(rows, turns, [1.0] * 240))
    task = Task(body, cameras, evaluations, None, place, start=lambda _: guess)
    pso = posefit.optimiser("pso")

    def make(space: SearchSpace, rng: np.random.Generator, budget: int) -> Optimiser:
        return pso(space, rng, population_size=40)

    drawn = PoseCount()
    with drawn.counting():
        (frame,) = posefit.SynthesisTracker(task, PRIOR, make).track(
            [observation], np.random.default_rng(0)
        )
    # rounded up, as a part of an evaluation is one
    assert frame.evaluations == np.ceil(drawn.poses / views) <= evaluations
    searched = frame.evaluations - int(frame.trace[0, 0]) + 1
    assert searched >= 40


def test_a_guess_that_takes_the_whole_budget_is_named() -> None:
    cost = cost_of(20, 0.0)

    def posterior(observation: Observation) -> Posterior:
        posefit.pose_costs(
            cost.body,
            cost.cameras,
            observation.silhouettes,
            np.repeat(WALK.poses[20:21], 120, axis=0),
            np.repeat(WALK.translations[20:21], 120, axis=0),
        )
        return weighted([20], [0.0], [1.0])

    task = Task(
        cost.body,
        cost.cameras,
        100,
        None,
        WALK.translations[20],
        start=lambda _: SimpleNamespace(posterior=posterior),
    )
    tracker = posefit.SynthesisTracker(task, PRIOR, lambda *_: None)
    with pytest.raises(ValueError, match="evaluations must be more than the 12. that"):
        next(
            iter(
                tracker.track([Observation(cost.silhouettes)], np.random.default_rng(0))
            )
        )
