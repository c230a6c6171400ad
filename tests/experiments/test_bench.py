"""`posefit bench`: what it tells, and what is timed."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from posefit.arrays import Array
from posefit.cli import main
from posefit.fitting.optimiser import minimise
from posefit_experiments.bench import experiment, optimisers, timing
from posefit_experiments.bench.optimisers import Stopwatch


class Line:
    """Proposes the same three points for ever."""

    def __init__(self) -> None:
        self.told = 0

    def ask(self) -> Array:
        return np.zeros((3, 2))

    def tell(self, proposals: Array, costs: Array) -> None:
        self.told += len(costs)


def test_a_stopwatch_ends_a_search_after_its_populations() -> None:
    line = Line()
    watch = Stopwatch(line, 4)
    found = minimise(lambda proposals: np.ones(len(proposals)), watch, 10**9)
    assert (found.evaluations, watch.proposals, line.told) == (12, 12, 12)
    assert watch.seconds > 0.0


def test_its_json_holds_every_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timing, "ROUNDS", 1)
    monkeypatch.setattr(timing, "TURN", 1e-6)
    monkeypatch.setattr(optimisers, "SEARCHES", 1)
    monkeypatch.setattr(optimisers, "POPULATIONS", 10)
    monkeypatch.setattr(experiment, "SEEDS", 1)
    result = CliRunner().invoke(main, ["bench", "--threads", "1", "--json"])
    assert result.exit_code == 0, result.output
    figures = json.loads(result.stdout)
    assert set(figures) == {
        "kernel_us_per_pose_1_thread", "kernel_us_per_pose_all_threads", "opencv_us_per_pose",
        "opencv_batched_us_per_pose", "sapso_frame_ms", "sapso_overhead", "kernel_speedup",
        "kernel_speedup_over_batched", "threads", "threads_speedup", "poses_per_second_1_thread",
        "mean_cost_difference_to_opencv", "vector_env", "optimisers", "size", "poses",
    }  # fmt: skip
    assert set(figures["vector_env"]) == {
        "kernel_us",
        "us_per_proposal",
        "overhead_us",
        "sync_us_per_proposal",
        "times_sync",
    }
    assert {"sapso", "pso", "random", "cma", "particle", "annealed", "scipy:dual_annealing"} <= set(
        figures["optimisers"]
    )
    assert all(us > 0.0 for us in figures["optimisers"].values())
    # the same silhouettes but for their edges
    assert figures["mean_cost_difference_to_opencv"] < 1.0
    assert CliRunner().invoke(main, ["bench", "--threads", "0"]).exit_code == 2
