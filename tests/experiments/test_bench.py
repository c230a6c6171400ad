"""`posefit bench`: what it tells, and what is timed."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from posefit.arrays import Array
from posefit.cli import main
from posefit.fitting.optimiser import minimise
from posefit.fitting.problem import PoseProblem
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit_experiments.bench import experiment, frame, optimisers, timing
from posefit_experiments.bench.kernel import bench_problem, opencv_costs
from posefit_experiments.bench.optimisers import Stopwatch, wide_space


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
    found = minimise(lambda proposals: np.ones(len(proposals)), watch, 10**9, told=True)
    assert (found.evaluations, watch.proposals, line.told) == (12, 12, 12)
    assert watch.seconds > 0.0


def test_the_wide_space_has_28_dimensions() -> None:
    assert wide_space(bench_problem().space).dimensions == 28


@pytest.mark.slow
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
        "mean_cost_difference_to_opencv", "vector_env", "optimisers", "optimisers_28", "size", "poses",
        "frame", "sapso_loose_overhead",
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
    assert set(figures["optimisers_28"]) == {"sapso", "pso", "random", "cma", "particle", "annealed"}
    assert all(us > 0.0 for name in ("optimisers", "optimisers_28") for us in figures[name].values())
    assert set(figures["frame"]) == {"sapso+pca", "sapso+loose", "pso+pca", "annealed+pca"}
    assert figures["sapso_loose_overhead"] == pytest.approx(figures["frame"]["sapso+loose"]["overhead"], abs=1e-3)
    # the same silhouettes but for their edges
    assert figures["mean_cost_difference_to_opencv"] < 1.0
    assert CliRunner().invoke(main, ["bench", "--threads", "0"]).exit_code == 2


@pytest.mark.parametrize("name", frame.METHODS)
def test_the_parts_of_a_frame_do_again_what_the_track_did(name: str) -> None:
    walk = frame.Walk(bench_problem(), *frame.METHODS[name])
    assert [sum(len(costs) for _, costs in search.told) for search in walk.searches] == [2440] * frame.FRAMES
    for found, search in zip(walk.frames, walk.searches, strict=True):
        assert found.cost == min(costs.min() for _, costs in search.told)
    np.testing.assert_array_equal(walk.swarm(), walk.searches[-1].told[-1][0])


def test_a_profile_of_a_frame_adds_up() -> None:
    # 4 frames in 40 ms, of which 20 are drawn, 4 decoded and 8 the optimiser's: 8 are left
    profile = frame.profile(0.040, {"kernel": 0.020, "prior": 0.004, "swarm": 0.008})
    assert profile == pytest.approx({
        "ms": 10.0, "kernel_ms": 5.0, "prior_ms": 1.0, "swarm_ms": 2.0, "driver_ms": 2.0,
        "kernel_share": 0.5, "prior_share": 0.1, "swarm_share": 0.2, "driver_share": 0.2, "overhead": 40 / 24,
    })  # fmt: skip


@pytest.mark.parametrize("stretch", [(1.0, 1.0), (0.6, 1.2), (1.2, 0.6)])
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
