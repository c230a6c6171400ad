"""One camera, two or four, at the same budget of evaluations: `posefit reproduce views`.

The first pose is searched several times, as it is for footage: that is no part of a cell, so the runs are jobs.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from posefit.tracking.method import Choice, prepare
from posefit.tracking.opening import RESTARTS, begun, following
from posefit_experiments.grid import Progress, check_seeds, each
from posefit_experiments.known import follow_known, known_errors, known_scene, known_task, mean_pose_degrees

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
        np.array([one[key] for one in found]) for key in ("error_degrees", "mpjpe_mm", "lost", "swapped")
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
        yield (
            f"{row['motion']:8} {len(row['views_degrees'])} views  error {row['error_degrees']:5.2f} "
            f"({row['least_degrees']:.2f} to {row['worst_degrees']:.2f}) degrees, MPJPE {row['mpjpe_mm']:4.0f} mm, "
            f"lost {100 * row['lost_rate']:3.0f} %, swapped {100 * row['swap_rate']:3.0f} %; "
            f"mean pose {row['mean_pose_degrees']:.2f} degrees"
        )
