"""What `posefit reproduce vsmm` prints and writes."""

import json
from collections.abc import Mapping
from contextlib import nullcontext
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from posefit.files import new_folder
from posefit.version import __version__
from posefit_reproduce.jobs import Progress
from posefit_reproduce.vsmm.activities import film_of
from posefit_reproduce.vsmm.experiment import SHOWN, WORKERS, repeat_patent

_COLUMNS = (
    ("elbow_cm", "elbow cm", 1),
    ("hand_cm", "hand cm", 1),
    ("elbow_3d_cm", "elbow 3D", 1),
    ("hand_3d_cm", "hand 3D", 1),
    ("mpjpe_mm", "MPJPE mm", 0),
    ("error_degrees", "degrees", 2),
    ("iou", "IoU", 2),
    ("dominant_fraction", "dominant", 2),
    ("switch_delay_frames", "delay", 1),
    ("wrong_activations", "wrong act.", 1),
    ("wrong_terminations", "wrong term.", 1),
    ("filter_ms", "filter ms", 2),
    ("detection_ms", "detect ms", 1),
    ("frame_ms", "frame ms", 1),
)


def patent_report(
    seeds: int,
    searches: bool,
    out: str | Path | None,
    workers: int = WORKERS,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return the experiment's figures; with `out`, write them and the pictures to a new folder, whole or not at all.

    Raises ValueError where seeds is no positive number or the folder cannot be written, and ImportError where the
    pictures need a library that is not installed.
    """
    if out is not None and find_spec("matplotlib") is None:
        raise ImportError("the figures need the library matplotlib: pip install posefit[figures]")
    with nullcontext() if out is None else new_folder(out) as folder:
        figures, shown = repeat_patent(seeds, searches, workers, progress)
        figures["version"] = __version__
        if folder is not None:
            from posefit_reproduce.vsmm.figures import patent_figures

            patent_figures(film_of(SHOWN), shown.frames, folder)
            (folder / "report.json").write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return figures


def patent_table(figures: Mapping[str, Any]) -> str:
    """Return the figures as a table: a row a method, the means over seeds."""
    rows: dict[str, Mapping[str, Any]] = {"vsmm": figures}
    rows |= {name: one for name, one in figures.items() if isinstance(one, Mapping)}
    lines = ["  ".join([f"seeds: {figures['seeds']:.0f}".ljust(12), *(label.rjust(10) for _, label, _ in _COLUMNS)])]
    for name, row in rows.items():
        cells = [f"{row[key]:.{digits}f}" if key in row else "-" for key, _, digits in _COLUMNS]
        lines.append("  ".join([name.ljust(12), *(cell.rjust(10) for cell in cells)]))
    lines.append("the patent: elbow and hand 2.7 to 5.2 cm, filter 100 ms, detection 1000 ms")
    return "\n".join(lines)
