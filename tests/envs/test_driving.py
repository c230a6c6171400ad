"""Optimisers search one environment or many, whatever the size of a population and the end of an episode."""

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import error

from posefit import Problem, Start, minimise
from posefit.registry import registry
from posefit.settings import planned
from posefit_envs import drive, drive_each, track_reference
from posefit_envs.policies import rollout
from posefit_envs.world import first_problem, world_of
from tests.cases import each


def alone(name: str, number: int, seed: int, evaluations: int) -> Any:
    """Return the problem minimised by the library without an environment."""
    problem = first_problem(world_of(), number)
    problem.budget = evaluations
    factory = registry().optimiser(name)
    optimiser = factory(
        problem.space, np.random.default_rng(seed), **planned(factory, {}, evaluations)
    )
    return minimise(problem, optimiser)


@each("name", ["sapso", "cma"])  # 40 and 10 proposals
def test_any_population_on_any_number_of_environments_is_the_library_bit_for_bit(
    name: str,
) -> None:
    expected = alone(name, 3, 5, 400)
    ends: dict[str, Any] = {"instance": 3, "max_evaluations": 13}
    for env in (
        gym.make("posefit/FitImage-v1", **ends),
        gym.make_vec("posefit/FitImage-v1", num_envs=7, **ends),
    ):
        minimum = drive(env, name, seed=5, evaluations=400)
        np.testing.assert_array_equal(minimum.trace, expected.trace)
        np.testing.assert_array_equal(minimum.best, expected.best)


def test_each_environment_has_its_instance_and_its_search() -> None:
    vector = gym.make_vec("posefit/FitImage-v1", num_envs=3, max_evaluations=50)
    minima = drive_each(vector, "cma", seed=5, instances=[3, 4, 3], evaluations=200)
    for minimum, (number, seed) in zip(minima, ((3, 5), (4, 6), (3, 7)), strict=True):
        expected = alone("cma", number, seed, 200)
        np.testing.assert_array_equal(minimum.trace, expected.trace)
        np.testing.assert_array_equal(minimum.best, expected.best)
        assert minimum.evaluations == expected.evaluations


def test_a_search_starts_from_the_proposals_of_a_policy() -> None:
    env: Any = gym.make("posefit/FitImage-v1", instance=3)
    truth = env.reset(seed=0)[1]["truth"]
    episode = rollout(env, lambda _, step: truth * step / 7.0, 3, seed=0)
    assert episode["actions"].shape == (8, 9)
    best = episode["actions"][episode["rewards"].argmax()]
    assert env.unwrapped.problem.cost(best[None])[0] == episode["best_cost"]
    start = Start(best, np.full(9, 1e-3), np.zeros(9))
    space = replace(env.unwrapped.space, start=start)
    search = registry().optimiser("cma")(space, np.random.default_rng(0))
    problem = Problem(env.unwrapped.problem.cost, space, 10)
    assert minimise(problem, search).best_cost < 2.0 * episode["best_cost"]


def test_an_environment_that_cannot_be_driven_is_named() -> None:
    vector = gym.make_vec("posefit/FitImage-v1", num_envs=3)
    with pytest.raises(
        error.Error,
        match=r"instance must be the same in all environments, got \[.*\]: use drive_each",
    ):
        drive(vector, "sapso")
    with pytest.raises(
        error.Error, match="evaluations must be at least 40, one population, got 20"
    ):
        drive_each(vector, "sapso", evaluations=20)
    for other in (
        gym.make("posefit/Race-v1"),
        gym.make("CartPole-v1"),
        gym.make_vec("posefit/Race-v1", 2),
    ):
        with pytest.raises(error.Error, match="env must be posefit/FitImage-v1, got"):
            drive(other, "sapso")


@pytest.fixture(scope="module")
def tracking() -> Any:
    return gym.make(
        "posefit/Track-v1", instance=17, frames=4, evaluations_per_frame=800
    )


def test_a_reference_reports_what_a_committing_step_reports_and_beats_the_middle_of_the_box(
    tracking: Any,
) -> None:
    tracking.reset(seed=0)
    rows = track_reference(tracking)
    infos = [tracking.step(np.zeros(9))[-1] for _ in range(4 * 800)]
    committed = [info for info in infos if info["committed_frame"] >= 0]
    assert (
        [row["committed_frame"] for row in rows]
        == [info["committed_frame"] for info in committed]
        == [0, 1, 2, 3]
    )
    assert set(rows[0]) == {
        name for name in committed[0] if name.startswith("committed_")
    }
    reference, middle = (
        np.mean([row["committed_mpjpe_mm"] for row in some])
        for some in (rows, committed)
    )
    assert reference < 0.5 * middle


def test_a_reference_learns_from_train_and_has_the_trackers_settings(
    tracking: Any,
) -> None:
    tracking.reset(seed=0)
    pose = track_reference(tracking, "exemplars", train=["walk-b"], lag=0)[0][
        "committed_pose"
    ]
    assert not np.array_equal(
        pose, track_reference(tracking, "exemplars")[0]["committed_pose"]
    )
    assert np.array_equal(
        pose, track_reference(tracking, train=["walk-b"], lag=0)[0]["committed_pose"]
    )


def test_mistakes_of_a_reference_are_named(tracking: Any) -> None:
    tracking.reset(seed=0)
    with pytest.raises(
        ValueError,
        match="method must be .*one of exemplars, .*did you mean 'exemplars'",
    ):
        track_reference(tracking, "exemplar")
    with pytest.raises(
        ValueError, match="a setting of exemplars must be one of .*, got 'lags'"
    ):
        track_reference(tracking, lags=3)
    with pytest.raises(
        error.Error, match="env must be posefit/Track-v1, got FitImageEnv"
    ):
        track_reference(gym.make("posefit/FitImage-v1"))
    with pytest.raises(error.ResetNeeded):
        track_reference(gym.make("posefit/Track-v1").unwrapped)
