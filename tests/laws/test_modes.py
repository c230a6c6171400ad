"""Episodes are the same in every autoreset mode and form: single, native vector, Gymnasium's Sync and Async."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import product
from multiprocessing import set_forkserver_preload
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import error
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import DictInfoToList

import posefit_envs  # noqa: F401, registers them
from posefit import minimise
from posefit.registry import registry
from posefit.settings import planned
from posefit_envs import drive, drive_each, to_sb3_vec_env
from posefit_envs.policies import rollout
from posefit_envs.rows import VectorRows
from posefit_envs.world import first_problem, world_of

MODES = list(AutoresetMode)
NAMES: dict[str, dict[str, Any]] = {
    "posefit/FitImage-v1": {"max_evaluations": 3},
    "posefit/Track-v1": {"frames": 2, "evaluations_per_frame": 2},
    "posefit/Race-v1": {"searches": 2, "generations": (2, 4)},
}
FIT = "posefit/FitImage-v1"
COUNT = 2
EPISODES = 3
SEED = 5
# Async starts processes: one environment of the three is enough
FORMS = [
    *product(["native", "sync"], MODES, NAMES),
    *product(["async"], MODES, [FIT]),
]
IDS = [f"{form}-{mode.value}-{name[8:-3]}" for form, mode, name in FORMS]
FIT_FORMS = [("native", mode) for mode in MODES]
FIT_FORMS += [("sync", mode) for mode in MODES]
FIT_FORMS += [("async", AutoresetMode.SAME_STEP)]


@contextmanager
def made(form: str, mode: AutoresetMode, name: str, **arguments: Any) -> Iterator[Any]:
    """Yield a vector of two environments in some form and mode."""
    arguments = {**NAMES[name], **arguments}
    if form == "native":
        vector = gym.make_vec(name, COUNT, autoreset_mode=mode, **arguments)
    else:
        options: dict[str, Any] = {"autoreset_mode": mode}
        if form == "async":
            # the workers are forked from a process that has imported the environments and has no threads
            set_forkserver_preload(["posefit_envs.fit"])
            options["context"] = "forkserver"
        vector = gym.make_vec(name, COUNT, form, options, **arguments)
    try:
        yield vector
    finally:
        vector.close()


def action_of(shape: tuple[int, ...], i: int, step: int) -> Any:
    """Return what environment i does in a step of an episode."""
    return np.random.default_rng([i, step]).uniform(-1.0, 1.0, shape)


def episodes_alone(name: str) -> list[list[Any]]:
    """Return the episodes of single environments: the first observation, and each step's observation and reward."""
    episodes = []
    for i in range(COUNT):
        env = gym.make(name, **NAMES[name])
        own = []
        for episode in range(EPISODES):
            seed = SEED + i if episode == 0 else None
            steps: list[Any] = [env.reset(seed=seed)[0]]
            ended = False
            while not ended:
                action = action_of(env.action_space.shape, i, len(steps))
                observation, reward, terminated, truncated, _ = env.step(action)
                steps.append((observation, float(reward)))
                ended = terminated or truncated
            own.append(steps)
        episodes.append(own)
    return episodes


def episodes_of(vector: Any, mode: AutoresetMode) -> list[list[Any]]:
    """Return the same of a vector that is stepped as Gymnasium's page on autoreset modes says."""
    episodes: list[list[Any]] = [[] for _ in range(COUNT)]
    observations, _ = vector.reset(seed=SEED)
    current: list[list[Any]] = [[observations[i].copy()] for i in range(COUNT)]
    begins = np.zeros(COUNT, dtype=bool)  # by NEXT_STEP: this step only resets
    while min(len(own) for own in episodes) < EPISODES:
        shape = vector.single_action_space.shape
        actions = [action_of(shape, i, len(current[i])) for i in range(COUNT)]
        stepped = vector.step(np.array(actions))
        observations, rewards, terminated, truncated, infos = stepped
        ended = terminated | truncated
        for i in range(COUNT):
            if begins[i]:
                current[i] = [observations[i].copy()]
                continue
            last = observations[i].copy()
            if mode is AutoresetMode.SAME_STEP and ended[i]:
                last = infos["final_obs"][i]
            current[i].append((last, float(rewards[i])))
            if ended[i]:
                episodes[i].append(current[i])
        begins = ended & (mode is AutoresetMode.NEXT_STEP)
        if mode is AutoresetMode.DISABLED and ended.any():
            observations, _ = vector.reset(options={"reset_mask": ended})
        if mode is not AutoresetMode.NEXT_STEP:
            for i in np.flatnonzero(ended):
                current[i] = [observations[i].copy()]
    return [own[:EPISODES] for own in episodes]


