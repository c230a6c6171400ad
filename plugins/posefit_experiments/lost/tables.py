"""What the tracks come to: how well lost frames are told, by group, number of views and condition."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.posterior.calibration import auroc, calibration_error, false_alarms, kept_errors
from posefit.tracking.evaluation import LOST
from posefit_experiments.lost.model import lost_frames

Row = Mapping[str, Any]

RECALLS = (0.9, 0.95)
SHARES = (0.25, 0.5, 0.75, 0.9, 1.0)  # of frames that are kept, the least doubted first
NEAR_MM = (100.0, 200.0)  # frames in between are neither clearly lost nor clearly not


def lost_tables(rows: Sequence[Row], doubts: Sequence[Array]) -> dict[str, Any]:
    """Return the tables of rows whose frames have such doubts (T,): probabilities, or else whatever grows with them."""
    every = list(zip(rows, doubts, strict=True))
    return {
        "frames": sum(len(one) for one in doubts),
        "lost": [
            _figures("all", every),
            *_split(every, lambda row: row["group"]),
            *_split(every, lambda row: f"{len(row['views_degrees'])} camera{'s' * (len(row['views_degrees']) > 1)}"),
            *_split(every, lambda row: row["condition"]),
        ],
        "kept": {
            f"{share:g}": float(error)
            for share, error in zip(SHARES, kept_errors(_errors(rows), np.concatenate(doubts), SHARES), strict=True)
        },
    }


def _split(every: Sequence[tuple[Row, Array]], of: Any) -> Iterator[dict[str, Any]]:
    for name in dict.fromkeys(of(row) for row, _ in every):
        yield _figures(name, [one for one in every if of(one[0]) == name])


def _figures(name: str, found: Sequence[tuple[Row, Array]]) -> dict[str, Any]:
    rows, told = [row for row, _ in found], np.concatenate([doubts for _, doubts in found])
    lost, errors = lost_frames(rows), _errors(rows)
    clear = (errors < NEAR_MM[0]) | (errors > NEAR_MM[1])
    likely = bool(told.min() >= 0.0 and told.max() <= 1.0)
    said = told >= LOST
    return {
        "name": name,
        "tracks": len(rows),
        "frames": len(lost),
        "lost_rate": float(lost.mean()),
        "auroc": auroc(told, lost),
        "auroc_clear": auroc(told[clear], lost[clear]) if clear.any() else None,
        **{f"false_alarms_{100 * recall:.0f}": false_alarms(told, lost, recall) for recall in RECALLS},
        "said_recall": float(said[lost].mean()) if likely and lost.any() else None,
        "said_false_alarms": float(said[~lost].mean()) if likely and not lost.all() else None,
        "calibration_error": calibration_error(told, lost) if likely else None,
    }


def _errors(rows: Sequence[Row]) -> Array:
    return np.concatenate([np.array(row["mpjpe_mm"]) for row in rows])


def lost_lines(told: Mapping[str, Any]) -> Iterator[str]:
    """Yield the tables as they are printed."""
    heads = ["tracks", "frames", "lost %", "AUROC", "AUROC, clear cases"]
    heads += [f"false alarms at {100 * recall:.0f} % recall, %" for recall in RECALLS]
    heads += ["called lost: recall %", "false alarms %", "calibration error"]
    yield f"| {' | '.join(['', *heads])} |"
    yield "|" + "---|" + "---:|" * len(heads)
    for one in told["lost"]:
        shares = [one[f"false_alarms_{100 * recall:.0f}"] for recall in RECALLS]
        cells = [one["name"], str(one["tracks"]), str(one["frames"]), _percent(one["lost_rate"])]
        cells += [_number(one["auroc"]), _number(one["auroc_clear"]), *(_percent(share) for share in shares)]
        cells += [_percent(one["said_recall"]), _percent(one["said_false_alarms"]), _number(one["calibration_error"])]
        yield f"| {' | '.join(cells)} |"
    yield ""
    kept = (f"{100 * float(share):g} % kept {error:.0f} mm" for share, error in told["kept"].items())
    yield f"mean MPJPE, least doubted frames first: {', '.join(kept)}"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.1f}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
