"""The accuracy table: one optimiser with `pca` on two walks of CMU from three sides; `posefit reproduce accuracy`."""

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from posefit.sweep.plan import Plan
from posefit.tracking.measures import BASELINES
from posefit_reproduce.clips import clip_path
from posefit_reproduce.columns import head_of, number
from posefit_reproduce.grid import Say, check_seeds, rows

SEEDS = 5
VIEWS = (0.0, 45.0, 90.0)
FRAMES = 60  # at 30 fps
WALKS = (("16/16_17", ("16/16_15",)), ("16/16_15", ("02/02_01", "05/05_01")))  # the clip, and what it is trained on
MIDDLE = ("prior_floor_degrees", "mpjpe_mm", "pa_mpjpe_mm", "iou")  # medians over seeds
MEAN = ("swap_rate", "lost_rate")


def accuracy(
    clips: str | None, optimiser: str, tracks: int, seeds: int, workers: int | None, ledger: str | None, say: Say
) -> dict[str, Any]:
    """Return what the optimiser reaches on each walk from each side: medians over seeds, but the largest mean error.

    Of so many `tracks` of a seed, from different beginnings, the one is kept that costs least as a whole. Swapped and
    lost frames are mean shares. Raises ValueError where `clips` is no folder of CMU clips.
    """
    check_seeds(seeds)
    places = [(test, train, view) for (test, train), view in product(WALKS, VIEWS)]
    cells = [
        {
            "method": f"{optimiser}@pca",
            "motion": str(clip_path(clips, test)),
            "train": [str(clip_path(clips, name)) for name in train],
            "view_degrees": view,
            "frames": FRAMES,
            "tracks": tracks,
            "seed": seed,
        }
        for test, train, view in places
        for seed in range(seeds)
    ]
    found = rows(Plan.of({"cells": cells}), workers, ledger, say)
    table = [
        {
            "train": [Path(name).name for name in train],
            "test": Path(test).name,
            "view_degrees": view,
            **_figures(found[k * seeds : (k + 1) * seeds]),
        }
        for k, (test, train, view) in enumerate(places)
    ]
    return {"optimiser": optimiser, "tracks": tracks, "seeds": seeds, "frames": FRAMES, "rows": table}


def _figures(seen: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the figures of a table's row, from the rows of all seeds."""

    def middle(key: str) -> float:
        return float(np.median([row[key] for row in seen]))

    errors = [row["error_degrees"]["mean"] for row in seen]
    return {
        "error_degrees": float(np.median(errors)),
        "worst_degrees": max(errors),
        "baselines_degrees": seen[0]["baselines_degrees"],
        **{key: middle(key) for key in MIDDLE},
        **{key: float(np.mean([row[key] for row in seen])) for key in MEAN},
    }


def accuracy_lines(told: dict[str, Any]) -> Iterator[str]:
    """Yield the table as it is printed."""
    errors = [head_of("error_degrees", which) for which in ("median", "max")]
    heads = [*errors, *BASELINES.values(), *(head_of(name) for name in (*MIDDLE, *MEAN))]
    yield f"| trained on | test | view | {' | '.join(heads)} |"
    yield "|---|---|" + "---:|" * (1 + len(heads))
    for row in told["rows"]:
        figures = [
            number("error_degrees", row["error_degrees"]),
            number("error_degrees", row["worst_degrees"]),
            *(number("baselines_degrees", row["baselines_degrees"][name]) for name in BASELINES),
            *(number(name, row[name]) for name in (*MIDDLE, *MEAN)),
        ]
        yield f"| {' + '.join(row['train'])} | {row['test']} | {row['view_degrees']:.0f} | {' | '.join(figures)} |"