@pytest.mark.parametrize(("form", "mode", "name"), FORMS, ids=IDS)
def test_seeds_give_the_same_episodes(
    form: str, mode: AutoresetMode, name: str
) -> None:
    with made(form, mode, name) as vector:
        assert vector.metadata["autoreset_mode"] is mode
        assert vector.unwrapped.autoreset_mode is mode
        assert data_equivalence(episodes_of(vector, mode), episodes_alone(name))


def alone(number: int, seed: int) -> Any:
    """Return the problem of an instance, minimised by CMA-ES without an environment."""
    problem = first_problem(world_of(), number)
    problem.budget = 50
    factory = registry().optimiser("cma")
    rng = np.random.default_rng(seed)
    return minimise(problem, factory(problem.space, rng, **planned(factory, {}, 50)))


@pytest.mark.parametrize(("form", "mode"), FIT_FORMS)
def test_a_driven_search_is_the_library_s(form: str, mode: AutoresetMode) -> None:
    with made(form, mode, FIT) as vector:
        searched = [drive(vector, "cma", seed=5, instance=3, evaluations=50)]
        searched += drive_each(vector, "cma", seed=5, instances=[3, 4], evaluations=50)
    for problem, expected in zip(
        searched, (alone(3, 5), alone(3, 5), alone(4, 6)), strict=True
    ):
        assert data_equivalence(problem.trace, expected.trace)
        assert np.array_equal(problem.best, expected.best)
        assert problem.evaluations == expected.evaluations


def test_a_single_environment_is_driven_as_the_library() -> None:
    problem = drive(
        gym.make(FIT, max_evaluations=3), "cma", seed=5, instance=3, evaluations=50
    )
    assert data_equivalence(problem.trace, alone(3, 5).trace)


@pytest.mark.parametrize(("form", "mode"), FIT_FORMS)
def test_a_rollout_has_every_step_of_each_environments_episode(
    form: str, mode: AutoresetMode
) -> None:
    singles = []
    for i, number in enumerate((3, 4)):
        env = gym.make(FIT, **NAMES[FIT])
        policy = _policy_of(env.action_space.shape, i)
        singles.append(rollout(env, policy, np.int64(number), SEED + i))
    with made(form, mode, FIT) as vector:
        policies = [
            _policy_of(vector.single_action_space.shape, i) for i in range(COUNT)
        ]
        rows = rollout(
            vector,
            lambda pictures, step: np.array(
                [policies[i](pictures[i], step) for i in range(COUNT)]
            ),
            [3, 4],
            SEED,
        )
    for row, single in zip(rows, singles, strict=True):
        assert row.keys() >= single.keys()
        assert data_equivalence({name: row[name] for name in single}, single)
        assert len(row["rewards"]) == NAMES[FIT]["max_evaluations"]


def _policy_of(shape: Any, i: int) -> Callable[[Any, int], Any]:
    def policy(picture: Any, step: int) -> Any:
        return action_of(shape, i, step) * picture.mean() / 255.0

    return policy


def test_a_rollout_of_episodes_of_several_lengths_keeps_each() -> None:
    name = "posefit/Race-v1"
    expected = []
    for i in range(COUNT):
        env = gym.make(name, searches=2, generations=(2, 9))
        expected.append(rollout(env, lambda _, step: action_of((3,), 0, step), 3, i))
    lengths = {len(row["rewards"]) for row in expected}
    for mode in MODES:
        with made("native", mode, name, generations=(2, 9)) as vector:
            rows = rollout(
                vector, lambda _, step: np.array([action_of((3,), 0, step)] * 2), 3, 0
            )
        for row, single in zip(rows, expected, strict=True):
            assert np.array_equal(row["rewards"], single["rewards"])
    assert len(lengths) == COUNT, "seeds whose episodes are as long try nothing"


