"""Corrections of the best proposal: what an agent sees and does, in every mode."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import error
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from posefit_envs import Corrections, drive, trained_policy
from posefit_envs.corrections import BLOCK, MOST_FAILURES, REACH
from posefit_envs.policies import TRAINED, rollout
from posefit_envs.world import ArgumentError
from tests.cases import each

FIT = "posefit_envs:posefit/FitImage-v1"
COUNT = 3
PROPOSALS = 4
PIXELS = 64 * 48 // BLOCK**2
DIMENSIONS = 9


def native(mode: str = "NextStep", **arguments: Any) -> Any:
    arguments = {"max_evaluations": PROPOSALS} | arguments
    return gym.make_vec(FIT, COUNT, autoreset_mode=mode, **arguments)


def sync(**arguments: Any) -> Any:
    arguments = {"max_evaluations": PROPOSALS} | arguments
    return SyncVectorEnv([lambda: gym.make(FIT, **arguments)] * COUNT)


def actions_of(step: int) -> Any:
    rng = np.random.default_rng(step)
    return rng.uniform(-1.0, 1.0, (COUNT, DIMENSIONS))


def split(observations: Any) -> tuple[Any, ...]:
    """Return silhouettes, differences, best proposals, whether first, failures."""
    return (
        observations[:, :PIXELS],
        observations[:, PIXELS : 2 * PIXELS],
        observations[:, 2 * PIXELS : -2],
        observations[:, -2],
        observations[:, -1],
    )


@each("yaw", ["guessed", "unknown"])
def test_an_agent_sees_the_best_proposal_and_corrects_it(yaw: str) -> None:
    env = Corrections(native(yaw=yaw, max_evaluations=9))
    raw = native(yaw=yaw, max_evaluations=9)
    observations, infos = env.reset(seed=5)
    pictures, _ = raw.reset(seed=5)
    best = np.zeros((COUNT, DIMENSIONS))
    best_costs = np.full(COUNT, np.inf)
    failures = np.zeros(COUNT)
    best_pictures = np.zeros((COUNT, 48, 64))
    for step in range(9):
        silhouettes, differences, proposals, first, in_vain = split(observations)
        means = pictures[..., 0].reshape(COUNT, 12, 4, 16, 4).mean(axis=(2, 4)) / 255.0
        drawn = best_pictures.reshape(COUNT, 12, 4, 16, 4).mean(axis=(2, 4)) / 255.0
        assert silhouettes == pytest.approx(means.reshape(COUNT, -1), abs=1e-6)
        assert differences == pytest.approx(
            (means - drawn).reshape(COUNT, -1), abs=1e-6
        )
        assert proposals == pytest.approx(best, abs=1e-6)
        assert (first == (step == 0)).all()
        assert in_vain == pytest.approx(np.minimum(failures, MOST_FAILURES) / 4)
        assert env.single_observation_space.contains(observations[0])
        actions = actions_of(step)
        reach = np.where(first == 1.0, 1.0, REACH * 0.5**failures)
        proposed = best + reach[:, None] * actions
        if yaw == "unknown":
            proposed[:, 0] = (proposed[:, 0] + 1.0) % 2.0 - 1.0
        proposed = np.clip(proposed, -1.0, 1.0)
        observations, rewards, *_, infos = env.step(actions)
        pictures, expected, *_ = raw.step(proposed)
        assert np.array_equal(rewards, expected)
        better = infos["cost"] < best_costs
        best[better] = proposed[better]
        best_costs[better] = infos["cost"][better]
        best_pictures[better] = pictures[better, ..., 1]
        failures = np.where(better, 0, failures + 1)
    assert failures.max() > 0, "a correction in vain must be among those tried"
    assert infos["best_cost"] == pytest.approx(best_costs)


def test_every_form_and_mode_gives_the_same_episodes() -> None:
    seen = []
    for env in (Corrections(native()), Corrections(sync())):
        rows = [env.reset(seed=7)[0]]
        for step in range(2 * PROPOSALS + 2):
            observations, rewards, *_ = env.step(actions_of(step))
            rows += [observations, rewards]
        seen.append(rows)
    for ours, theirs in zip(*seen, strict=True):
        assert np.array_equal(ours, theirs)
    disabled = Corrections(native("Disabled"))
    rows = [disabled.reset(seed=7)[0]]
    for step in range(PROPOSALS):
        observations, rewards, *_ = disabled.step(actions_of(step))
        rows += [observations, rewards]
    for ours, theirs in zip(rows, seen[0], strict=False):
        assert np.array_equal(ours, theirs)
    mask = np.array([True, False, True])
    again, _ = disabled.reset(options={"reset_mask": mask})
    assert np.array_equal(again[1], observations[1])
    assert (split(again)[3] == mask).all()


def test_what_cannot_be_corrected_is_refused() -> None:
    for env, message in (
        (native(AutoresetMode.SAME_STEP.value), "must be NextStep or Disabled"),
        (native(size=(66, 48)), "sizes must be divisible by 4"),
        (gym.make_vec("posefit/Race-v1", 2), "env must be posefit/FitImage-v1"),
    ):
        with pytest.raises(error.Error, match=message):
            Corrections(env)
    with pytest.raises(error.Error, match="got Corrections: drive the environment"):
        drive(Corrections(native()), "sapso")


@each("name", sorted(path.stem for path in TRAINED.glob("*.npz")))
def test_a_trained_policy_is_better_than_a_blind_search_and_has_a_card(
    name: str,
) -> None:
    card = (TRAINED / f"{name}.md").read_text("utf-8")
    assert "python docs/studies/agents.py" in card
    assert (TRAINED / f"{name}.npz").stat().st_size < 1_000_000
    level = card.partition("posefit/")[2].partition("`")[0]
    env = gym.make_vec(f"posefit/{level}", 40, split="test")
    numbers = list(range(10_000, 10_040))
    rows = rollout(Corrections(env), trained_policy(name), numbers, seed=0)
    found = np.mean([row["best_cost"] for row in rows])
    single = gym.make(f"posefit/{level}", split="test")
    blind = [drive(single, instance=number, evaluations=80) for number in numbers[:12]]
    assert found < np.mean([problem.best_cost for problem in blind])


def test_an_unknown_policy_is_named() -> None:
    with pytest.raises(ArgumentError, match="name must be one of fit-image"):
        trained_policy("fit-picture")
