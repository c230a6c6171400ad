"""The accuracy table, over five seeds: `python -m posefit_experiments.accuracy CMU_DIR [OPTIMISER]`."""

import sys
from pathlib import Path
from typing import Any

import numpy as np

from posefit.tracking.front import track

SEEDS = range(5)
VIEWS = (0.0, 45.0, 90.0)
FRAMES = (0, 60)  # at 30 fps
CASES = (("16/16_17", ("16/16_15",)), ("16/16_15", ("02/02_01", "05/05_01")))
HEADER = (
    "| trained on | test | view | error median | error max | mean pose | first pose held | best training pose "
    "| prior's floor | MPJPE mm | PA-MPJPE mm | IoU | swapped % | lost % |"
)


def row(summaries: list[dict[str, Any]], test: str, train: tuple[str, ...], view: float) -> str:
    """Return a table row: medians over seeds, but the largest mean error, and mean rates."""

    def middle(key: str) -> float:
        return float(np.median([summary[key] for summary in summaries]))

    errors = [summary["error_degrees"]["mean"] for summary in summaries]
    baselines = summaries[0]["baselines_degrees"]
    figures = [
        f"{np.median(errors):.2f}",
        f"{max(errors):.2f}",
        *(f"{baselines[name]:.2f}" for name in ("mean_pose", "persistence", "nearest")),
        f"{middle('prior_floor_degrees'):.2f}",
        f"{middle('mpjpe_mm'):.0f}",
        f"{middle('pa_mpjpe_mm'):.0f}",
        f"{middle('iou'):.3f}",
        *(f"{100 * np.mean([summary[key] for summary in summaries]):.0f}" for key in ("swap_rate", "lost_rate")),
    ]
    names = " + ".join(Path(name).name for name in train)
    return f"| {names} | {Path(test).name} | {view:.0f} | " + " | ".join(figures) + " |"


def main(root: Path, optimiser: str = "sapso") -> None:
    """Print the table."""
    print(HEADER)
    print("|---|---|" + "---:|" * (HEADER.count("|") - 3))
    for test, train in CASES:
        for view in VIEWS:
            summaries = [
                track(
                    root / f"{test}.amc",
                    train=[root / f"{name}.amc" for name in train],
                    optimiser=optimiser,
                    view_degrees=view,
                    frames=FRAMES,
                    seed=seed,
                ).summary
                for seed in SEEDS
            ]
            print(row(summaries, test, train, view), flush=True)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: python -m posefit_experiments.accuracy CMU_DIR [OPTIMISER]")
    main(Path(sys.argv[1]), *sys.argv[2:])
