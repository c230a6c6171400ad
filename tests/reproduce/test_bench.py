"""`posefit bench`: what it tells, and what is timed."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from posefit.arrays import Array
from posefit.cli import main
from posefit.fitting.problem import PoseProblem
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit_reproduce.bench import device, experiment, kernel, optimisers
from posefit_reproduce.bench.kernel import bench_problem, opencv_costs
from posefit_reproduce.bench.optimisers import timed_search, wide_space
from tests.cases import each


class Line:
    """Proposes the same three points in so many populations of each frame."""

    def __init__(self, populations: int) -> None:
        self.populations, self.costs, self.frames = populations, 0, 1

    def ask(self) -> Array:
        return np.zeros((3 if self.costs < 3 * self.populations * self.frames else 0, 2))

    def tell(self, proposals: Array, costs: Array) -> None:
        self.costs += len(costs)

    def advance(self, space: Any) -> None:
        self.frames += 1


@each(("populations", "space", "costs", "frames"), [(9, None, 12, 1), (2, None, 6, 1), (2, "next", 24, 5)])
def test_a_search_ends_after_its_populations_and_a_filter_after_its_frames(
    populations: int, space: Any, costs: int, frames: int
) -> None:
    line = Line(populations)
    assert timed_search(line, 4, space) > 0.0
    assert (line.costs, line.frames) == (costs, frames)


def test_the_wide_space_has_28_dimensions() -> None:
    assert wide_space(bench_problem().space).dimensions == 28


@each("stretch", [(1.0, 1.0), (0.6, 1.2), (1.2, 0.6)])
def test_opencv_finds_the_same_costs_whatever_the_two_focal_lengths(stretch: tuple[float, float]) -> None:
    usual = bench_problem()
    camera = replace(usual.cameras[0], focal=usual.cameras[0].focal * stretch)
    proposals = np.random.default_rng(0).uniform(-0.3, 0.3, (50, usual.space.dimensions))
    poses, translations = usual.decode(proposals[:1])
    seen = Silhouette.of(project(usual.body, camera, poses[0], translations[0]))
    problem = PoseProblem(usual.body, [camera], [seen], usual.space)
    ours, theirs = problem.evaluate(proposals), opencv_costs(problem, proposals)
    # OpenCV also sets the pixels that a border merely touches, a ring of half a pixel around limbs 10 pixels wide
    assert ours[0] == 0.0
    assert theirs[0] < 4.0
    assert np.abs(ours - theirs).mean() < 1.0


@pytest.mark.slow
def test_its_json_holds_every_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel, "ROUNDS", 1)
    monkeypatch.setattr(kernel, "TURN", 1e-6)
    monkeypatch.setattr(optimisers, "SEARCHES", 1)
    monkeypatch.setattr(optimisers, "POPULATIONS", 10)
    monkeypatch.setattr(experiment, "SEEDS", 1)
    result = CliRunner().invoke(main, ["bench", "--threads", "1", "--json"])
    assert result.exit_code == 0, result.output
    figures = json.loads(result.stdout)
    assert {"sapso", "pso", "random", "cma", "particle", "scipy:dual_annealing"} <= set(figures["optimisers"])
    for group in ("many", "optimisers", "optimisers_28"):
        assert all(us > 0.0 for us in figures[group].values()), group
    cases = {"fit_shared", "track_each", "race_each", "race_all_threads", "fit_learning", "race_learning"}
    assert cases <= set(figures["vector_env"])
    # the same silhouettes but for their edges
    assert figures["mean_cost_difference_to_opencv"] < 1.0


def test_mistakes_are_reported_before_anything_is_timed() -> None:
    for words in ("--device cuda --threads 2", "--threads 0", "--device tpu"):
        done = CliRunner().invoke(main, ["bench", *words.split()])
        assert (done.exit_code, done.stdout) == (2, ""), words


@pytest.mark.device
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_the_table_says_that_both_count_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel, "ROUNDS", 1)
    monkeypatch.setattr(device, "_memory", lambda: {"megabytes_held": 0.0, "gpu": "simulated"})
    figures = device.device_figures("cuda", sizes=((24, 18),), poses=(1, 2), frame=(2, 1))
    assert [(case["poses"], case["equal"], case["proposals_differing"]) for case in figures["cases"]] == [
        (1, True, 0),
        (2, True, 0),
    ]
    assert figures["frame"]["cost"] == figures["frame"]["cpu_cost"]
    lines = list(device.device_lines(figures))
    assert len(lines) == 6
    assert lines[2].endswith("  equal")
