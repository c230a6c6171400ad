"""Many scenes in one compiled call are what the library computes of each alone."""

from typing import Any

import numpy as np
import pytest

from posefit.silhouette.cost import project
from posefit_envs.instance import Episode, backdrop, first_episode, world_of
from posefit_envs.stage import Stage
from tests.cases import each

WORLDS: list[dict[str, Any]] = [
    {},
    {"view_degrees": (0.0, 90.0), "translation": "searched", "mismatch_percent": 10.0, "size": (130, 70)},
    {"prior": "full", "translation": "aligned", "mismatch_percent": 20.0, "noise": {"holes": 0.5}},
]


def staged(numbers: tuple[int, ...], **arguments: Any) -> tuple[Stage, list[Episode]]:
    world = world_of(**arguments)
    stage, episodes = Stage(world, len(numbers)), [first_episode(world, number, 10) for number in numbers]
    for row, episode in enumerate(episodes):
        stage.set_problem(row, episode.problem)
    return stage, episodes


@each("arguments", WORLDS)
def test_scenes_together_are_what_the_library_computes_of_each_alone(arguments: dict[str, Any]) -> None:
    stage, episodes = staged((3, 17, 17, 9_000), **arguments)
    rng = np.random.default_rng(0)
    proposals = rng.uniform(-1.0, 1.0, (len(episodes), 5, episodes[0].problem.space.dimensions))
    costs = stage.costs(proposals, stage.all_rows)
    evaluation = stage.evaluate(proposals[:, 0], stage.all_rows)
    for row, episode in enumerate(episodes):
        problem = episode.problem
        np.testing.assert_array_equal(costs[row], problem.evaluate(proposals[row]))
        poses, places = problem.decode(proposals[row, :1])
        np.testing.assert_array_equal(evaluation.poses[row], poses[0])
        np.testing.assert_array_equal(evaluation.translations[row], places[0])
        assert evaluation.costs[row] == costs[row, 0]
        for view, camera in enumerate(problem.cameras):
            body, mask = project(problem.body, camera, poses[0], places[0]), problem.silhouettes[view].mask
            np.testing.assert_array_equal(evaluation.pictures[row, ..., 2 * view + 1], 255 * body)
            np.testing.assert_array_equal(evaluation.pictures[row, ..., 2 * view], 255 * mask)
            areas = [(mask & ~body).sum(), (body & ~mask).sum(), (body & mask).sum()]
            np.testing.assert_array_equal(evaluation.areas[row, view], areas)


@pytest.mark.pure
def test_rows_that_are_left_out_show_nothing_proposed() -> None:
    stage, episodes = staged((3, 17))
    for rows in (np.array([1]), np.array([], dtype=np.int64)):
        evaluation = stage.evaluate(np.zeros((2, 9)), rows)
        picture = backdrop(episodes[0].problem.silhouettes).view(np.uint8)
        np.testing.assert_array_equal(evaluation.pictures[0], picture)
        assert not evaluation.areas[0].any()
        assert evaluation.areas[1].any() == bool(len(rows))
