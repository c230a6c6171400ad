"""How much worse a track gets as its silhouettes do: `posefit reproduce degradation`.

Known truth, one view, the same budget. What is spoilt follows from the seed, and a body that is not the person's is no
corruption, so the runs are jobs, not cells.
"""

from collections.abc import Iterator, Mapping
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from posefit.footage.spoilt import Spoilt
from posefit.geometry.body import varied
from posefit.tracking.measures import BASELINES, MEASURES
from posefit.tracking.method import Choice, prepare
from posefit_reproduce.columns import head_of, labelled, number
from posefit_reproduce.grid import Progress, check_seeds, each
from posefit_reproduce.known import follow_known, known_errors, known_scene, known_task, mean_pose_degrees

STRENGTHS = (0.0, 0.25, 0.5, 0.75, 1.0)
SEEDS = 5
MOTION, VIEW = "walk", 45.0
MISMATCH = 10.0  # percent at strength 1
DROPPED = 0.8  # share of the frames at strength 1
KINDS = ("holes", "blobs", "shadow", "jitter", "occluder", "dropped frames", "body mismatch")


def degradation(
    optimiser: str, prior: str, seeds: int, workers: int | None, progress: Progress | None = None
) -> dict[str, Any]:
    """Return what every kind and strength of damage leaves of a track, and the mean pose's error in degrees.

    Raises ValueError where there is no such optimiser or prior.
    """
    check_seeds(seeds)
    choice = Choice(optimiser=optimiser, prior=prior)
    scene = known_scene(MOTION, [VIEW])
    task = known_task(scene, choice, scene.body)
    prepare(choice, task)  # which says before the minutes that the tracks take where a name is wrong
    keys = list(product(KINDS, STRENGTHS, range(seeds)))
    found = each({key: partial(_errors, choice, *key) for key in keys}, workers, progress)
    return {
        "optimiser": optimiser,
        "prior": prior,
        "motion": MOTION,
        "view_degrees": VIEW,
        "seeds": seeds,
        "strengths": list(STRENGTHS),
        "mean_pose_degrees": mean_pose_degrees(scene, task),
        "kinds": {  # of every strength, of every seed
            kind: [[found[kind, strength, seed] for seed in range(seeds)] for strength in STRENGTHS] for kind in KINDS
        },
    }


def _errors(choice: Choice, kind: str, strength: float, seed: int) -> dict[str, float]:
    scene = known_scene(MOTION, [VIEW])
    percent = MISMATCH * strength if kind == "body mismatch" else 0.0
    body = varied(scene.body, percent, np.random.default_rng(seed))
    dropped = DROPPED * strength if kind == "dropped frames" else 0.0
    noise = {} if kind in ("body mismatch", "dropped frames") else {kind: strength}
    seen = Spoilt(scene.observations, noise, dropped, seed)
    return known_errors(scene, follow_known(known_task(scene, choice, body), choice, seen, seed))


def degradation_lines(told: Mapping[str, Any]) -> Iterator[str]:
    """Yield the table that the figure shows: medians, least and largest errors over seeds."""
    for kind, rows in told["kinds"].items():
        for strength, row in zip(told["strengths"], rows, strict=True):
            errors, lost = ([one[key] for one in row] for key in ("error_degrees", "lost_rate"))
            least, worst = (number("error_degrees", one) for one in (min(errors), max(errors)))
            error = labelled("error_degrees", float(np.median(errors)), 5)
            yield (
                f"{kind:16} {strength:4.2f} {error} ({least} to {worst}), "
                f"{labelled('lost_rate', float(np.mean(lost)), 3)}"
            )
    yield f"{BASELINES['mean_pose']}: {number('error_degrees', told['mean_pose_degrees'])} degrees"


def degradation_figure(told: Mapping[str, Any], path: Path) -> None:
    """Draw error and lost frames against strength; the bands are the range over seeds."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(9.0, 3.6), layout="constrained")
    for axes, key in zip(drawn.subplots(1, 2), ("error_degrees", "lost_rate"), strict=True):
        scale = MEASURES[key].factor
        for kind, rows in told["kinds"].items():
            values = scale * np.array([[one[key] for one in row] for row in rows])
            (line,) = axes.plot(told["strengths"], np.median(values, axis=1), marker="o", markersize=3, label=kind)
            low, high = values.min(axis=1), values.max(axis=1)
            axes.fill_between(told["strengths"], low, high, color=line.get_color(), alpha=0.1)
        axes.set_xlabel("strength")
        axes.set_ylabel(head_of(key))
        axes.set_ylim(bottom=0.0)
        axes.spines[["top", "right"]].set_visible(False)
        if key == "error_degrees":
            axes.axhline(told["mean_pose_degrees"], color="0.5", linestyle=":", label=BASELINES["mean_pose"])
            axes.legend(fontsize=7, frameon=False)
    drawn.savefig(path, dpi=120)
