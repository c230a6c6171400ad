"""The methods that the handbook compares, at one budget: `posefit reproduce methods`.

Five optimisers in three priors follow a walk and a run of CMU, seen from three sides. With a `first_pose` that is given
the first frame starts around the true pose, as in papers that begin by hand; else it has to be found.
"""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from posefit.footage.masks import FPS
from posefit.footage.source import motion_of
from posefit.sweep.plan import Plan
from posefit_reproduce.clips import clip_path
from posefit_reproduce.columns import head_of, number
from posefit_reproduce.grid import Say, check_seeds, rows

OPTIMISERS = ("particle", "annealed", "pso", "sapso", "cma")
PRIORS: dict[str, tuple[str, dict[str, Any]]] = {
    "pca": ("pca", {}),
    "full, training range": ("full", {"full.limits": "training"}),  # constraint 1 of the paper, on all angles
    "full, joint limits": ("full", {"full.limits": "asf"}),
}
GAITS = {"walk": ("16/16_17", ("16/16_15",)), "run": ("16/16_35", ("09/09_01", "127/127_03"))}
VIEWS = (0.0, 45.0, 90.0)
SEEDS = 5
FRAMES = 60  # at 30 fps at most; the run has 41
WORKERS = 2  # the seconds of a frame depend on how many run at once

OF_SEEDS = ("error", "least", "worst")  # median, least and largest error

Key = tuple[str, str, str, float, int]  # optimiser, prior, gait, view, seed


def methods(
    clips: str | None, first_pose: str, seeds: int, workers: int | None, ledger: str | None, say: Say
) -> dict[str, Any]:
    """Return what each optimiser reaches in each prior: medians over seeds of means over frames.

    Raises ValueError where `clips` is no folder of CMU clips.
    """
    check_seeds(seeds)
    gaits = {gait: _gait(clips, gait) for gait in GAITS}
    keys: list[Key] = list(product(OPTIMISERS, PRIORS, GAITS, VIEWS, range(seeds)))
    cells = [
        {
            **gaits[gait],
            "method": f"{optimiser}@{PRIORS[prior][0]}",
            "settings": PRIORS[prior][1],
            "view_degrees": view,
            "first_pose": first_pose,
            "seed": seed,
        }
        for optimiser, prior, gait, view, seed in keys
    ]
    found = dict(zip(keys, rows(Plan.of({"cells": cells}), workers, ledger, say), strict=True))
    floors = {gait: found[OPTIMISERS[0], "pca", gait, VIEWS[0], 0] for gait in GAITS}
    return {
        "first_pose": first_pose,
        "seeds": seeds,
        "views_degrees": list(VIEWS),
        "rows": [_row(found, optimiser, prior, seeds) for prior, optimiser in product(PRIORS, OPTIMISERS)],
        "motions": {
            gait: {
                "frames": row["spec"]["frames"],
                "baselines_degrees": row["baselines_degrees"],
                "pca_floor_degrees": row["prior_floor_degrees"],
            }
            for gait, row in floors.items()
        },
    }


def _gait(clips: str | None, gait: str) -> dict[str, Any]:
    """Return what cells say of a motion."""
    test, train = GAITS[gait]
    path = clip_path(clips, test)
    frames = min(FRAMES, len(motion_of(path, None, FPS)))
    return {"motion": str(path), "train": [str(clip_path(clips, name)) for name in train], "frames": frames}


def _row(found: dict[Key, dict[str, Any]], optimiser: str, prior: str, seeds: int) -> dict[str, Any]:
    mine = {key[2:]: one for key, one in found.items() if key[:2] == (optimiser, prior)}
    told: dict[str, Any] = {"optimiser": optimiser, "prior": prior}
    for gait in GAITS:
        seen = np.array([[mine[gait, view, seed]["error_degrees"]["mean"] for seed in range(seeds)] for view in VIEWS])
        every = [one for key, one in mine.items() if key[0] == gait]
        by_seed = seen.mean(axis=0)
        told[gait] = {
            "error_degrees": float(np.median(by_seed)),
            "least_degrees": float(by_seed.min()),
            "worst_degrees": float(by_seed.max()),
            "by_view_degrees": [float(np.median(view)) for view in seen],
            "skill": float(np.mean([one["skill"]["mean_pose"] for one in every])),
            "swap_rate": float(np.mean([one["swap_rate"] for one in every])),
            "lost_rate": float(np.mean([one["lost_rate"] for one in every])),
        }
    told["seconds_per_frame"] = float(np.median([one["seconds_per_frame"] for one in mine.values()]))
    used = [one["evaluations_used"] / one["spec"]["frames"] for one in mine.values()]
    return {**told, "evaluations": float(np.mean(used))}


def methods_lines(told: dict[str, Any]) -> Iterator[str]:
    """Yield the table as it is printed, and what anybody reaches."""
    views = ", ".join(f"{view:.0f}" for view in told["views_degrees"])
    heads = [head_of("error_degrees"), f"at {views}", head_of("skill"), head_of("swap_rate"), head_of("lost_rate")]
    heads = [f"{gait} {head}" for gait in GAITS for head in heads]
    yield f"| optimiser | prior | {' | '.join(heads)} | s a frame | {head_of('evaluations')} |"
    yield "|---|---|" + "---:|" * (len(heads) + 2)
    for row in told["rows"]:
        figures = []
        for one in (row[gait] for gait in GAITS):
            error, least, worst = (number("error_degrees", one[f"{which}_degrees"]) for which in OF_SEEDS)
            figures += [
                f"{error} ({least} to {worst})",
                " ".join(number("error_degrees", middle) for middle in one["by_view_degrees"]),
                *(number(name, one[name]) for name in ("skill", "swap_rate", "lost_rate")),
            ]
        ends = f"{row['seconds_per_frame']:.3f} | {number('evaluations', row['evaluations'])}"
        yield f"| {row['optimiser']} | {row['prior']} | {' | '.join(figures)} | {ends} |"
    for gait, one in told["motions"].items():
        yield f"{gait}: {one['baselines_degrees']}, floor of pca {one['pca_floor_degrees']:.2f}"
