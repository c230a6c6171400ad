"""One camera, two or four, at the same budget of evaluations: `posefit reproduce views`.

The first pose is searched several times, as it is for footage: that is no part of a cell, so the runs are jobs.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from posefit.searching.starts import RESTARTS, begun
from posefit.tracking.measures import BASELINES
from posefit.tracking.method import Choice, prepare
from posefit.tracking.opening import following
from posefit_reproduce.columns import labelled, number
from posefit_reproduce.grid import Progress, check_seeds, each
from posefit_reproduce.known import follow_known, known_errors, known_scene, known_task, mean_pose_degrees

VIEWS = ((90.0,), (0.0, 90.0), (0.0, 45.0, 90.0, 135.0))
MOTIONS = ("walk", "walk-a", "run-a")
SEEDS = 5
CHOICE = Choice()


def views(seeds: int, workers: int | None, progress: Progress | None = None) -> dict[str, Any]:
    """Return what is reached for every motion and number of cameras; translations are found from the silhouettes."""
    check_seeds(seeds)
    places = list(product(MOTIONS, VIEWS))
    jobs = {(*place, seed): partial(_errors, *place, seed) for place in places for seed in range(seeds)}
    found = each(jobs, workers, progress)
    return {"seeds": seeds, "rows": [_row(*place, [found[*place, k] for k in range(seeds)]) for place in places]}


def _errors(motion: str, views_degrees: Sequence[float], seed: int) -> dict[str, float]:
    scene = known_scene(motion, views_degrees)
    task = known_task(scene, CHOICE, scene.body, "aligned")
    begin = begun(task, scene.observations, following(prepare(CHOICE, task)), RESTARTS, seed)
    return known_errors(scene, follow_known(begin, CHOICE, scene.observations, seed))


def _row(motion: str, views_degrees: Sequence[float], found: list[dict[str, float]]) -> dict[str, Any]:
    scene = known_scene(motion, views_degrees)
    error, mpjpe, lost, swapped = (
        np.array([one[key] for one in found]) for key in ("error_degrees", "mpjpe_mm", "lost_rate", "swap_rate")
    )
    return {
        "motion": motion,
        "views_degrees": list(views_degrees),
        "error_degrees": float(np.median(error)),
        "least_degrees": float(error.min()),
        "worst_degrees": float(error.max()),
        "mpjpe_mm": float(np.median(mpjpe)),
        "lost_rate": float(lost.mean()),
        "swap_rate": float(swapped.mean()),
        "mean_pose_degrees": mean_pose_degrees(scene, known_task(scene, CHOICE, scene.body)),
    }


def views_lines(told: dict[str, Any]) -> Iterator[str]:
    """Yield the table as it is printed."""
    for row in told["rows"]:
        least, worst = (number("error_degrees", row[name]) for name in ("least_degrees", "worst_degrees"))
        others = ", ".join(
            labelled(name, row[name], width) for name, width in (("mpjpe_mm", 4), ("lost_rate", 3), ("swap_rate", 3))
        )
        where = f"{row['motion']:8} {len(row['views_degrees'])} views"
        error = f"{labelled('error_degrees', row['error_degrees'], 5)} ({least} to {worst})"
        mean = f"{BASELINES['mean_pose']} {number('error_degrees', row['mean_pose_degrees'])} degrees"
        yield f"{where}  {error}, {others}; {mean}"
