"""The kit passes what is right and fails what is wrong, for the reason that was planted."""

import os
import re
import subprocess
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.cli.template import write_plugin
from posefit.fitting.box import Space
from posefit.fitting.synthesis import Prediction, SynthesisTracker
from posefit.fitting.tracker import Task
from posefit.registry import registry
from posefit.testing import (
    check_optimiser,
    check_prior,
    check_start,
    check_tracker,
    checks_of,
    results,
    run_checks,
)
from posefit_priors.pca import PCA
from posefit_swarm.random import Random
from posefit_swarm.sapso import SAPSO
from tests.testing import planted

SLOW = ("pso", "particle", "annealed", "scipy", "scipy:dual_annealing")
ADAPTERS = ("pycma", "nevergrad", "pymoo", "pymoo:GA", "optuna")
SLOW_PRIORS = ("loose", "full", "sklearn", "sklearn:FactorAnalysis", "sklearn:FastICA")


def with_slow(quick: Sequence[str], slow: Sequence[str]) -> list[Any]:
    return [*quick, *(pytest.param(name, marks=pytest.mark.slow) for name in slow)]


@pytest.mark.parametrize("name", with_slow(["sapso", "random", "cma"], SLOW + ADAPTERS))
def test_it_passes_every_shipped_optimiser(name: str) -> None:
    offer = registry().offer("optimiser", name)
    report = check_optimiser(offer.factory, next_frame=offer.next_frame)
    assert report, str(report)
    assert len(report.of("passed")) >= 15
    assert f"{len(report.of('passed'))} checks ran, 0 failed" in str(report)


@pytest.mark.parametrize("name", with_slow(["pca"], SLOW_PRIORS))
def test_it_passes_every_shipped_prior(name: str) -> None:
    report = check_prior(registry().offer("prior", name).factory)
    assert report, str(report)


