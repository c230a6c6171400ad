"""The environments keep Gymnasium's rules and Stable-Baselines3's, with every warning an error."""

import copy
import math
import pickle
import sys
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import error
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env, data_equivalence

import posefit_envs  # noqa: F401, registers them
from posefit import SynthesisTracker
from posefit_envs.world import instance
from tests.cases import each

SEARCHES = tuple(f"posefit/{name}-v1" for name in ("FitImage", "Track", "Race"))
WORLDS: list[dict[str, Any]] = [
    {},
    {"instance": 17},
    {"motion": "run", "view_degrees": [0.0, 90.0], "prior": "full", "size": (80, 60)},
    {
        "translation": "searched",
        "noise": {"holes": 0.5, "shadow": 0.5},
        "yaw": "unknown",
    },
    {"motion": ["walk", "walk-a"], "held_out_people": False, "errors": False},
    {
        "translation": "aligned",
        "mismatch_percent": 10.0,
        "split": "test",
        "train": ["walk-a", "run-a"],
    },
]
VARIANTS = [(name, {}) for name in SEARCHES] + list(
    zip(2 * SEARCHES, WORLDS[1:], strict=False)
)
SHORT: dict[str, dict[str, Any]] = {
    "posefit/FitImage-v1": {"max_evaluations": 7},
    "posefit/Track-v1": {"frames": 3, "evaluations_per_frame": 3},
    "posefit/Race-v1": {"searches": 3, "generations": [4, 6]},
}


@each(("name", "arguments"), VARIANTS)
def test_the_checker_passes_without_a_warning(
    name: str, arguments: dict[str, Any], monkeypatch: Any
) -> None:
    monkeypatch.setitem(sys.modules, "pygame", None)  # nor is a window needed
    check_env(gym.make(f"posefit_envs:{name}", **arguments).unwrapped)


@pytest.mark.filterwarnings(
    "ignore:.*pkg_resources.*:UserWarning",
    "ignore:.*pkg_resources.*:DeprecationWarning",
)
@each(("name", "arguments"), VARIANTS)
def test_the_checker_of_stable_baselines3_passes_without_a_warning(
    name: str, arguments: dict[str, Any]
) -> None:
    checker = pytest.importorskip(
        "stable_baselines3.common.env_checker", reason="needs posefit[rl]"
    )
    checker.check_env(gym.make(name, **arguments).unwrapped)


def trace(env: gym.Env[Any, Any], steps: int = 12) -> list[Any]:
    env.action_space.seed(3)
    results: list[Any] = [env.reset(seed=5)]
    for _ in range(steps):
        results.append(env.step(env.action_space.sample()))
        if results[-1][2] or results[-1][3]:
            results.append(env.reset())
    env.close()
    return results


@each(
    ("name", "arguments"),
    [(SEARCHES[0], {}), *zip(2 * SEARCHES, WORLDS[1:], strict=False)],
)
def test_its_description_as_json_makes_an_equal_one(
    name: str, arguments: dict[str, Any]
) -> None:
    env = gym.make(name, **{**arguments, **SHORT[name]})
    assert data_equivalence(
        trace(env), trace(gym.make(EnvSpec.from_json(env.spec.to_json())))
    )


@each("name", SEARCHES)
def test_it_can_be_pickled_and_copied_in_the_middle(name: str) -> None:
    env = gym.make(name, instance=3, **SHORT[name]).unwrapped
    env.reset(seed=0)
    env.step(env.action_space.sample())
    action = np.full(env.action_space.shape or (), 0.1, dtype=np.float32)
    for twin in (pickle.loads(pickle.dumps(env)), copy.deepcopy(env)):
        assert data_equivalence(copy.deepcopy(env).step(action), twin.step(action))
    env.close()
    env.close()


@each("name", SEARCHES)
def test_pictures_are_rgb(name: str) -> None:
    env = gym.make(name, render_mode="rgb_array")
    env.reset(seed=0)
    before = np.asarray(env.render())
    env.step(env.action_space.sample())
    after = np.asarray(env.render())
    assert (before.shape, before.dtype, before.shape[2]) == (
        after.shape,
        after.dtype,
        3,
    )
    assert before.dtype == np.uint8
    assert (before != after).any()


