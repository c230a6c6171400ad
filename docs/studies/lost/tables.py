"""What the tracks come to: how well lost frames and swapped sides are told, by group, number of views and condition."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from lost.model import Said, lost_frames, swapped_frames
from posefit.arrays import Array
from posefit.tracking.evaluation import LOST
from posefit.uncertainty.calibration import auroc, calibration_error, false_alarms, kept_errors

Row = Mapping[str, Any]
T = TypeVar("T")

RECALLS = (0.9, 0.95)
SHARES = (0.25, 0.5, 0.75, 0.9, 1.0)  # of frames that are kept, the least doubted first
NEAR_MM = (100.0, 200.0)  # frames in between are neither clearly lost nor clearly not


def lost_tables(rows: Sequence[Row], doubts: Sequence[Array]) -> dict[str, Any]:
    """Return the tables of rows whose frames have such doubts (T,): probabilities, or else whatever grows with them."""
    every = list(zip(rows, doubts, strict=True))
    return {
        "frames": sum(len(one) for one in doubts),
        "lost": [_figures(name, part) for name, part in _parted(every)],
        "kept": {
            f"{share:g}": float(error)
            for share, error in zip(SHARES, kept_errors(_errors(rows), np.concatenate(doubts), SHARES), strict=True)
        },
    }


def _parted(every: Sequence[tuple[Row, T]]) -> Iterator[tuple[str, list[tuple[Row, T]]]]:
    """Yield all rows with what is said of them; then those of each group, number of views and condition, by name."""
    yield "all", list(every)
    for of in (_group, _cameras, _condition):
        for name in dict.fromkeys(of(row) for row, _ in every):
            yield name, [one for one in every if of(one[0]) == name]


def _group(row: Row) -> str:
    return str(row["group"])


def _cameras(row: Row) -> str:
    count = len(row["views_degrees"])
    return f"{count} camera{'s' * (count > 1)}"


def _condition(row: Row) -> str:
    return str(row["condition"])


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


def sides_table(rows: Sequence[Row], said: Sequence[Said]) -> list[dict[str, Any]]:
    """Return how often sides are exchanged, called unknown, and both, of all rows and of parts of them."""
    every = list(zip(rows, said, strict=True))
    return [_sides_figures(name, part) for name, part in _parted(every)]


def _sides_figures(name: str, found: Sequence[tuple[Row, Said]]) -> dict[str, Any]:
    swapped = swapped_frames([row for row, _ in found])
    exchanged, unknown = (np.concatenate([getattr(one, key) for _, one in found]) for key in ("exchanged", "unknown"))

    def share(flags: Any, of: Any) -> float | None:
        return float(flags[of].mean()) if of.any() else None

    return {
        "name": name,
        "tracks": len(found),
        "frames": len(swapped),
        "swapped": float(swapped.mean()),
        "auroc": auroc(exchanged, swapped),
        "calibration_error": calibration_error(exchanged, swapped),
        "unknown": float(unknown.mean()),
        "unknown_right": share(unknown, ~swapped),
        "swapped_unknown": share(swapped, unknown),
        "swapped_known": share(swapped, ~unknown),
    }


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
    if "sides" in told:
        yield ""
        yield from _sides_lines(told["sides"])


def _sides_lines(table: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the table as it is printed."""
    heads = ["tracks", "frames", "swapped %", "AUROC", "calibration error", "unknown %", "unknown of right ones %"]
    heads += ["swapped of unknown ones %", "swapped of known ones %"]
    yield f"| {' | '.join(['', *heads])} |"
    yield "|" + "---|" + "---:|" * len(heads)
    for one in table:
        cells = [one["name"], str(one["tracks"]), str(one["frames"]), _percent(one["swapped"])]
        cells += [_number(one["auroc"]), _number(one["calibration_error"])]
        cells += [_percent(one[key]) for key in ("unknown", "unknown_right", "swapped_unknown", "swapped_known")]
        yield f"| {' | '.join(cells)} |"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.1f}"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
