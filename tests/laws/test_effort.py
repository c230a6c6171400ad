"""Evaluations are poses that were drawn: of every method's frames, every suite problem, every environment's steps."""

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import posefit
import posefit_envs
from posefit import Problem, minimise
from posefit.fitting.optimiser import Filter
from posefit.fitting.tracker import Frame
from posefit.motion import built_in
from posefit.registry import registry
from posefit.settings import planned
from posefit.silhouette.drawn import PoseCount
from posefit.suites.functions import FUNCTIONS
from posefit.tracking.method import prepare
from posefit.tracking.options import TrackOptions
from posefit_envs.world import first_problem, instance, world_of

OPTIMISERS = sorted(registry().offers["optimiser"])
# the others learn for seconds: tests/laws/test_track_effort.py has `exemplars`
TRACKERS = ["gradient", "vsmm"]
EVALUATIONS = 120
FRAMES = 3


def frames_of(method: str, views: list[float], evaluations: int) -> tuple[Any, float]:
    """Return the frames of a method on a walk before some cameras, and how many poses it drew for a view."""
    world = world_of(view_degrees=views)
    walk = instance(world, 17, FRAMES, evaluations)
    training = [built_in.motion(style) for style in ("walk-a", "walk-b")]
    task = replace(walk.task, training=training)
    ready = prepare(TrackOptions(method=method, evaluations=evaluations), task)
    count = PoseCount()
    # what a tracker learns when it is made is no evaluation of a frame
    following = ready.follow(task, walk.observations, np.random.default_rng(1))
    with count.counting():
        frames = list[Frame](following)
    assert not ready.audit.warnings
    return frames, count.poses / len(views)


@pytest.mark.parametrize("method", OPTIMISERS)
def test_a_frames_evaluations_are_the_poses_drawn_for_it(method: str) -> None:
    frames, drawn = frames_of(f"{method}@pca", [0.0, 90.0], EVALUATIONS)
    used = [frame.evaluations for frame in frames]
    assert sum(used) == drawn
    assert 0 < min(used) <= max(used) <= EVALUATIONS
    # a trace ends with all of them, at the cost of the frame
    for frame in frames:
        assert frame.trace[-1].tolist() == [frame.evaluations, frame.cost]


@pytest.mark.parametrize("method", TRACKERS)
def test_a_tracker_reports_what_it_drew(method: str) -> None:
    frames, drawn = frames_of(method, [45.0], 1000)
    used = sum(frame.evaluations for frame in frames)
    if method == "gradient":
        # its steps draw nothing, and each counts as the evaluations that take as long
        assert used >= drawn
        return
    # a small picture counts by its share of the pixels, and a frame's sum is rounded
    assert used == pytest.approx(drawn, abs=len(frames))


@pytest.mark.parametrize("name", OPTIMISERS)
def test_a_problem_counts_what_it_draws(name: str) -> None:
    problem = first_problem(world_of(), 17)
    problem.budget = EVALUATIONS
    factory = registry().optimiser(name)
    rng = np.random.default_rng(0)
    made: Any = factory(problem.space, rng, **planned(factory, {}, EVALUATIONS))
    count = PoseCount()
    with count.counting():
        minimise(problem, made, budget_known=True)
        if registry().offer("optimiser", name).next_frame == "carry":
            following = Problem(problem.cost, problem.space, EVALUATIONS)
            carried: Filter = made
            carried.advance(problem.space)
            minimise(following, made, budget_known=True)
            assert count.poses == problem.evaluations + following.evaluations
            return
    assert count.poses == problem.evaluations


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.name)
def test_a_suites_problem_counts_proposals(function: Any) -> None:
    problem = posefit.suite(
        "posefit-2026.3", function.number, 17, function.dimensions[0]
    )
    proposals = np.random.default_rng(0).uniform(-1.0, 1.0, (7, problem.dimension))
    count = PoseCount()
    with count.counting():
        problem(proposals)
        problem(proposals[0])
    # a noisy one also draws what its record is of: the cost without noise
    drawings = sum(len(frame.cameras) for frame in problem.made.frames)
    assert problem.evaluations == 8
    assert count.poses == 8 * drawings * (2 if function.noisy else 1)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("FitImage", {"max_evaluations": 5}),
        ("FitImage", {"view_degrees": [0.0, 90.0], "translation": "aligned"}),
        ("Track", {"frames": 3, "evaluations_per_frame": 4}),
        ("Race", {"searches": 2, "generations": (3, 3)}),
    ],
)
def test_an_environments_evaluations_are_what_its_steps_drew(
    name: str, arguments: dict[str, Any]
) -> None:
    views = len(arguments.get("view_degrees", [0.0]))
    frames = arguments.get("frames", 1)
    used = []
    drawn = []
    vector = gym.make_vec(f"posefit/{name}-v1", 2, **arguments)
    single = gym.make(f"posefit/{name}-v1", **arguments)
    for env in (single, vector):
        env.action_space.seed(0)
        env.reset(seed=3)
        # a scene is rendered at a reset, which is no evaluation
        infos = env.reset(options={"instance": 17})[1]
        first = np.sum(infos.get("evaluations", 0))
        before = np.sum(infos.get("evaluations", 0))
        count = PoseCount()
        total = 0
        ended = False
        while not ended:
            with count.counting():
                action = env.action_space.sample()
                _, _, terminated, truncated, infos = env.step(action)
            now = np.sum(infos["evaluations"])
            total += now - before
            commits = np.any(infos.get("committed_frame", -1) >= 0)
            before = 0 if commits else now
            ended = bool(np.all(terminated | truncated))
        used.append(total)
        drawn.append(count.poses / views)
        assert first == 0 or name == "Race"
    # Track renders the next frame once its pose is committed
    assert used == drawn
    assert used[1] == 2 * used[0] if frames == 1 else used[1] > used[0]


@pytest.mark.parametrize("count", [1, 3])
def test_a_driven_environment_counts_the_evaluations_of_the_search(count: int) -> None:
    env = gym.make_vec("posefit/FitImage-v1", count, instance=3, max_evaluations=13)
    poses = PoseCount()
    with poses.counting():
        problem = posefit_envs.drive(env, "sapso", evaluations=80)
    # the last step of a population is filled up with its last proposal
    filling = -40 % count * 2
    assert poses.poses == problem.evaluations + filling