def test_fit_ends_with_the_budget_and_counts_the_best() -> None:
    env = gym.make("posefit/FitImage-v1", instance=3, max_evaluations=3)
    env.reset(seed=0)
    ends = [env.step(np.full(9, 0.3 * k, np.float32)) for k in range(3)]
    assert [end[2:4] for end in ends] == [(False, False), (False, False), (True, False)]
    costs = [end[4]["cost"] for end in ends]
    assert [end[1] for end in ends] == pytest.approx(
        [-math.log(1.0 + cost) for cost in costs]
    )
    assert [end[4]["best_cost"] for end in ends] == [
        min(costs[: k + 1]) for k in range(3)
    ]
    assert [end[4]["evaluations"] for end in ends] == [1, 2, 3]
    assert [end[4]["remaining_steps"] for end in ends] == [2, 1, 0]


class OnePopulation:
    """An optimiser that proposes one population, and no more."""

    def __init__(self, population: Any) -> None:
        self.left = [population]

    def ask(self) -> Any:
        return self.left.pop() if self.left else np.empty((0, 9))

    def tell(self, proposals: Any, costs: Any) -> None: ...


def test_track_proposals_decode_as_in_the_tracker() -> None:
    env: Any = gym.make(
        "posefit/Track-v1", instance=5, frames=3, evaluations_per_frame=4
    ).unwrapped
    env.reset(seed=0)
    populations = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 4, 9))
    following = iter(populations)
    made = instance(env.world, 5, 3, 4)
    tracker = SynthesisTracker(
        made.task, env.world.learned, lambda *_: OnePopulation(next(following))
    )
    frames = list(tracker.track(made.observations, np.random.default_rng(0)))
    poses = []
    for population in populations:
        for proposal in population:
            _, _, terminated, truncated, info = env.step(proposal)
        poses.append(info["committed_pose"])
        assert info["committed_frame"] == len(poses) - 1
        assert info["committed_cost"] == info["best_cost"]
    assert (terminated, truncated) == (True, False)
    np.testing.assert_array_equal(poses, [frame.pose for frame in frames])
    # the box moved on with each frame
    assert len({float(pose[0]) for pose in poses}) == 3


def test_numbers_of_numpy_are_taken_as_arguments() -> None:
    arguments: dict[str, Any] = {
        "instance": np.int64(3), "size": np.array([64, 48]), "view_degrees": np.array([0.0, 90.0]),
        "mismatch_percent": np.float32(2.0), "noise": {"holes": np.float32(0.5)}, "errors": np.True_,
        "generations": np.array([3, 6]), "searches": np.int8(2),
    }  # fmt: skip
    plain: dict[str, Any] = {
        "instance": 3, "size": (64, 48), "view_degrees": [0.0, 90.0], "mismatch_percent": 2.0,
        "noise": {"holes": 0.5}, "errors": True, "generations": (3, 6), "searches": 2,
    }  # fmt: skip
    first, second = (
        gym.make("posefit/Race-v1", **more).reset(seed=1) for more in (arguments, plain)
    )
    assert data_equivalence(first, second)


