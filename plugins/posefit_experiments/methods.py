"""The methods that the README compares, at one budget: `python -m posefit_experiments.methods CMU_DIR [given]`.

Five optimisers in three priors follow a walk and a run of CMU, seen from three sides, with five seeds each. With
`given` the first frame starts around the true pose, as in papers that begin by hand; without, it has to be found.
"""

import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from posefit.tracking.front import track

OPTIMISERS = ("particle", "annealed", "pso", "sapso", "cma")
PRIORS: dict[str, tuple[str, dict[str, Any]]] = {
    "pca": ("pca", {}),
    "full, training range": ("full", {"limits": "training"}),  # constraint 1 of the paper, on all angles
    "full, joint limits": ("full", {"limits": "asf"}),
}
CASES = {"walk": ("16/16_17", ("16/16_15",)), "run": ("16/16_35", ("09/09_01", "127/127_03"))}
VIEWS = (0.0, 45.0, 90.0)
SEEDS = range(5)
FRAMES = (0, 60)  # at 30 fps; the run has 41
WORKERS = 2

Cell = tuple[str, str, str, float, int]


def follow(root: Path, first_pose: Any, cell: Cell) -> dict[str, Any]:
    """Return the summary of one track."""
    optimiser, prior, motion, view, seed = cell
    test, train = CASES[motion]
    return track(
        root / f"{test}.amc",
        train=[root / f"{name}.amc" for name in train],
        optimiser=optimiser,
        prior=PRIORS[prior][0],
        prior_settings=PRIORS[prior][1],
        view_degrees=view,
        frames=FRAMES,
        first_pose=first_pose,
        seed=seed,
    ).summary


def rows(found: dict[Cell, dict[str, Any]]) -> Iterator[str]:
    """Yield a table row for each optimiser and prior: the median over seeds of what is a mean over frames."""
    for prior, optimiser in product(PRIORS, OPTIMISERS):
        figures = []
        seconds = []
        for motion in CASES:
            cells = {view: [found[optimiser, prior, motion, view, seed] for seed in SEEDS] for view in VIEWS}
            errors = {view: [one["error_degrees"]["mean"] for one in cells[view]] for view in VIEWS}
            every = [one for view in VIEWS for one in cells[view]]
            by_seed = np.mean([errors[view] for view in VIEWS], axis=0)
            figures += [
                f"{np.median(by_seed):.2f} ({by_seed.min():.2f} to {by_seed.max():.2f})",
                " ".join(f"{np.median(errors[view]):.2f}" for view in VIEWS),
                f"{np.mean([one['skill']['mean_pose'] for one in every]):.2f}",
                f"{100 * np.mean([one['swap_rate'] for one in every]):.0f}",
                f"{100 * np.mean([one['lost_rate'] for one in every]):.0f}",
            ]
            seconds += [one["seconds_per_frame"] for one in every]
        used = np.mean(
            [one["evaluations"] / one["frames"] for key, one in found.items() if key[:2] == (optimiser, prior)]
        )
        yield f"| {optimiser} | {prior} | {' | '.join(figures)} | {np.median(seconds):.3f} | {used:.0f} |"


def main(root: Path, first_pose: str = "searched") -> None:
    """Print the table."""
    cells: list[Cell] = list(product(OPTIMISERS, PRIORS, CASES, VIEWS, SEEDS))
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        jobs = zip(*[(root, first_pose, cell) for cell in cells], strict=True)
        summaries = list(tqdm(pool.map(follow, *jobs), total=len(cells), unit="track"))
    found = dict(zip(cells, summaries, strict=True))
    heads = [
        f"{motion} {what}" for motion in CASES for what in ("error", "at 0, 45, 90", "skill", "swapped %", "lost %")
    ]
    print(f"| optimiser | prior | {' | '.join(heads)} | s a frame | evaluations |")
    print("|---|---|" + "---:|" * (len(heads) + 2))
    for row in rows(found):
        print(row)
    for motion in CASES:
        baselines = next(one for key, one in found.items() if key[2] == motion)
        floor = baselines["prior_floor_degrees"]
        print(f"{motion}: {baselines['baselines_degrees']}, floor of pca {floor:.2f}")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: python -m posefit_experiments.methods CMU_DIR [given]")
    main(Path(sys.argv[1]), *sys.argv[2:])
