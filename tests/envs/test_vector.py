"""Vector environments do what single ones do; optimisers and agents run on them."""

import copy
import subprocess
import sys
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import error
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import posefit_envs
from posefit_envs import to_sb3_vec_env
from tests.cases import each

FIT: list[dict[str, Any]] = [
    {},
    {"instance": 3},
    {"yaw": "unknown", "translation": "searched"},
    {"motion": "all", "held_out_people": True, "max_evaluations": 1},
    {"view_degrees": [0.0, 90.0], "translation": "aligned", "max_evaluations": 5},
    {
        "mismatch_percent": 10.0,
        "view_degrees": [0.0, 90.0, 200.0],
        "prior": "full",
        "max_evaluations": 7,
    },
    {
        "translation": "aligned",
        "mismatch_percent": 10.0,
        "noise": {"jitter": 0.8},
        "max_evaluations": 6,
    },
    {
        "motion": "run",
        "split": "test",
        "size": (36, 36),
        "errors": False,
        "max_evaluations": 5,
    },
]
TRACK: list[dict[str, Any]] = [
    {"frames": 3, "evaluations_per_frame": 4},
    {
        "frames": 2,
        "evaluations_per_frame": 5,
        "translation": "aligned",
        "view_degrees": [0.0, 70.0],
    },
    {
        "frames": 3,
        "evaluations_per_frame": 3,
        "translation": "searched",
        "mismatch_percent": 10.0,
        "prior": "full",
    },
    {
        "frames": 2,
        "evaluations_per_frame": 2,
        "noise": {"holes": 0.4, "blobs": 0.4},
        "errors": False,
    },
]
RACE: list[dict[str, Any]] = [
    {
        "searches": 3,
        "generations": (4, 9),
        "translation": "aligned",
        "mismatch_percent": 8.0,
    },
    {
        "population_size": 3,
        "generations": (1, 6),
        "prior": "full",
        "translation": "searched",
        "errors": False,
    },
    {
        "searches": 2,
        "generations": (30, 30),
        "view_degrees": [0.0, 90.0],
        "optimiser": "cma",
    },
]
CASES = {"posefit/FitImage-v1": FIT, "posefit/Track-v1": TRACK, "posefit/Race-v1": RACE}
SHORT: dict[str, dict[str, Any]] = {
    "posefit/FitImage-v1": {"max_evaluations": 5},
    "posefit/Track-v1": {"frames": 2, "evaluations_per_frame": 2},
    "posefit/Race-v1": {"searches": 2, "generations": (2, 6)},
}


def resets_as_gymnasiums(
    name: str, mode: AutoresetMode, limit: int | None, arguments: dict[str, Any]
) -> int:
    """Check that a vector does to the last bit what Gymnasium's own does with single ones; return how often it ends.

    Neither changes what it has returned before.
    """
    native = gym.make_vec(
        name, 3, max_episode_steps=limit, autoreset_mode=mode, **arguments
    )
    sync = gym.make_vec(
        name, 3, "sync", {"autoreset_mode": mode}, max_episode_steps=limit, **arguments
    )
    assert type(native.unwrapped).__module__.startswith("posefit_envs")
    assert native.metadata["autoreset_mode"] is mode
    assert native.single_observation_space == sync.single_observation_space
    assert native.single_action_space == sync.single_action_space
    ours = native.reset(seed=[5, 40, 5])
    theirs = sync.reset(seed=[5, 40, 5])
    ends = 0
    assert data_equivalence(ours, theirs)
    sync.action_space.seed(1)
    for _ in range(30):
        actions = sync.action_space.sample()
        before = ours
        copied = copy.deepcopy(ours)
        ours = native.step(actions)
        theirs = sync.step(actions)
        assert ours[0] in native.observation_space
        assert data_equivalence(before[:4], copied[:4])
        assert data_equivalence(ours, theirs)
        assert native.np_random_seed == sync.np_random_seed == (5, 40, 5)
        ends += int(np.count_nonzero(theirs[2] | theirs[3]))
    for mask in ([False, True, False], [True, False, True]):
        # those that go on show the observation from before
        assert data_equivalence(
            *(
                vector.reset(options={"reset_mask": np.array(mask)})
                for vector in (native, sync)
            )
        )
    # a later reset without a seed goes on with the generators
    for seed in (None, [None, 8, None], 70):
        assert data_equivalence(native.reset(seed=seed), sync.reset(seed=seed))  # type: ignore[arg-type]
        assert native.np_random_seed == sync.np_random_seed
    states = [
        [rng.bit_generator.state for rng in vector.np_random]
        for vector in (native, sync)
    ]
    assert states[0] == states[1]
    return ends


