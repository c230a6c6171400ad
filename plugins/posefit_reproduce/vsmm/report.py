"""What `posefit reproduce vsmm` prints and writes."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from posefit.version import __version__
from posefit_reproduce.jobs import Progress, figures_folder
from posefit_reproduce.vsmm.activities import ACTIVITIES, film_of
from posefit_reproduce.vsmm.experiment import SHOWN, WORKERS, repeat_patent

_FIGURES = (
    ("elbow_detected_cm", "elbow to the detected, cm", 1),
    ("hand_detected_cm", "hand to the detected, cm", 1),
    ("elbow_cm", "elbow to the truth, cm", 1),
    ("hand_cm", "hand to the truth, cm", 1),
    ("elbow_3d_cm", "elbow in space, cm", 1),
    ("hand_3d_cm", "hand in space, cm", 1),
    ("mpjpe_mm", "MPJPE, mm", 0),
    ("error_degrees", "error, degrees", 2),
    ("iou", "IoU", 2),
    ("dominant_fraction", "a model dominates", 2),
    ("right_model_fraction", "the right model", 2),
    ("right_group_fraction", "the right group", 2),
    ("switch_delay_frames", "longest delay, frames", 1),
    ("activations", "activations", 1),
    ("wrong_activations", "wrong activations", 1),
    ("wrong_terminations", "wrong terminations", 1),
    ("activity_accuracy", "right activity label", 2),
    ("chance", "by chance", 2),
    ("filter_ms", "filter, ms", 2),
    ("detection_ms", "detection, ms", 2),
    ("frame_ms", "frame, ms", 2),
)
_CHANGES = (
    ("worse_mm", "worse by mm", 1),
    ("worse_films", "films", 0),
    ("mpjpe_mm", "MPJPE", 0),
    ("error_degrees", "degrees", 2),
    ("elbow_cm", "elbow", 1),
    ("hand_cm", "hand", 1),
    ("right_model_fraction", "model", 2),
    ("right_group_fraction", "group", 2),
    ("switch_delay_frames", "delay", 1),
    ("activations", "activations", 1),
    ("frame_ms", "frame ms", 1),
)
_KEYS = ("still_1", "identity_1", "zero_1", "still_10", "identity_10", "zero_10")


def patent_report(
    seeds: int,
    searches: bool,
    alternatives: bool,
    out: str | Path | None,
    workers: int = WORKERS,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return the experiment's figures; with `out`, write them and the pictures to a new folder, whole or not at all.

    Raises ValueError where seeds is no positive number or the folder cannot be written, and ImportError where the
    pictures need a library that is not installed.
    """
    with figures_folder(out) as folder:
        figures, shown = repeat_patent(seeds, searches, alternatives, workers, progress)
        figures["version"] = __version__
        if folder is not None:
            from posefit_reproduce.vsmm.figures import patent_figures

            patent_figures(film_of(SHOWN), shown, folder)
            (folder / "report.json").write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return figures


def patent_text(figures: Mapping[str, Any]) -> str:
    """Return the figures as tables: means over seeds, the models' predictions, and the labels of activities."""

    def cell(row: Mapping[str, Any], key: str, digits: int) -> str:
        return f"{row[key]:.{digits}f}" if key in row else "-"

    methods = figures["methods"]
    compared = {name: row for name, row in methods.items() if "worse_mm" not in row}
    rows = {label: [cell(row, key, digits) for row in compared.values()] for key, label, digits in _FIGURES}
    parts = [
        _table(f"seeds: {figures['seeds']}", list(compared), rows),
        "the patent: elbow and hand to the detected 2.7 to 5.2 cm, filter 100 ms, detection 1000 ms",
    ]
    changed = {name: row for name, row in methods.items() if name not in compared}
    if changed:
        rows = {name: [cell(row, key, digits) for key, _, digits in _CHANGES] for name, row in changed.items()}
        parts.append(_table("against default", [label for _, label, _ in _CHANGES], rows))
    rows = {name: [f"{report[key]:.2f}" for key in _KEYS] for name, report in figures["prediction_degrees"].items()}
    labels = ["still, 1", "default, 1", "patent, 1", "still, 10", "default, 10", "patent, 10"]
    parts.append(_table("degrees ahead", labels, rows))
    labels = [activity.label for activity in ACTIVITIES]
    for preset in ("default", "patent"):
        counts = np.sum([row["confusion"] for row in methods[preset]["per_seed"]], axis=0)
        shares = counts / counts.sum(axis=1, keepdims=True)
        rows = {label: [f"{share:.2f}" for share in row] for label, row in zip(labels, shares, strict=True)}
        parts.append(_table(f"labels, {preset}", [*labels, "a jump"], rows))
    return "\n\n".join(parts)


def _table(corner: str, labels: Sequence[str], rows: Mapping[str, Sequence[str]]) -> str:
    first = max(len(name) for name in (corner, *rows))
    widths = [max(len(label), 6) + 2 for label in labels]
    return "\n".join(
        name.ljust(first) + "".join(cell.rjust(width) for cell, width in zip(cells, widths, strict=True))
        for name, cells in {corner: labels, **rows}.items()
    )
