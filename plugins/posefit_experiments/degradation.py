"""How much worse a track gets as its silhouettes do: `python -m posefit_experiments.degradation OUT.png`.

Known truth, view 45, the same budget, seeds 0 to 4; prints the table that the figure shows.
"""

import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from posefit.geometry.body import varied
from posefit.tracking.method import Choice
from posefit.tracking.synthetic import Spoilt, followed, mean_error, measured, scene_of, task_of

STRENGTHS = (0.0, 0.25, 0.5, 0.75, 1.0)
SEEDS = range(5)
MOTION, VIEW = "walk", 45.0
MISMATCH = 10.0  # percent at strength 1
DROPPED = 0.8  # share of the frames at strength 1
KINDS = ("holes", "blobs", "shadow", "jitter", "occluder", "dropped frames", "body mismatch")

Curve = Mapping[str, list[list[dict[str, float]]]]  # kind: for every strength, for every seed


def curves(optimiser: str = "sapso", prior: str = "pca") -> tuple[Curve, float]:
    """Return what every kind and strength of damage leaves of a track, and the mean pose's error in degrees."""
    scene, choice = scene_of(MOTION, [VIEW]), Choice(optimiser=optimiser, prior=prior)
    found: dict[str, list[list[dict[str, float]]]] = {}
    for kind in KINDS:
        found[kind] = []
        for strength in STRENGTHS:
            row = []
            for seed in SEEDS:
                percent = MISMATCH * strength if kind == "body mismatch" else 0.0
                body = varied(scene.body, percent, np.random.default_rng(seed))
                dropped = DROPPED * strength if kind == "dropped frames" else 0.0
                noise = {} if kind in ("body mismatch", "dropped frames") else {kind: strength}
                seen = Spoilt(scene.observations, noise, dropped, seed)
                row.append(measured(scene, followed(task_of(scene, choice, body), choice, seen, seed)))
            found[kind].append(row)
            print(f"{kind:16} {strength:4.2f} {_line(row)}", flush=True)
    return found, mean_error(scene, task_of(scene, choice, scene.body))


def _line(row: list[dict[str, float]]) -> str:
    errors, lost = ([one[key] for one in row] for key in ("error_degrees", "lost"))
    low, middle, high = min(errors), float(np.median(errors)), max(errors)
    return f"error {middle:5.2f} ({low:.2f} to {high:.2f}) degrees, lost {100 * np.mean(lost):3.0f} %"


def figure(found: Curve, mean: float, path: Path) -> None:
    """Draw error and lost frames against strength; the bands are the range over seeds."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(9.0, 3.6), layout="constrained")
    for axes, key, label, scale in zip(
        drawn.subplots(1, 2), ("error_degrees", "lost"), ("error, degrees", "lost frames, %"), (1, 100), strict=True
    ):
        for kind, rows in found.items():
            values = scale * np.array([[one[key] for one in row] for row in rows])
            (line,) = axes.plot(STRENGTHS, np.median(values, axis=1), marker="o", markersize=3, label=kind)
            axes.fill_between(STRENGTHS, values.min(axis=1), values.max(axis=1), color=line.get_color(), alpha=0.1)
        axes.set_xlabel("strength")
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0.0)
        axes.spines[["top", "right"]].set_visible(False)
        if key == "error_degrees":
            axes.axhline(mean, color="0.5", linestyle=":", label="mean training pose")
            axes.legend(fontsize=7, frameon=False)
    drawn.savefig(path, dpi=120)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m posefit_experiments.degradation OUT.png")
    if find_spec("matplotlib") is None:  # known before the minutes that the tracks take
        sys.exit("the figure needs the library matplotlib: pip install posefit[figures]")
    figure(*curves(), Path(sys.argv[1]))