@pytest.mark.parametrize(("form", "mode"), FIT_FORMS)
def test_each_row_resets_with_its_own_options(form: str, mode: AutoresetMode) -> None:
    singles = [gym.make(FIT, **NAMES[FIT]) for _ in range(COUNT)]
    with made(form, mode, FIT) as vector:
        rows = VectorRows(vector)
        for seeds, numbers in (([5, 6], [17, 4]), (None, [4, 17]), ([7, None], [3, 3])):
            options = [{"instance": number} for number in numbers]
            observations, infos = rows.reset(seeds, options)
            for i, single in enumerate(singles):
                seed = None if seeds is None else seeds[i]
                expected = single.reset(seed=seed, options=options[i])
                assert data_equivalence((observations[i], infos[i]), expected)


@pytest.mark.parametrize(("form", "mode"), FIT_FORMS)
def test_stable_baselines3_sees_each_environments_episodes_options_and_attributes(
    form: str, mode: AutoresetMode
) -> None:
    vec_env = pytest.importorskip(
        "stable_baselines3.common.vec_env", reason="needs posefit[rl]"
    )
    dummy = vec_env.DummyVecEnv([lambda: gym.make(FIT, **NAMES[FIT])] * COUNT)
    with made(form, mode, FIT) as vector:
        adapted = to_sb3_vec_env(vector)
        for env in (dummy, adapted):
            env.seed(3)
            env.set_options([{"instance": 17}, {"instance": 4}])
        assert np.array_equal(adapted.reset(), dummy.reset())
        assert data_equivalence(adapted.reset_infos, dummy.reset_infos)
        for step in range(7):
            actions = np.array([action_of((9,), i, step) for i in range(COUNT)])
            ours = adapted.step(actions)
            theirs = dummy.step(actions)
            assert data_equivalence(ours[:3], theirs[:3])
            for row, single in zip(ours[3], theirs[3], strict=True):
                assert data_equivalence({key: row[key] for key in single}, single)
        for name in ("np_random_seed", "action_space", "number"):
            for indices in (None, [1], [1, 0]):
                assert adapted.get_attr(name, indices) == dummy.get_attr(name, indices)
        if form != "async":
            for ours, theirs in zip(
                adapted.get_attr("instance"), dummy.get_attr("instance"), strict=True
            ):
                assert ours.number == theirs.number


def test_proposals_that_a_wrapper_changes_are_not_driven() -> None:
    single = gym.make(FIT)
    scaled = gym.wrappers.RescaleAction(single, np.float32(0.0), np.float32(1.0))
    vector = gym.make_vec(FIT, 2)
    vectors = gym.wrappers.vector.RescaleAction(vector, np.float32(0), np.float32(1))
    for env in (scaled, vectors):
        with pytest.raises(
            error.Error, match="env must take proposals as they are, got RescaleAction"
        ):
            drive(env, "cma")
    zero = np.float32(0.0)
    half = np.float32(0.5)
    inner = gym.vector.SyncVectorEnv(
        [lambda: gym.wrappers.RescaleAction(gym.make(FIT), zero, half)] * 2
    )
    with pytest.raises(error.Error, match="actions in Box"):
        drive(inner, "cma")
    # others change nothing of a proposal
    counted = gym.wrappers.vector.RecordEpisodeStatistics(vector)
    problem = drive(counted, "cma", seed=5, instance=3, evaluations=50)
    assert data_equivalence(problem.trace, alone(3, 5).trace)


def test_an_unknown_argument_is_named_in_the_words_that_libraries_look_for() -> None:
    for make in (
        lambda: gym.make(FIT, colour="red"),
        lambda: gym.make_vec(FIT, 2, colour="red"),
    ):
        with pytest.raises(TypeError, match="unexpected keyword argument.*'colour'"):
            make()


