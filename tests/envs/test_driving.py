"""Optimisers search one environment or many, whatever the size of a population and the end of an episode."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import error

from posefit import minimise
from posefit.registry import registry
from posefit.settings import planned
from posefit_envs import drive, drive_each
from posefit_envs.instance import instance, select


def alone(name: str, number: int, seed: int, evaluations: int) -> Any:
    """Return what the library finds without an environment."""
    world, factory = select().world, registry().optimiser(name)
    made = instance(world, number, 1, evaluations)
    space = made.space(world.learned)
    searching = factory(space, np.random.default_rng(seed), **planned(factory, {}, evaluations))
    return minimise(made.scenery(0).problem(space).evaluate, searching, evaluations)


@pytest.mark.parametrize("version", ["posefit/Fit-v0", "posefit/Fit-v1"])
@pytest.mark.parametrize("name", ["sapso", "cma"])  # populations of 40 and of 10, neither a multiple of 7
def test_any_population_on_any_number_of_environments_is_the_library_bit_for_bit(version: str, name: str) -> None:
    wanted = alone(name, 3, 5, 400)
    ends: dict[str, Any] = {"instance": 3, "max_evaluations": 13}
    if version.endswith("v0"):
        ends["target_cost"] = 20.0  # which is reached long before the budget's end
    for env in (gym.make(version, **ends), gym.make_vec(version, num_envs=7, **ends)):
        found = drive(env, name, seed=5, evaluations=400)
        np.testing.assert_array_equal(found.history, wanted.history)
        np.testing.assert_array_equal(found.proposal, wanted.proposal)


def test_each_environment_has_its_instance_and_its_search() -> None:
    vector = gym.make_vec("posefit/Fit-v1", num_envs=3, max_evaluations=50)
    found = drive_each(vector, "cma", seed=5, instances=[3, 4, 3], evaluations=200)
    for one, (number, seed) in zip(found, ((3, 5), (4, 6), (3, 7)), strict=True):
        wanted = alone("cma", number, seed, 200)
        np.testing.assert_array_equal(one.history, wanted.history)
        np.testing.assert_array_equal(one.proposal, wanted.proposal)
        assert one.evaluations == wanted.evaluations


def test_what_does_not_fit_is_said_in_one_line() -> None:
    vector = gym.make_vec("posefit/Fit-v1", num_envs=3)
    with pytest.raises(error.Error, match=r"instance must be the same in all environments, got \[.*\]: use drive_each"):
        drive(vector, "sapso")
    with pytest.raises(error.Error, match="evaluations must hold one population of 40, got 20"):
        drive_each(vector, "sapso", evaluations=20)
    for other in (gym.make("posefit/Configure-v1"), gym.make("CartPole-v1"), gym.make_vec("posefit/Configure-v1", 2)):
        with pytest.raises(error.Error, match="env must be posefit/Fit-v0 or Fit-v1, got"):
            drive(other, "sapso")


@pytest.mark.parametrize(
    "version", ["posefit/Fit-v0", "posefit/Fit-v1", "posefit/Configure-v0", "posefit/Configure-v1"]
)
def test_a_reset_gives_each_environment_its_instance(version: str) -> None:
    vector = gym.make_vec(version, num_envs=3)
    for chosen, wanted in (([5, 6, 7], [5, 6, 7]), (np.array([7, 6, 5]), [7, 6, 5]), (9, [9, 9, 9])):
        assert vector.reset(seed=0, options={"instance": chosen})[1]["instance"].tolist() == wanted
    mask = np.array([False, True, False])
    infos = vector.reset(options={"instance": [1, 2, 3], "reset_mask": mask})[1]
    assert infos["instance"][1] == 2
    assert infos["_instance"].tolist() == mask.tolist()


@pytest.mark.parametrize(
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
    vector = gym.make_vec("posefit/Fit-v1", num_envs=3)
    vector.reset(seed=0, options={"instance": 4})
    with pytest.raises(error.Error, match=message):
        vector.reset(options={"instance": chosen})
    assert vector.step(np.zeros((3, 10)))[4]["instance"].tolist() == [4, 4, 4]