@each(
    ("name", "arguments"),
    [(name, arguments) for name, many in CASES.items() for arguments in many],
)
def test_a_vector_environment_equals_single_ones(
    name: str, arguments: dict[str, Any]
) -> None:
    resets_as_gymnasiums(name, AutoresetMode.NEXT_STEP, None, arguments)


@each("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@each(("name", "limit"), [(name, limit) for name in CASES for limit in (3, 7)])
def test_ends_and_time_limits_reset_it_as_in_gymnasium(
    name: str, limit: int, mode: AutoresetMode
) -> None:
    assert resets_as_gymnasiums(name, mode, limit, CASES[name][-1] | SHORT[name]) > 3


def test_neither_threads_nor_neighbours_change_a_row() -> None:
    # environments 0 to 2 of 50 are those of three: their seeds are the same, and so are their actions
    for name in CASES:
        few, many, threaded = (
            gym.make_vec(name, n, threads=k) for n, k in ((3, 1), (50, 1), (50, 3))
        )
        first = few.reset(seed=11)[0]
        for vector in (many, threaded):
            np.testing.assert_array_equal(first, vector.reset(seed=11)[0][:3])
        for _ in range(2):
            actions = many.action_space.sample()
            rows = few.step(actions[:3])[:4]
            for first, own, other in zip(
                rows, many.step(actions), threaded.step(actions), strict=False
            ):
                np.testing.assert_array_equal(first, own[:3])
                np.testing.assert_array_equal(own, other)
    with pytest.raises(error.Error, match="threads must be at least 1, got 0"):
        gym.make_vec("posefit/FitImage-v1", num_envs=2, threads=0)


@each("name", CASES)
def test_a_reset_gives_each_environment_its_instance(name: str) -> None:
    vector = gym.make_vec(name, num_envs=3)
    for chosen, expected in (
        ([5, 6, 7], [5, 6, 7]),
        (np.array([7, 6, 5]), [7, 6, 5]),
        (9, [9, 9, 9]),
    ):
        assert (
            vector.reset(seed=0, options={"instance": chosen})[1]["instance"].tolist()
            == expected
        )
    mask = np.array([False, True, False])
    infos = vector.reset(options={"instance": [1, 2, 3], "reset_mask": mask})[1]
    assert infos["instance"][1] == 2
    assert infos["_instance"].tolist() == mask.tolist()


@each(
    "mask",
    [
        [True, False, False],
        np.array([1, 0, 0]),
        np.array([True, False]),
        np.zeros(3, dtype=bool),
    ],
)
def test_a_wrong_reset_mask_raises_the_same_error_as_gymnasiums_vectors(
    mask: Any,
) -> None:
    name = "posefit/FitImage-v1"
    raised = []
    for vector in (gym.make_vec(name, 3), gym.make_vec(name, 3, "sync")):
        vector.reset(seed=0)
        # Gymnasium asserted until 1.3
        with pytest.raises((TypeError, ValueError, AssertionError)) as caught:
            vector.reset(options={"reset_mask": mask})
        raised.append(caught)
    ours, theirs = raised
    assert isinstance(ours.value, TypeError | ValueError)
    assert isinstance(ours.value, theirs.type) or theirs.type is AssertionError


@each("name", CASES)
def test_by_disabled_the_caller_resets_what_has_ended(name: str) -> None:
    vector = gym.make_vec(
        name, 3, autoreset_mode=AutoresetMode.DISABLED, max_episode_steps=2
    )
    vector.reset(seed=0)
    actions = vector.action_space.sample()
    vector.step(actions)
    assert vector.step(actions)[3].all()
    with pytest.raises(error.ResetNeeded, match="the episode has ended"):
        vector.step(actions)
    vector.reset(options={"reset_mask": np.array([True, False, True])})
    with pytest.raises(error.ResetNeeded, match=r"ended environments: \[1\]"):
        vector.step(actions)
    vector.reset(options={"reset_mask": np.array([False, True, False])})
    assert not vector.step(actions)[3].any()


@each("name", CASES)
def test_mistakes_are_named(name: str) -> None:
    vector = gym.make_vec(name, num_envs=3)
    with pytest.raises(error.ResetNeeded, match="reset must come before"):
        vector.step(np.zeros((3, 9)))
    with pytest.raises(
        error.Error, match="seed must be one number or 3 numbers, got 2"
    ):
        vector.reset(seed=[1, 2])
    with pytest.raises(error.ResetNeeded, match="the first reset must be of all"):
        vector.reset(options={"reset_mask": np.array([True, False, False])})
    vector.reset(seed=0)
    for chosen, message in (
        (
            [1, 2],
            r"instance must be one number or 3, one for each environment, got \[1, 2\]",
        ),
        (
            np.zeros((3, 1)),
            r"instance must be one number or 3, one for each environment, got array",
        ),
        ([1, 2, 30_000], "instance must lie in 0 to 19999, got 30000"),
    ):
        with pytest.raises(error.Error, match=message):
            vector.reset(options={"instance": chosen})
    with pytest.raises(
        error.InvalidAction, match=r"actions must have shape \(3, 9\), got \(2, 9\)"
    ):
        vector.step(np.zeros((2, 9)))
    with pytest.raises(error.InvalidAction, match="actions must be finite"):
        vector.step(np.full((3, 9), np.nan))
    with pytest.raises(
        error.Error,
        match="option of reset must be .* got 'reset_masks'; did you mean 'reset_mask'",
    ):
        vector.reset(options={"reset_masks": np.array([True, False, False])})
    with pytest.raises(
        error.Error,
        match="autoreset_mode must be one of NextStep, SameStep, Disabled, got 'same'",
    ):
        gym.make_vec(name, num_envs=3, autoreset_mode="same")
    with pytest.raises(error.Error, match="num_envs must be at least 1, got 0"):
        gym.make_vec(name, num_envs=0)
    for limit, message in (
        (0, "max_episode_steps must be at least 1, got 0"),
        (1.5, "max_episode_steps must be a whole number of at least 1, got 1.5"),
        ("9", "max_episode_steps must be a whole number of at least 1, got '9'"),
    ):
        with pytest.raises(error.Error, match=message):
            gym.make_vec(name, num_envs=3, max_episode_steps=limit)
    for seed, message in (
        (1.5, "seed must be a whole number of at least 0, got 1.5"),
        ("abc", "seed must be a whole number of at least 0, got 'abc'"),
        ([1, 2, -3], "seed must be 0 or more, got -3"),
        ([1, 2, True], "seed must be a whole number of at least 0, got True"),
    ):
        with pytest.raises(error.Error, match=message):
            vector.reset(seed=seed)
    with pytest.raises(TypeError, match="colour"):
        gym.make_vec(name, num_envs=3, colour="red")


@each("name", CASES)
def test_seeds_may_be_an_array(name: str) -> None:
    vector = gym.make_vec(name, num_envs=3)
    assert data_equivalence(
        vector.reset(seed=np.array([5, 40, 5])), vector.reset(seed=[5, 40, 5])
    )


@each(
    ("name", "arguments"),
    [
        ("posefit/FitImage-v1", {"max_evaluations": 3}),
        ("posefit/Track-v1", {"frames": 1, "evaluations_per_frame": 3}),
    ],
)
def test_stable_baselines3_gets_the_last_observation_of_an_episode(
    name: str, arguments: dict[str, Any]
) -> None:
    pytest.importorskip("stable_baselines3", reason="needs posefit[rl]")
    adapted = to_sb3_vec_env(gym.make_vec(name, num_envs=2, instance=3, **arguments))
    single = gym.make(name, instance=3, **arguments)
    first, _ = single.reset(seed=4)
    adapted.seed(4)
    adapted.reset()
    action = np.full(adapted.action_space.shape or (), 0.3, dtype=np.float32)
    for step in range(3):
        last, _, terminated, truncated, _ = single.step(action)
        observations, rewards, done, infos = adapted.step(np.stack([action, action]))
        assert done.tolist() == [step == 2] * 2
    assert rewards.shape == (2,)
    for i in range(2):
        assert infos[i]["TimeLimit.truncated"] is (truncated and not terminated)
        assert data_equivalence(infos[i]["terminal_observation"], last)
        # the instance is the same, so that a new episode begins as the first one did
        assert data_equivalence(observations[i], first)
    adapted.close()


def test_an_attribute_is_set_as_in_gymnasiums_own_vectors() -> None:
    vector = gym.make_vec("posefit/Race-v1", num_envs=3)
    plain = SyncVectorEnv([lambda: gym.make("posefit/Race-v1")] * 3)
    for values in ([1, 2, 3], ("a", "b", "c"), [[1], [2], [3]], 7, "abc", None):
        for each_vector in (vector, plain):
            each_vector.set_attr("note", values)
            assert each_vector.get_attr("note") == vector.get_attr("note")
    world = vector.get_attr("world")[0]
    vector.set_attr("world", [world] * 3)
    assert vector.get_attr("world") == (world,) * 3
    for name, values, wrong in (
        ("note", [1, 2], "values must be one for each of the 3 environments, got 2"),
        ("threads", [1, 2, 3], "threads must be the same in all environments"),
        ("number", 5, "number must be set by the options of reset"),
    ):
        with pytest.raises(error.Error, match=wrong):
            vector.set_attr(name, values)
    vector.close()
    plain.close()


def test_stable_baselines3_chooses_environments_by_indices() -> None:
    pytest.importorskip("stable_baselines3", reason="needs posefit[rl]")
    vector = gym.make_vec("posefit/Race-v1", num_envs=3, render_mode="rgb_array")
    adapted = to_sb3_vec_env(vector)
    adapted.reset()
    assert adapted.get_attr("world", indices=[0, 2]) == [vector.unwrapped.world] * 2  # type: ignore[attr-defined]
    adapted.set_attr("note", "common")
    assert adapted.get_attr("note") == ["common"] * 3
    # of Stable-Baselines3 a list is one value, which each environment gets
    adapted.set_attr("note", [1, 2])
    assert adapted.get_attr("note") == [[1, 2]] * 3
    for call in (
        lambda: adapted.set_attr("note", "own", indices=1),
        lambda: adapted.env_method("close", indices=[1]),
    ):
        with pytest.raises(
            error.Error, match=r"indices must be all of the 3 environments, got \[1\]"
        ):
            call()
    adapted.close()


def test_the_package_is_light_to_import() -> None:
    script = "import sys, posefit_envs; print([m for m in ('numba', 'cv2', 'scipy', 'pygame') if m in sys.modules])"
    ran = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert ran.stdout.strip() == "[]"
    assert set(dir(posefit_envs)) >= {"__all__"}


def test_the_truth_is_the_proposal_nearest_to_the_true_pose() -> None:
    vector = gym.make_vec("posefit/FitImage-v1", 3, max_evaluations=2)
    _, infos = vector.reset(seed=0, options={"instance": [5, 7, 6]})
    single = gym.make("posefit/FitImage-v1", max_evaluations=2)
    np.testing.assert_array_equal(
        single.reset(options={"instance": 6})[1]["truth"], infos["truth"][2]
    )
    np.testing.assert_array_equal(
        infos["truth"][1],
        vector.unwrapped.problems[1].truth,  # type: ignore[attr-defined]
    )
    truths = infos["truth"].copy()
    infos["truth"][:] = 0.0  # what a user changes, changes nothing here
    later = vector.step(truths)[-1]
    np.testing.assert_array_equal(later["truth"], truths)
    zero = vector.step(np.zeros((3, 9)))[-1]
    assert (later["error_degrees"] < zero["error_degrees"]).all()