# what tells of the answer
TRUTHS = {
    "truth",
    "error_degrees",
    "committed_error_degrees",
    "committed_mpjpe_mm",
}
ENDS = {"final_obs", "final_info"}


def rows_of_infos(
    vector: Any, mode: AutoresetMode, steps: int
) -> list[list[dict[str, Any]]]:
    """Return the infos of a reset and of steps of each environment, last ones too."""
    shown = DictInfoToList(vector)
    rows = [[info] for info in shown.reset(seed=SEED)[1]]
    for step in range(steps):
        shape = vector.single_action_space.shape
        actions = [action_of(shape, i, step) for i in range(COUNT)]
        _, _, terminated, truncated, infos = shown.step(np.array(actions))
        ended = terminated | truncated
        for i, info in enumerate(infos):
            rows[i].append({key: info[key] for key in info.keys() - ENDS})
            if "final_info" in info:
                rows[i].append(info["final_info"])
        if mode is AutoresetMode.DISABLED and ended.any():
            begun = shown.reset(options={"reset_mask": ended})[1]
            for i in np.flatnonzero(ended).tolist():
                rows[i].append(begun[i])
    return rows


@pytest.mark.parametrize(("form", "mode", "name"), FORMS, ids=IDS)
def test_a_reset_and_every_step_have_the_same_infos(
    form: str, mode: AutoresetMode, name: str
) -> None:
    with made(form, mode, name) as vector:
        for infos in rows_of_infos(vector, mode, 8):
            assert {frozenset(info) for info in infos} == {frozenset(infos[0])}
            assert "remaining_steps" in infos[0]


@pytest.mark.parametrize(("form", "mode", "name"), FORMS, ids=IDS)
def test_infos_of_the_test_hold_nothing_of_the_truth_unless_they_evaluate(
    form: str, mode: AutoresetMode, name: str
) -> None:
    with made(form, mode, name) as vector:
        trained = rows_of_infos(vector, mode, 1)[0][0]
    with made(form, mode, name, split="test") as vector:
        for infos in rows_of_infos(vector, mode, 6):
            assert all(TRUTHS.isdisjoint(info) for info in infos)
    with made(form, mode, name, split="test", evaluate=True) as vector:
        evaluated = rows_of_infos(vector, mode, 1)[0][0]
    assert evaluated.keys() == trained.keys()
    assert not TRUTHS.isdisjoint(trained)


@pytest.mark.parametrize(("form", "mode", "name"), FORMS, ids=IDS)
def test_the_own_end_terminates_and_a_time_limit_alone_truncates(
    form: str, mode: AutoresetMode, name: str
) -> None:
    arguments: dict[str, Any] = {}
    if "Race" in name:
        arguments["generations"] = (3, 3)
    for limit in (None, 2):
        with made(form, mode, name, max_episode_steps=limit, **arguments) as vector:
            _, infos = vector.reset(seed=SEED)
            left = int(infos["remaining_steps"][0])
            zeros = np.zeros(vector.action_space.shape)
            for step in range(1, 1 + (limit or left)):
                _, _, terminated, truncated, infos = vector.step(zeros)
                assert terminated.all() == (step == left)
                assert truncated.all() == (step == limit)
                if not (terminated | truncated).any():
                    assert infos["remaining_steps"].tolist() == [left - step] * COUNT


# Gymnasium's Async reports an error of its processes in other words
@pytest.mark.parametrize(("form", "name"), [*product(["native", "sync"], NAMES)])
def test_a_split_refuses_the_numbers_of_the_other(form: str, name: str) -> None:
    for split, number, last in (("train", 10_000, 9_999), ("test", 9_999, 19_999)):
        message = (
            f"instance must lie in .* to {last} with split='{split}', got {number}"
        )
        with (
            made(form, AutoresetMode.NEXT_STEP, name, split=split) as vector,
            pytest.raises((error.Error, ValueError), match=message),
        ):
            vector.reset(options={"instance": number})
        with pytest.raises(error.Error, match=message):
            gym.make(name, split=split, instance=number)
