"""Who finds all poses of nearly one silhouette.

Methods search the instances of `posefit.niching`, all with the same budget, and report poses with weights. An optimiser
with `modes` says itself which poses it found; a filter reports the particles of its last population; of any other, the
best poses that are apart from each other count, from all that it evaluated in one search or several.
"""

import re
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import click
import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.optimiser import populations
from posefit.fitting.problem import PoseProblem
from posefit.niching import (
    APART_MM,
    ARMS,
    COUNT,
    KINDS,
    LEVELS_MM,
    TEMPERATURE,
    NicheInstance,
    best_apart,
    box_arms,
    niche_instance,
    scored,
    stride_poses,
)
from posefit.registry import registry
from posefit.settings import planned
from posefit.uncertainty.modes import Posterior, modes_of
from posefit.uncertainty.searches import boltzmann_weights
from posefit_reproduce.jobs import Progress, each
from table import WORKERS, bar

KNOWN, LIBRARY = "known", "library"  # what is known itself, as a ceiling; the nearest poses of the library
METHODS = (KNOWN, "random", LIBRARY, "sapso", "sapso*8", "pso*8", "cma", "cma*16", "annealed", "ribs")
FIRST = 10_000  # number of the first instance: those before it are for training
RESAMPLES, LEVEL = 2000, 0.95
SALT = 41
_SEVERAL = re.compile(r"(?P<name>[^*]+)(?:\*(?P<count>[1-9]\d*))?")


def modes(
    instances: int, methods: Sequence[str], evaluations: int, workers: int | None, progress: Progress | None = None
) -> dict[str, Any]:
    """Return what every method reaches on so many instances, with so many evaluations on each.

    Raises ValueError where there is no such method, and where a budget does not hold one population.
    """
    if not 1 <= instances <= COUNT - FIRST:
        raise InputError(f"instances must lie in 1 to {COUNT - FIRST}, got {instances}")
    if evaluations < 1:
        raise InputError(f"evaluations must be at least 1, got {evaluations}")
    methods = tuple(dict.fromkeys(methods)) or METHODS
    for method in methods:
        parsed(method)
    numbers = range(FIRST, FIRST + instances)
    # the methods of an instance are one job: to make the instance takes longer than most searches
    found = each({number: partial(_row, methods, number, evaluations) for number in numbers}, workers, progress)
    rows = [row for number in numbers for row in found[number]]
    return {
        "instances": instances,
        "evaluations": evaluations,
        "levels_mm": list(LEVELS_MM),
        "methods": [_told(method, [row for row in rows if row["method"] == method]) for method in methods],
        "rows": rows,
    }


def parsed(method: str) -> tuple[str, int]:
    """Return the name of a method, and how many searches share its budget: of `cma*16`, cma and 16.

    Raises ValueError where there is none of that name.
    """
    match = _SEVERAL.fullmatch(method)
    if match is None:
        raise InputError(f"a method must be an optimiser such as cma, or cma*16 for 16 searches, got {method!r}")
    name, count = match["name"], int(match["count"] or 1)
    if name not in (KNOWN, LIBRARY):
        registry().optimiser(name)
    elif count > 1:
        raise InputError(f"a method must be an optimiser to be made several times, got {method!r}")
    return name, count


def _row(methods: Sequence[str], number: int, evaluations: int) -> list[dict[str, Any]]:
    posed = niche_instance(number)
    rows = []
    for k, method in enumerate(methods):
        score = scored(posed, reported(posed, method, evaluations, np.random.default_rng([SALT, number, k])))
        ratios = [score.peak_ratio[level] for level in LEVELS_MM]
        told = {"brier": score.brier, "log_score": score.log_score, "reported": score.reported}
        rows.append({"method": method, "instance": number, "kind": posed.kind, "peak_ratio": ratios, **told})
    return rows


