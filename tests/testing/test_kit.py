"""The kit passes what is right and fails what is wrong, for the reason that was planted."""

from functools import partial
from typing import Any

import pytest

from posefit.fitting.box import draw_population
from posefit.fitting.tracker import Prediction, SynthesisTracker, Task
from posefit.registry import registry
from posefit.testing import (
    check_optimiser,
    check_prior,
    check_tracker,
    optimiser_checks,
    parametrize,
    results,
    run_checks,
)
from posefit_priors.pca import PCA
from posefit_swarm.sapso import SAPSO
from tests.testing import planted

QUICK = ("sapso", "random", "cma")
SLOW = ("pso", "particle", "annealed", "scipy", "scipy:dual_annealing")
ADAPTERS = ("pycma", "nevergrad", "pymoo", "pymoo:GA", "optuna", "ribs")


@pytest.mark.parametrize("name", [*QUICK, *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW + ADAPTERS)])
def test_it_passes_every_shipped_optimiser(name: str) -> None:
    offer = registry().offer("optimiser", name)
    result = check_optimiser(offer.factory, next_frame=offer.next_frame)
    assert result, str(result)
    ran = len(result.of("passed"))
    assert ran >= 28
    assert f"{ran} checks ran, 0 failed" in str(result)


@pytest.mark.parametrize(
    "name",
    [
        "pca",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("loose", "full", "union", "sklearn")),
        *(pytest.param(f"sklearn:{name}", marks=pytest.mark.slow) for name in ("FactorAnalysis", "FastICA")),
    ],
)
def test_it_passes_every_shipped_prior(name: str) -> None:
    result = check_prior(registry().offer("prior", name).factory)
    assert result, str(result)


def synthesis(task: Task, *, floor: float = 0.05) -> SynthesisTracker:

    make = partial(SAPSO, population_size=20, iterations=task.evaluations // 20 - 1)
    return SynthesisTracker(task, PCA().fit(task.angles), make, prediction=Prediction(floor=floor))


@pytest.mark.slow
def test_it_passes_the_papers_tracker() -> None:
    result = check_tracker(synthesis)
    assert result, str(result)
    assert len(result.of("passed")) >= 13


class Chance:
    """Draws uniformly."""

    def __init__(self, space: Any, rng: Any, *, population_size: int = 40) -> None:
        self.space, self.rng, self.population_size = space, rng, population_size

    def ask(self) -> Any:
        return draw_population(self.space, self.rng, self.population_size)

    def tell(self, proposals: Any, costs: Any) -> None: ...


class Baseline(Chance):
    baseline = True


def test_chance_does_not_beat_chance_and_need_not_where_it_says_that_it_is_the_baseline() -> None:
    names = "sphere_problem", "real_problem"

    def outcomes(factory: Any) -> list[tuple[str, str]]:
        found = [check.run() for check in optimiser_checks(factory, next_frame="forget") if check.name in names]
        return [(one.outcome, one.detail) for one in found]

    assert [outcome for outcome, _ in outcomes(Chance)] == ["failed", "failed"]
    for factory in (Baseline, partial(Baseline, population_size=20), registry().optimiser("random")):
        assert outcomes(factory) == [("skipped", "it is the baseline itself")] * 2


@pytest.mark.parametrize("right", planted.RIGHT)
def test_it_passes_a_sound_plugin(right: Any) -> None:
    result = check_optimiser(right)
    assert result, str(result)


def test_one_cause_ends_the_checks() -> None:
    result = check_optimiser(planted.WrongSignature)
    construction, shape, dtype = result.of("failed")
    assert (construction.name, shape.name, dtype.name) == ("construction", "shape", "dtype")
    assert shape.detail == dtype.detail
    assert {one.detail for one in result.of("skipped")} == {"not run: shape and dtype fail alike"}
    assert len(result.results) == len(optimiser_checks(planted.WrongSignature))
    assert str(result).count("takes 2 positional arguments but 3") == 2


def test_a_traceback_begins_in_the_plugins_own_code() -> None:
    check = next(one for one in optimiser_checks(planted.DividesByTheRange) if one.name == "equal_costs")
    told = check.run().traceback
    assert told.splitlines()[1].strip().startswith(f'File "{planted.__file__}"')
    assert "rank = (costs - costs.min()) / (costs.max() - costs.min())" in told


def test_a_traceback_is_told_once_a_cause() -> None:
    both = [check for check in optimiser_checks(planted.ExitsInTell) if check.name in ("dtype", "box")]
    report = run_checks("it", both)
    assert len(report.of("failed")) == 2
    assert str(report).count("sys.exit(0)") == 1


def test_a_prior_that_takes_its_time_learns_twice_and_where_input_is_wrong() -> None:
    planted.Unhurried.fits = 0
    assert check_prior(planted.Unhurried)
    # once for all rules, once more for `same_again`, three times for what `bad_input` has refused
    assert planted.Unhurried.fits <= 5


@pytest.mark.parametrize(("bug", "checks"), planted.OPTIMISERS.items(), ids=lambda one: getattr(one, "__name__", ""))
def test_it_finds_each_bug_planted_in_an_optimiser(bug: Any, checks: tuple[str, ...], monkeypatch: Any) -> None:
    monkeypatch.setattr(results, "SECONDS", 3.0)
    wanted = [check for check in optimiser_checks(bug) if check.name in checks]
    assert len(wanted) == len(checks)
    for result in (check.run() for check in wanted):
        assert result.outcome == "failed", result


@pytest.mark.slow
def test_it_finds_a_filter_that_forgets() -> None:
    result = check_optimiser(planted.ForgetsParticles, next_frame="carry")
    assert "next_frame" in {one.name for one in result.of("failed")}
    assert "next_frame" in {one.name for one in check_optimiser(planted.Sound, next_frame="carry").of("failed")}


@pytest.mark.parametrize(("bug", "checks"), planted.PRIORS.items(), ids=lambda one: getattr(one, "__name__", ""))
@pytest.mark.slow
def test_it_finds_each_bug_planted_in_a_prior(bug: Any, checks: tuple[str, ...]) -> None:
    assert set(checks) <= {one.name for one in check_prior(bug).of("failed")}


@pytest.mark.parametrize(("bug", "checks"), planted.TRACKERS.items(), ids=lambda one: getattr(one, "__name__", ""))
def test_it_finds_each_bug_planted_in_a_tracker(bug: Any, checks: tuple[str, ...]) -> None:
    failed = {one.name for one in check_tracker(bug).of("failed")}
    assert set(checks) <= failed
    assert check_tracker(planted.Holds)


def test_a_skipped_check_is_visible() -> None:
    result = check_optimiser(registry().optimiser("random"), next_frame="forget")
    assert [one.detail for one in result.of("skipped")].count("it is the baseline itself") == 2
    assert "6 skipped" in result.summary
    assert "skipped  start" in str(result)


def test_a_report_is_false_where_a_check_failed() -> None:
    assert not check_optimiser(planted.AsksList)
    assert run_checks("nothing", [])


@parametrize(optimiser_checks(planted.Sound))
def test_an_author_can_have_a_test_for_each_rule(check: Any) -> None:
    check()


def test_a_check_that_fails_says_the_rule_and_what_came() -> None:
    check = next(one for one in optimiser_checks(planted.AsksOneRow) if one.name == "shape")
    with pytest.raises(AssertionError, match=r"returns an array \(n, d\): ask must return \(n, 9\), got \(9,\)"):
        check()