TWO = r"generations must be two whole numbers such as \(100, 220\), got "
WRONG: dict[str, list[tuple[dict[str, Any], str]]] = {
    "posefit/Track-v1": [
        ({"motion": "wakl"}, "did you mean 'walk'"),
        ({"prior": "pcb"}, "prior must be one of .* did you mean 'pca'"),
        ({"train": ["wakl"]}, "did you mean 'walk'"),
        ({"split": "dev"}, "split must be one of train, test, got 'dev'"),
        ({"noise": {"rain": 0.5}}, "noise must be one of occluder, .*, got 'rain'"),
        (
            {"noise": {"holes": 2.0}},
            "noise holes must have a strength of 0 to 1, got 2.0",
        ),
        ({"size": (20, 20)}, r"size must be \(width, height\) of 36 to 4096 pixels"),
        (
            {"view_degrees": float("nan")},
            "view_degrees must be one finite number or several",
        ),
        ({"mismatch_percent": 80.0}, "mismatch_percent must lie in 0 to 50"),
        (
            {"train": "walk"},
            r"train must be a list of motions such as \['walk-a'\], got 'walk'",
        ),
        ({"errors": "no"}, "errors must be true or false, got 'no'"),
    ],
    "posefit/FitImage-v1": [
        ({"max_evaluations": 0}, "max_evaluations must be at least 1, got 0"),
        ({"yaw": "any"}, "yaw must be one of guessed, unknown, got 'any'"),
        ({"motion": []}, r"motion must be a name, several names, or 'all', got \[\]"),
        ({"motion": 3}, "motion must be a name, several names, or 'all', got 3"),
        ({"motion": ["walk", "rnu"]}, "motion must be one of walk, .*, got 'rnu'"),
        (
            {"motion": "walk-a", "held_out_people": True},
            "motion must be one of walk, .*, got 'walk-a'",
        ),
        ({"held_out_people": 1}, "held_out_people must be true or false, got 1"),
    ],
    "posefit/Race-v1": [
        ({"searches": 1}, "searches must be at least 2, got 1"),
        ({"population_size": 1}, "population_size must be at least 2, got 1"),
        (
            {"optimiser": "psso"},
            "optimiser must be one of .*, got 'psso'; did you mean 'pso'",
        ),
        ({"generations": 50}, f"{TWO}50"),
        ({"generations": "ab"}, f"{TWO}'ab'"),
        ({"generations": (1, 2, 3)}, rf"{TWO}\(1, 2, 3\)"),
        ({"generations": (0, 5)}, "generations must be at least 1, got 0"),
        (
            {"generations": (5, 4)},
            "generations must be the smallest and the largest budget, got 5 and 4",
        ),
    ],
}


@each(
    ("name", "arguments", "message"),
    [(name, *one) for name, many in WRONG.items() for one in many],
)
def test_wrong_arguments_are_named(
    name: str, arguments: dict[str, Any], message: str
) -> None:
    for make in (
        gym.make,
        lambda name, **arguments: gym.make_vec(name, num_envs=2, **arguments),
    ):
        with pytest.raises(error.Error, match=message) as caught:
            make(name, **arguments)
        assert isinstance(caught.value, ValueError)


@pytest.mark.filterwarnings(
    "ignore:.*render_mode:UserWarning",
    "ignore:.*The environment is being initialised with render_mode.*",
)
def test_unknown_arguments_and_modes_are_named() -> None:
    with pytest.raises(
        TypeError,
        match=r"unexpected keyword argument 'nois'; did you mean 'noise'\?: it must be one of motion, ",
    ):
        gym.make("posefit/Track-v1", nois={"holes": 0.3})
    with pytest.raises(
        TypeError,
        match=r"'optimizer'; did you mean 'optimiser'\?: it must be one of motion, .*, optimiser, ",
    ):
        gym.make("posefit/Race-v1", optimizer="cma")
    with pytest.raises(
        error.UnsupportedMode, match="render_mode must be one of rgb_array, got 'ansi'"
    ):
        gym.make("posefit/Track-v1", render_mode="ansi")


@each("name", SEARCHES)
def test_wrong_actions_are_named(name: str) -> None:
    env = gym.make(name, disable_env_checker=True).unwrapped
    size = (env.action_space.shape or ())[0]
    with pytest.raises(error.ResetNeeded, match="reset must come before"):
        env.step(np.zeros(size))
    env.reset(seed=0)
    for action, message in (
        (
            np.zeros(size + 1),
            rf"actions must have shape \({size},\), got \({size + 1},\)",
        ),
        (np.full(size, np.nan), "actions must be finite, got nan or infinity"),
        (np.full(size, np.inf), "actions must be finite"),
        ("left", f"an action must be {size} numbers, got 'left'"),
        (None, r"actions must"),
    ):
        with pytest.raises(error.InvalidAction, match=message):
            env.step(action)


@each("name", SEARCHES)
def test_an_action_outside_is_clipped_with_one_warning(name: str) -> None:
    env, other = (
        gym.make(name, instance=3, disable_env_checker=True).unwrapped for _ in range(2)
    )
    env.reset(seed=0)
    other.reset(seed=0)
    size = (env.action_space.shape or ())[0]
    with pytest.warns(
        UserWarning,
        match=r"actions must lie in \[-1, 1\], got one of size 3: actions are clipped",
    ):
        clipped = env.step(np.full(size, 3.0))
    assert data_equivalence(clipped, other.step(np.ones(size)))
    env.step(np.full(size, -2.0))  # a second warning would be an error