def synthesis(task: Task, *, floor: float = 0.05) -> SynthesisTracker:
    def make(space: Space, rng: np.random.Generator, evaluations: int) -> SAPSO:
        return SAPSO(space, rng, population_size=20, iterations=evaluations // 20 - 1)

    return SynthesisTracker(
        task, PCA().fit(task.angles), make, prediction=Prediction(floor=floor)
    )


@pytest.mark.slow
def test_it_passes_the_papers_tracker() -> None:
    report = check_tracker(synthesis)
    assert report, str(report)
    assert len(report.of("passed")) == 11


class Chance(Random):
    baseline = False


def test_random_search_fails_the_chance_rule_unless_it_is_the_baseline() -> None:
    def outcomes(factory: Any) -> list[tuple[str, str]]:
        checks = checks_of("optimiser", factory, None, "forget")
        ran = [
            check.run()
            for check in checks
            if check.name in ("sphere_problem", "real_problem")
        ]
        return [(result.outcome, result.detail) for result in ran]

    assert [outcome for outcome, _ in outcomes(Chance)] == ["failed", "failed"]
    for factory in (Random, partial(Random, population_size=20)):
        assert outcomes(factory) == [("skipped", "it is the baseline itself")] * 2


def test_it_passes_sound_plugins() -> None:
    for sound in planted.RIGHT:
        report = check_optimiser(sound)
        assert report, str(report)
    planted.Unhurried.fits = 0
    assert check_prior(planted.Unhurried)
    # once for all rules, once more for `same_again` and `silence`, three times for what `bad_input` has refused
    assert planted.Unhurried.fits <= 6
    assert check_tracker(planted.Holds)
    assert check_start(planted.Guesses)
    assert check_start(registry().offer("start", "lookup").factory)


def test_it_fails_each_bug_planted_in_an_optimiser(monkeypatch: Any) -> None:
    monkeypatch.setattr(results, "SECONDS", 3.0)
    for bug in planted.OPTIMISERS:
        wanted = [
            check for check in checks_of("optimiser", bug) if check.name in bug.breaks
        ]
        assert len(wanted) == len(bug.breaks), bug
        assert {check.run().outcome for check in wanted} == {"failed"}, bug


def test_it_fails_each_bug_planted_in_a_tracker_or_a_start() -> None:
    for check, bugs in (
        (check_tracker, planted.TRACKERS),
        (check_start, planted.STARTS),
    ):
        for bug in bugs:
            assert set(bug.breaks) <= {
                result.name for result in check(bug).of("failed")
            }, bug


@pytest.mark.slow
def test_it_fails_each_bug_planted_in_a_prior_or_a_filter() -> None:
    for bug in planted.PRIORS:
        assert set(bug.breaks) <= {
            result.name for result in check_prior(bug).of("failed")
        }, bug
    for factory in (planted.ForgetsParticles, planted.Sound):
        failed = {
            result.name
            for result in check_optimiser(factory, next_frame="carry").of("failed")
        }
        assert "next_frame" in failed, factory


def test_a_prior_with_a_tiny_feasible_part_passes_with_a_warning() -> None:
    def checked(share: float) -> str:
        class Picky(PCA):
            def feasible(self, latents: Array) -> Any:
                return (latents[:, 0] - self.low[0]) < share * (
                    self.high[0] - self.low[0]
                )

        check = next(
            check for check in checks_of("prior", Picky) if check.name == "searchable"
        )
        return check.run().detail

    # a proposal is drawn 100 times: at 0.6 % feasible 0.994^100 = 55 % of them never are, at 50 % none
    warning = r"warning: only (0\.\d+) % of the box is feasible: of a first population about (\d+) % are copies of the others"
    ((feasible, copies),) = re.findall(f"^{warning}$", checked(0.006))
    assert 0.3 < float(feasible) < 1.0
    assert int(copies) == pytest.approx(100 * (1 - float(feasible) / 100) ** 100, abs=1)
    assert re.fullmatch(r"(4|5)\d(\.\d)? % of the box is feasible", checked(0.5))


def test_one_cause_ends_the_checks() -> None:
    report = check_optimiser(planted.WrongSignature)
    assert not report
    _, shape, dtype = failed = report.of("failed")
    assert [result.name for result in failed] == ["construction", "shape", "dtype"]
    assert shape.detail == dtype.detail
    assert {result.detail for result in report.of("skipped")} == {
        "not run: shape and dtype fail for one cause"
    }
    assert len(report.results) == len(checks_of("optimiser", planted.WrongSignature))
    assert str(report).count("takes 2 positional arguments but 3") == 2
    assert run_checks("nothing", [])


def test_settings_by_position_are_named() -> None:
    def by_position(
        space: Any, rng: Any, population_size: int = 40, spread: float = 1.0
    ) -> Any: ...

    def too_few(space: Any) -> Any: ...

    wanted = r"a factory must take \(space, rng\) and keyword-only settings, got "
    for factory, came in (
        (by_position, r"population_size, spread before the \*"),
        (too_few, r"\(space\)"),
    ):
        check = next(
            check
            for check in checks_of("optimiser", factory)
            if check.name == "construction"
        )
        assert re.fullmatch(f"{wanted}{came}", check.run().detail)


def test_a_setting_has_a_type_that_is_checked_and_a_default_of_it() -> None:
    def unknown(space: Any, rng: Any, *, table: dict[str, int] | None = None) -> Any:
        return planted.Sound(space, rng)

    def unfit(space: Any, rng: Any, *, sizes: tuple[int, ...] = (1.5,)) -> Any:  # type: ignore[assignment]
        return planted.Sound(space, rng)

    for factory, wanted in (
        (
            unknown,
            r"the type of the setting table must be int, .*, got dict\[str, int\] \| none",
        ),
        (unfit, r"the default of sizes must be tuple\[int, \.\.\.\], got \(1\.5,\)"),
    ):
        check = checks_of("optimiser", factory)[0]
        assert check.name == "construction"
        assert re.fullmatch(wanted, check.run().detail)


ALONE = """
import importlib.util, sys
from posefit import testing
from posefit.registry import registry
assert not any(registry().offers.values())
for kind in ("optimiser", "prior", "tracker"):
    path = f"{sys.argv[1]}/{kind}/posefit_own.py"
    spec = importlib.util.spec_from_file_location(f"posefit_own_{kind}", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    report = getattr(testing, f"check_{kind}")(module.Own)
    assert report, str(report)
    assert not [r for r in report.of("skipped") if "not run" in r.detail], str(report)
others = {name.partition(".")[0] for name in sys.modules if name.startswith("posefit_")}
assert others == {f"posefit_own_{kind}" for kind in ("optimiser", "prior", "tracker")}, others
"""


def test_it_needs_no_plugin(tmp_path: Path) -> None:
    for kind in ("optimiser", "prior", "tracker"):
        write_plugin("own", kind, tmp_path / kind)
    ran = subprocess.run(
        [sys.executable, "-c", ALONE, str(tmp_path)],
        capture_output=True,
        text=True,
        env={**os.environ, "POSEFIT_BLOCK_PLUGINS": "posefit"},
    )
    assert (ran.returncode, ran.stderr) == (0, "")


def test_a_traceback_begins_in_the_plugins_own_code_and_is_there_once_a_cause() -> None:
    check = next(
        check
        for check in checks_of("optimiser", planted.DividesByTheRange)
        if check.name == "costs"
    )
    trace = check.run().traceback
    assert trace.splitlines()[1].strip().startswith(f'File "{planted.__file__}"')
    assert 'assert not np.isnan(rank).any(), "costs are all equal"' in trace
    both = [
        check
        for check in checks_of("optimiser", planted.ExitsInTell)
        if check.name in ("dtype", "box")
    ]
    report = run_checks("it", both)
    assert len(report.of("failed")) == 2
    assert str(report).count("sys.exit(0)") == 1
