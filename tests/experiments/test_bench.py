"""`posefit bench`: what it tells, and what is timed."""

import json
import os
import platform
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from posefit.arrays import Array
from posefit.cli import main
from posefit.fitting.optimiser import minimise
from posefit.fitting.problem import PoseProblem
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit_experiments.bench import experiment, optimisers, timing
from posefit_experiments.bench.growth import Growth, growth_table
from posefit_experiments.bench.kernel import bench_problem, opencv_costs
from posefit_experiments.bench.optimisers import Stopwatch, wide_space
from posefit_experiments.bench.processor import check_named, instructions, processor


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
        "mean_cost_difference_to_opencv", "vector_env", "many", "optimisers", "optimisers_28", "size", "poses", "cpu",
        "frame", "sapso_loose_overhead",
    }  # fmt: skip
    cases = figures["vector_env"]
    learning = cases.pop("fit_learning")
    assert set(learning) == {"steps_per_second", "sync_steps_per_second", "times_sync"}
    assert set(cases) == {"fit_shared", "fit_each", "track_each", "configure_each", "configure_all_threads"}
    for case in cases.values():
        assert set(case) == {"kernel_us", "us_per_proposal", "overhead_us", "sync_us_per_proposal", "times_sync"}
    assert set(figures["many"]) == {
        "evaluate_40", "evaluate_4000", "areas_40", "areas_4000",
        "limb_combination", "limb_combination_any_order", "320x240_full", "320x240_half",
        "320x240_quarter", "1280x960_full", "1280x960_half", "1280x960_quarter",
    }  # fmt: skip
    assert all(us > 0.0 for us in figures["many"].values())
    assert {"sapso", "pso", "random", "cma", "particle", "annealed", "scipy:dual_annealing"} <= set(
        figures["optimisers"]
    )
    assert set(figures["optimisers_28"]) == {"sapso", "pso", "random", "cma", "particle", "annealed"}
    assert all(us > 0.0 for name in ("optimisers", "optimisers_28") for us in figures[name].values())
    assert set(figures["frame"]) == {"sapso+pca", "sapso+loose", "pso+pca", "annealed+pca"}
    assert figures["sapso_loose_overhead"] == pytest.approx(figures["frame"]["sapso+loose"]["overhead"], abs=1e-3)
    # the same silhouettes but for their edges
    assert figures["mean_cost_difference_to_opencv"] < 1.0


@pytest.mark.slow
def test_growth_is_a_table_and_four_figures(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(timing, "ROUNDS", 1)
    monkeypatch.setattr(timing, "TURN", 1e-6)
    found = CliRunner().invoke(main, ["bench", "--growth", "--json", "--pictures", str(tmp_path / "new")])
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    assert list(told) == ["size", "poses", "views", "dimensions"]
    assert list(told["size"]) == ["80 x 60", "160 x 120", "320 x 240", "640 x 480", "1280 x 720", "1920 x 1080"]
    assert "9" in told["dimensions"]
    assert all(us > 0.0 for row in told.values() for us in row.values())
    assert {path.name for path in (tmp_path / "new").iterdir()} == {f"growth-{name}.png" for name in told}


@pytest.mark.slow
def test_following_is_timed_and_weighed() -> None:
    found = CliRunner().invoke(main, ["bench", "--follow", "3", "--json"])
    assert found.exit_code == 0, found.output
    told = json.loads(found.stdout)
    assert told["frames"] == 3
    assert 0.0 < told["ms"] <= told["slowest_ms"]
    assert 0.0 < told["mb"] <= told["mb_end"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--threads 0", "threads must be at least 1, got 0"),
        ("--pictures .", "pictures are of --growth, got --pictures without it"),
        ("--growth --compile", "growth and compile must not both be given, got --growth --compile"),
        ("--follow 9 --compile", "follow must not be given beside --compile, got --follow 9"),
        ("--follow 9 --threads 2", "threads must not be given beside --follow, which has one, got --threads 2"),
        ("--follow 0", "follow must be at least 1 frame, got 0"),
        ("--growth --threads 0", "threads must not be given beside --growth, which has one, got --threads 0"),
        ("--compile --threads 2", "threads must not be given beside --compile, which has one, got --threads 2"),
        ("--growth --pictures /dev/null/a", "/dev/null/a: expected a folder that can be written to, got Not a directory"),
    ],
)  # fmt: skip
def test_options_that_do_not_go_together_are_one_line_before_anything_is_timed(words: str, message: str) -> None:
    done = CliRunner().invoke(main, ["bench", *words.split()])
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr == f"posefit: {message}\n"


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="the names are of x86-64")
@pytest.mark.parametrize("name", ["nonsense", "pentium3"])  # the other is LLVM's, and has 32 bits
def test_a_processor_that_nothing_compiles_for_is_one_line(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setenv("NUMBA_CPU_NAME", name)
    done = CliRunner().invoke(main, ["bench"])
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr == f"posefit: NUMBA_CPU_NAME must name a processor of x86_64, got '{name}'\n"
    for known in ("x86-64-v3", "generic", ""):
        monkeypatch.setenv("NUMBA_CPU_NAME", known)
        check_named()


def test_a_table_of_growth_has_a_line_for_each_point() -> None:
    one = Growth("size", "pixels", [1, 4], ["1 x 1", "2 x 2"], [1.5, 2.25], True)
    assert [line.split() for line in growth_table([one, one]).splitlines()] == [
        ["grows", "to", "us", "a", "pose"],
        *[["pixels", "1", "x", "1", "1.500"], ["pixels", "2", "x", "2", "2.250"]] * 2,
    ]


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


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="the names are of x86-64")
def test_the_instructions_of_a_named_processor_are_told() -> None:
    # the levels of the x86-64 psABI: v2 has SSE4.2, v3 AVX2, v4 AVX-512
    levels = {"x86-64": "SSE2", "x86-64-v2": "SSE4", "sandybridge": "AVX", "x86-64-v3": "AVX2", "x86-64-v4": "AVX-512"}
    assert {name: instructions(name) for name in levels} == levels
    assert instructions("x86-64-v4", "-avx512f") == "AVX2"
    assert set(processor()) == {"name", "compiled_for", "features"}


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="the names are of x86-64")
def test_loops_have_the_instructions_of_the_processor_that_is_named_and_no_others() -> None:
    told = "import posefit.silhouette.kernels; from posefit_experiments.bench.processor import processor; "
    for name, features in (("x86-64-v3", "AVX2"), ("x86-64-v2", "SSE4")):
        environment = {key: value for key, value in os.environ.items() if key != "NUMBA_CPU_FEATURES"}
        code = told + "print(processor()['compiled_for'], processor()['features'])"
        shown = subprocess.run(
            [sys.executable, "-c", code], env={**environment, "NUMBA_CPU_NAME": name}, capture_output=True, check=True
        )
        assert shown.stdout.split() == [name.encode(), features.encode()]