def reported(posed: NicheInstance, method: str, evaluations: int, rng: np.random.Generator) -> Posterior:
    """Return what a method reports of an instance."""
    (name, count), problem = parsed(method), posed.problem
    if name == KNOWN:
        places = np.tile(problem.space.anchor, (len(posed.known), 1))
        return Posterior(posed.known, places, boltzmann_weights(posed.costs, TEMPERATURE))
    if name == LIBRARY:
        drawn = _library(problem, evaluations, rng)
        return best_apart(problem, drawn, problem.evaluate(drawn))
    offer = registry().offer("optimiser", name)
    seen: list[tuple[Array, Array]] = []
    for _ in range(count):
        settings = planned(offer.factory, {}, evaluations // count)
        optimiser = offer.factory(problem.space, np.random.default_rng(int(rng.integers(2**63))), **settings)
        visited = list(populations(optimiser, problem.evaluate, evaluations // count))
        if hasattr(optimiser, "modes"):
            modes = optimiser.modes()
            visited = [(modes, problem.evaluate(modes))]
        elif offer.next_frame == "carry":
            visited = visited[-1:]
        seen += visited
    proposals, costs = (np.concatenate([one[k] for one in seen]) for k in (0, 1))
    if offer.next_frame == "carry":
        return _particles(problem, proposals, costs)
    return best_apart(problem, proposals, costs)


def _library(problem: PoseProblem, count: int, rng: np.random.Generator) -> Array:
    """Return proposals (count, d): poses of the library at any yaw."""
    poses = stride_poses()[rng.integers(len(stride_poses()), size=count)].copy()
    poses[:, ARMS] = box_arms()[rng.integers(len(box_arms()), size=count)]
    poses[:, 0] = rng.uniform(-np.pi, np.pi, count)
    latents = problem.space.prior.transform(poses[:, 3:])
    return problem.space.proposals(np.column_stack([poses[:, :3], latents]))


def _particles(problem: PoseProblem, proposals: Array, costs: Array) -> Posterior:
    """Return the modes of particles."""
    poses, translations = problem.decode(proposals)
    particles = Posterior(poses, translations, boltzmann_weights(costs, TEMPERATURE))
    modes = modes_of(problem.body.skeleton, particles, APART_MM / 1e3)
    return Posterior(
        np.array([mode.pose for mode in modes]),
        np.array([mode.translation for mode in modes]),
        np.array([mode.weight for mode in modes]),
    )


def _told(method: str, rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the means of a method's rows; of the peak ratio at the widest level with an interval, and by kind."""
    ratios = np.array([row["peak_ratio"] for row in rows])
    rng = np.random.default_rng(0)
    means = ratios[rng.integers(len(rows), size=(RESAMPLES, len(rows))), -1].mean(axis=1)
    low, high = np.quantile(means, [0.5 - LEVEL / 2.0, 0.5 + LEVEL / 2.0])
    return {
        "method": method,
        "peak_ratio": ratios.mean(axis=0).tolist(),
        "low": float(low),
        "high": float(high),
        "by_kind": {
            kind: float(np.mean(mine))
            for kind in KINDS
            if (mine := [row["peak_ratio"][-1] for row in rows if row["kind"] == kind])
        },
        **{name: float(np.mean([row[name] for row in rows])) for name in ("brier", "log_score", "reported")},
    }


def modes_lines(told: dict[str, Any]) -> Iterator[str]:
    """Yield the table as it is printed."""
    levels = [f"peak ratio at {level:g} mm" for level in told["levels_mm"]]
    kinds = list(told["methods"][0]["by_kind"])
    heads = ["method", *levels, "95 % interval", *kinds, "Brier score", "log score", "reported"]
    yield f"| {' | '.join(heads)} |"
    yield "|---|" + "---:|" * (len(heads) - 1)
    for one in told["methods"]:
        cells = [
            one["method"].replace("*", " x "),
            *(f"{ratio:.2f}" for ratio in one["peak_ratio"]),
            f"{one['low']:.2f} to {one['high']:.2f}",
            *(f"{one['by_kind'][kind]:.2f}" for kind in kinds),
            *(f"{one[name]:.2f}" for name in ("brier", "log_score")),
            f"{one['reported']:.1f}",
        ]
        yield f"| {' | '.join(cells)} |"


@click.command(help=__doc__)
@click.option("--instances", type=int, default=30, show_default=True, help="Of the niching task, held out ones.")
@click.option("--method", "methods", multiple=True, help="An optimiser; cma*16 is 16 searches. Again for more.")
@click.option("--evaluations", type=click.IntRange(1), default=19520, show_default=True, help="Of every method.")
@WORKERS
def main(instances: int, methods: tuple[str, ...], evaluations: int, workers: int | None) -> None:
    for line in modes_lines(modes(instances, methods, evaluations, workers, bar)):
        click.echo(line)


if __name__ == "__main__":
    main()
