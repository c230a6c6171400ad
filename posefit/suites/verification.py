"""Whether a bundle's claims hold: every point is evaluated again, and chosen searches are repeated from their seeds."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from posefit.errors import InputError
from posefit.fitting.check import one_of, whole
from posefit.registry import registry, version_of
from posefit.suites.bundles import label, read_contents
from posefit.suites.functions import HELD_OUT, SUITES, checked_address
from posefit.suites.problem import INFEASIBLE, suite
from posefit.suites.running import SuiteRun, run_on

TOLERANCE = 1e-12  # of a cost, which is a ratio of whole numbers of pixels


@dataclass(frozen=True, eq=False)
class Bundle:
    """Runs whose claims were found to hold."""

    path: Path
    suite: str
    digest: str
    runs: tuple[SuiteRun, ...] = field(repr=False)
    evaluated: int  # points
    repeated: int  # searches
    unrepeatable: tuple[str, ...]  # methods that were not to be repeated here, with the reason


def verified(path: str | Path, repeat: int = 0, progress: Callable[[str], None] = lambda _: None) -> Bundle:
    """Return the runs of a bundle once every claim of it is found to hold.

    Every point must be in the box and feasible, unless infeasible ones are penalised; evaluated again it must have the
    claimed cost, to within 1e-12; evaluations must rise within the budget, and costs fall; instances must be held out,
    and no run may come twice. With `repeat` so many searches by methods that are installed here are run again, which
    the bundle's digest chooses, and their traces must hold all that is claimed. Raises InputError, with the reason, for
    the first claim that does not hold.
    """
    whole("repeat", repeat, 0)
    try:
        manifest, arrays = read_contents(path)
        claims = _claims(manifest, arrays)
        runs = [_evaluated(claim) for claim in sorted(claims, key=_problem)]  # each problem is made once
        runs.sort(key=lambda run: (run.method, *_problem(run)))
        repeated, unrepeatable = _repeat(runs, manifest["digest"], repeat, progress) if repeat else (0, ())
    except InputError as error:
        text = str(error)
        raise InputError(text if text.startswith(f"{path}: ") else f"{path}: {text}") from None
    evaluated = len(arrays["costs"])
    return Bundle(Path(path), manifest["suite"], manifest["digest"], tuple(runs), evaluated, repeated, unrepeatable)


def _problem(run: SuiteRun) -> tuple[int, ...]:
    return run.dimension, run.function, run.instance, run.seed, run.budget


def _claims(manifest: Mapping[str, Any], arrays: Mapping[str, Any]) -> list[SuiteRun]:
    """Return the runs that are claimed, their targets and the true poses' costs still unknown.

    Raises InputError where an address is none of the suite's, or a run comes twice.
    """
    one_of("suite", manifest["suite"], SUITES)
    claims, step, start = {}, 0, 0
    for entry in manifest["runs"]:
        method, d, count = manifest["methods"][entry["method"]], entry["dimension"], entry["improvements"]
        one_of("infeasible", method["infeasible"], INFEASIBLE)
        used, costs = (arrays[name][step : step + count] for name in ("evaluations", "costs"))
        points = arrays["points"][start : start + count * d].reshape(count, d)
        step, start = step + count, start + count * d
        if entry["evaluations"] > used[-1]:
            used, costs = np.append(used, entry["evaluations"]), np.append(costs, costs[-1])
        claim = SuiteRun(
            manifest["suite"],
            method["method"],
            method["settings"],
            method["version"],
            entry["function"],
            d,
            entry["instance"],
            entry["seed"],
            entry["budget"],
            method["infeasible"],
            np.nan,
            np.empty(0),
            used.astype(np.float64),
            costs,
            points,
        )
        with _about(claim):
            checked_address(claim.suite, claim.function, claim.instance, claim.dimension)
            if claim.instance not in HELD_OUT:
                raise InputError(f"instance must be held out, {HELD_OUT[0]} to {HELD_OUT[-1]}, got one for training")
            place = entry["method"], *_problem(claim)
            if place in claims:
                raise InputError("each run must come once, got it twice")
            _check_trace(claim, entry["evaluations"])
        claims[place] = claim
    return list(claims.values())


def _check_trace(claim: SuiteRun, used: int) -> None:
    """Raise InputError where evaluations do not rise, or beyond the budget, or costs do not fall."""
    assert claim.points is not None
    steps, costs = claim.evaluations[: len(claim.points)], claim.costs[: len(claim.points)]
    if steps[0] < 1 or (np.diff(steps) <= 0).any():
        raise InputError("evaluations must rise from 1 on, got some that do not")
    if steps[-1] > used:
        raise InputError(f"evaluations must be {steps[-1]:.0f} or more in all, got {used}")
    if used > claim.budget:
        raise InputError(f"evaluations must be at most {claim.budget}, the budget, got {used}")
    if (np.diff(costs) >= 0.0).any():
        raise InputError("costs must fall, got some that do not")


def _evaluated(claim: SuiteRun) -> SuiteRun:
    """Return a claimed run once the costs of its points are the claimed ones. Raises InputError where one is not."""
    problem = suite(claim.suite, claim.function, claim.instance, claim.dimension, infeasible=claim.infeasible)  # type: ignore[arg-type]
    points = claim.points
    assert points is not None
    with _about(claim):
        if claim.infeasible != "penalise":
            if (far := np.abs(points).max()) > 1.0:
                raise InputError(f"points must lie in the box, -1 to 1, got {far!r}")
            if not problem.space.feasible(points).all():
                raise InputError("points must be feasible, got some that are not")
        costs = problem.noise_free(points)
        if (wrong := np.flatnonzero(np.abs(costs - claim.costs[: len(points)]) > TOLERANCE)).size:
            k = wrong[0]
            after = f"cost after {claim.evaluations[k]:.0f} evaluations"
            raise InputError(f"{after} must be that of its point, {float(costs[k])!r}, got {float(claim.costs[k])!r}")
    return replace(claim, truth_cost=problem.truth_cost, targets=problem.targets)


def _repeat(
    runs: Sequence[SuiteRun], digest: str, count: int, progress: Callable[[str], None]
) -> tuple[int, tuple[str, ...]]:
    """Run some searches again, and return how many, and which methods cannot be run here. Raises as `verified` does."""
    reasons: dict[str, str] = {}
    repeated = 0
    for k in np.random.default_rng(int(digest, 16)).permutation(len(runs)):
        run = runs[k]
        if repeated == count:
            break
        if run.method in reasons:
            continue
        try:
            origin = registry().offer("optimiser", run.method).origin
        except (InputError, ImportError) as error:
            reasons[run.method] = str(error)
            continue
        progress(label(run))
        with _about(run):
            _check_repeated(run, version_of([origin]))
        repeated += 1
    return repeated, tuple(f"{method}: {reason}" for method, reason in reasons.items())


def _check_repeated(run: SuiteRun, version: str) -> None:
    """Run a search again. Raises InputError where its trace does not hold all that is claimed."""
    assert run.points is not None
    problem = suite(run.suite, run.function, run.instance, run.dimension, infeasible=run.infeasible)  # type: ignore[arg-type]
    chosen = {name: tuple(value) if isinstance(value, list) else value for name, value in run.settings.items()}
    again = run_on(problem, run.method, chosen, evaluations=run.budget, seed=run.seed)
    trace = dict(zip(again.evaluations.tolist(), again.costs.tolist(), strict=True))
    count = len(run.points)
    steps = zip(run.evaluations[:count].tolist(), run.costs[:count].tolist(), strict=True)
    missing = [used for used, cost in steps if abs(trace.get(used, np.inf) - cost) > TOLERANCE]
    if not missing and run.evaluations[-1] == again.evaluations[-1]:
        return
    came = f"another one from evaluation {missing[0]:.0f} on" if missing else f"{again.evaluations[-1]:.0f} evaluations"
    cause = (
        ": it is not that of this seed"
        if missing and missing[0] == run.evaluations[0]
        else (": it is not that of this seed, or linear algebra of another processor or library decided otherwise")
    )
    if run.version != version:
        cause += f"; it was made with {run.version}, and is repeated with {version}"
    raise InputError(f"the trace of the search from its seed must be the claimed one, got {came}{cause}")


@contextmanager
def _about(run: SuiteRun) -> Iterator[None]:
    """Have an InputError begin with the run."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{label(run)}: {error}") from None
