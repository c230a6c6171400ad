"""Optimisers search one environment or many, whatever the size of a population and the end of an episode."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import error

from posefit import minimise
from posefit.registry import registry
from posefit.settings import planned
from posefit_envs import drive, drive_each, track_reference
from posefit_envs.instance import instance, select
from posefit_envs.track import TrackEnv
from tests.cases import each


def alone(name: str, number: int, seed: int, evaluations: int) -> Any:
    """Return what the library finds without an environment."""
    world, factory = select().world, registry().optimiser(name)
    made = instance(world, number, 1, evaluations)
    space = made.space(world.learned)
    searching = factory(space, np.random.default_rng(seed), **planned(factory, {}, evaluations))
    return minimise(made.scenery(0).problem(space).evaluate, searching, evaluations)


@each(("version", "name"), [("posefit/FitImage-v0", "sapso"), ("posefit/FitState-v0", "cma")])  # 40 and 10 proposals
def test_any_population_on_any_number_of_environments_is_the_library_bit_for_bit(version: str, name: str) -> None:
    wanted = alone(name, 3, 5, 400)
    ends: dict[str, Any] = {"instance": 3, "max_evaluations": 13}
    if "FitImage" in version:
        ends["target_cost"] = 20.0  # which is reached long before the budget's end
    for env in (gym.make(version, **ends), gym.make_vec(version, num_envs=7, **ends)):
        found = drive(env, name, seed=5, evaluations=400)
        np.testing.assert_array_equal(found.history, wanted.history)
        np.testing.assert_array_equal(found.proposal, wanted.proposal)


def test_each_environment_has_its_instance_and_its_search() -> None:
    vector = gym.make_vec("posefit/FitState-v0", num_envs=3, max_evaluations=50)
    found = drive_each(vector, "cma", seed=5, instances=[3, 4, 3], evaluations=200)
    for one, (number, seed) in zip(found, ((3, 5), (4, 6), (3, 7)), strict=True):
        wanted = alone("cma", number, seed, 200)
        np.testing.assert_array_equal(one.history, wanted.history)
        np.testing.assert_array_equal(one.proposal, wanted.proposal)
        assert one.evaluations == wanted.evaluations


def test_what_does_not_fit_is_said_in_one_line() -> None:
    vector = gym.make_vec("posefit/FitState-v0", num_envs=3)
    with pytest.raises(error.Error, match=r"instance must be the same in all environments, got \[.*\]: use drive_each"):
        drive(vector, "sapso")
    with pytest.raises(error.Error, match="evaluations must hold one population of 40, got 20"):
        drive_each(vector, "sapso", evaluations=20)
    for other in (gym.make("posefit/Configure-v0"), gym.make("CartPole-v1"), gym.make_vec("posefit/Configure-v0", 2)):
        with pytest.raises(error.Error, match="env must be posefit/FitImage-v0 or FitState-v0, got"):
            drive(other, "sapso")


@each("version", ["posefit/FitImage-v0", "posefit/FitState-v0", "posefit/Track-v0", "posefit/Configure-v0"])
def test_a_reset_gives_each_environment_its_instance(version: str) -> None:
    vector = gym.make_vec(version, num_envs=3)
    for chosen, wanted in (([5, 6, 7], [5, 6, 7]), (np.array([7, 6, 5]), [7, 6, 5]), (9, [9, 9, 9])):
        assert vector.reset(seed=0, options={"instance": chosen})[1]["instance"].tolist() == wanted
    mask = np.array([False, True, False])
    infos = vector.reset(options={"instance": [1, 2, 3], "reset_mask": mask})[1]
    assert infos["instance"][1] == 2
    assert infos["_instance"].tolist() == mask.tolist()


@each(
    ("chosen", "message"),
    [
        ([1, 2], r"instance must be one number or 3, one for each environment, got \[1, 2\]"),
        ([1, [2], 3], r"instance must be a whole number from 0 to 19999, got \[2\]"),
        (np.zeros((3, 1)), r"instance must be one number or 3, one for each environment, got array"),
        ([1, 2, 30_000], "instance must lie in 0 to 19999, got 30000"),
        ([1, 2.5, 3], "instance must be a whole number from 0 to 19999, got 2.5"),
        ("all", "instance must be a whole number from 0 to 19999, got 'all'"),
    ],
)
def test_a_choice_of_instances_that_makes_no_sense_is_named_and_changes_nothing(chosen: Any, message: str) -> None:
    vector = gym.make_vec("posefit/FitState-v0", num_envs=3)
    vector.reset(seed=0, options={"instance": 4})
    with pytest.raises(error.Error, match=message):
        vector.reset(options={"instance": chosen})
    assert vector.step(np.zeros((3, 10)))[4]["instance"].tolist() == [4, 4, 4]


@pytest.fixture(scope="module")
def env() -> gym.Env[np.ndarray, np.ndarray]:
    made: gym.Env[np.ndarray, np.ndarray] = gym.make(
        "posefit/Track-v0", instance=17, frames=4, evaluations_per_frame=400
    )
    made.reset(seed=0)
    return made


def test_its_rows_are_what_a_step_says_that_commits(env: gym.Env[np.ndarray, np.ndarray]) -> None:
    rows = track_reference(env)
    assert [row["committed_frame"] for row in rows] == [0, 1, 2, 3]
    followed = env.unwrapped
    assert isinstance(followed, TrackEnv)
    for _ in range(400):
        info = env.step(np.zeros(env.action_space.shape or ()))[-1]
    assert set(rows[0]) == {name for name in info if name.startswith("committed_")}
    assert rows[0]["committed_error_degrees"] == followed.instance.errors(0, rows[0]["committed_pose"])["error_degrees"]


def test_exemplars_of_the_same_kind_are_nearer_than_the_middle_of_the_box(
    env: gym.Env[np.ndarray, np.ndarray],
) -> None:
    env.reset(seed=0)
    found = np.mean([row["committed_mpjpe_mm"] for row in track_reference(env, "exemplars")])
    still = []
    for _ in range(4 * 400):
        info = env.step(np.zeros(env.action_space.shape or ()))[-1]
        still += [info["committed_mpjpe_mm"]] if "committed_mpjpe_mm" in info else []
    assert len(still) == 4
    assert found < 0.5 * np.mean(still)


def test_a_tracker_learns_from_what_it_is_told_and_has_its_settings(env: gym.Env[np.ndarray, np.ndarray]) -> None:
    env.reset(seed=0)
    told = track_reference(env, "exemplars", train=["walk-b"], lag=0)
    assert not np.array_equal(told[0]["committed_pose"], track_reference(env, "exemplars")[0]["committed_pose"])
    assert np.array_equal(told[0]["committed_pose"], track_reference(env, train=["walk-b"], lag=0)[0]["committed_pose"])


def test_mistakes_of_a_reference_are_named(env: gym.Env[np.ndarray, np.ndarray]) -> None:
    env.reset(seed=0)
    with pytest.raises(ValueError, match="method must be .*one of exemplars, .*did you mean 'exemplars'"):
        track_reference(env, "exemplar")
    with pytest.raises(ValueError, match="a setting of exemplars must be one of .*, got 'lags'"):
        track_reference(env, lags=3)
    with pytest.raises(gym.error.Error, match="env must be posefit/Track-v0, got FitImageEnv"):
        track_reference(gym.make("posefit/FitImage-v0"))
    with pytest.raises(gym.error.ResetNeeded):
        track_reference(gym.make("posefit/Track-v0").unwrapped)
