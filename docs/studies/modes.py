"""Who finds all poses of nearly one silhouette.

Methods search the instances of `posefit.niching`, all with the same budget, and report poses with weights. An optimiser
with `modes` says itself which poses it found; a filter reports the particles of its last population; of any other, the
best poses that are apart from each other count, from all that it evaluated in one search or several.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import click
import numpy as np

from posefit.arrays import Array
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
from posefit_reproduce.jobs import each
from table import WORKERS, bar, markdown

KNOWN, LIBRARY = "known", "library"  # what is known itself, as a ceiling; the nearest poses of the library
# and how many searches share the budget
METHODS = ((KNOWN, 1), ("random", 1), (LIBRARY, 1), ("sapso", 1), ("sapso", 8), ("pso", 8), ("cma", 1), ("cma", 16))
METHODS += (("annealed", 1), ("ribs", 1))
EVALUATIONS = 19_520  # of every method
FIRST = 10_000  # number of the first instance: those before it are for training
RESAMPLES, LEVEL = 2000, 0.95
SALT = 41


def _rows(number: int) -> list[dict[str, Any]]:
    """Return what every method reaches on an instance."""
    posed = niche_instance(number)
    rows = []
    for k, method in enumerate(METHODS):
        score = scored(posed, reported(posed, *method, np.random.default_rng([SALT, number, k])))
        ratios = [score.peak_ratio[level] for level in LEVELS_MM]
        scores = {"brier": score.brier, "log_score": score.log_score, "reported": score.reported}
        rows.append({"kind": posed.kind, "peak_ratio": ratios, **scores})
    return rows


def reported(posed: NicheInstance, name: str, count: int, rng: np.random.Generator) -> Posterior:
    """Return what so many searches of a method report of an instance."""
    problem = posed.problem
    if name == KNOWN:
        places = np.tile(problem.space.anchor, (len(posed.known), 1))
        return Posterior(posed.known, places, boltzmann_weights(posed.costs, TEMPERATURE))
    if name == LIBRARY:
        drawn = _library(problem, EVALUATIONS, rng)
        return best_apart(problem, drawn, problem.evaluate(drawn))
    offer = registry().offer("optimiser", name)
    seen: list[tuple[Array, Array]] = []
    for _ in range(count):
        settings = planned(offer.factory, {}, EVALUATIONS // count)
        optimiser = offer.factory(problem.space, np.random.default_rng(int(rng.integers(2**63))), **settings)
        visited = list(populations(optimiser, problem.evaluate, EVALUATIONS // count))
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


def _cells(name: str, count: int, rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the means of a method's rows; of the peak ratio at the widest level with an interval, and by kind."""
    ratios = np.array([row["peak_ratio"] for row in rows])
    rng = np.random.default_rng(0)
    means = ratios[rng.integers(len(rows), size=(RESAMPLES, len(rows))), -1].mean(axis=1)
    low, high = np.quantile(means, [0.5 - LEVEL / 2.0, 0.5 + LEVEL / 2.0])
    return [
        f"{name} x {count}" if count > 1 else name,
        *(f"{ratio:.2f}" for ratio in ratios.mean(axis=0)),
        f"{low:.2f} to {high:.2f}",
        *(f"{np.mean([row['peak_ratio'][-1] for row in rows if row['kind'] == kind]):.2f}" for kind in KINDS),
        *(f"{np.mean([row[score] for row in rows]):.2f}" for score in ("brier", "log_score")),
        f"{np.mean([row['reported'] for row in rows]):.1f}",
    ]


def modes_lines(instances: int, workers: int | None) -> Iterator[str]:
    """Yield the table of what every method reaches on so many instances."""
    # the methods of an instance are one job: to make the instance takes longer than most searches
    of_instances = each({FIRST + k: partial(_rows, FIRST + k) for k in range(instances)}, workers, bar)
    levels = [f"peak ratio at {level:g} mm" for level in LEVELS_MM]
    heads = ["method", *levels, "95 % interval", *KINDS, "Brier score", "log score", "reported"]
    rows = zip(*of_instances.values(), strict=True)
    yield from markdown(heads, [_cells(*method, mine) for method, mine in zip(METHODS, rows, strict=True)])


@click.command(help=__doc__)
@click.option(
    "--instances",
    type=click.IntRange(len(KINDS), COUNT - FIRST),
    default=30,
    show_default=True,
    help="Of the niching task, held out ones.",
)
@WORKERS
def main(instances: int, workers: int | None) -> None:
    for line in modes_lines(instances, workers):
        click.echo(line)


if __name__ == "__main__":
    main()
