"""Rows of footage made from the truth as tables: each row, and those who pass beside those who are always there."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from composites.situations import ALWAYS, PASSING

Row = Mapping[str, Any]

# What a table shows of a row: its head, digits, and what a value is multiplied by.
COLUMNS: Mapping[str, tuple[str, int, float]] = {
    "mask_iou": ("mask IoU", 2, 1.0),
    "body_iou": ("body IoU", 2, 1.0),
    "claimed_iou": ("own IoU", 2, 1.0),
    "mpjpe_mm": ("MPJPE mm", 0, 1.0),
    "place_mm": ("place mm", 0, 1.0),
    "facing_right": ("facing %", 0, 100.0),
    "lost": ("lost %", 0, 100.0),
    "said_lost": ("said lost %", 0, 100.0),
    "swapped": ("swapped %", 0, 100.0),
    "said_unknown": ("unknown %", 0, 100.0),
    "acceleration": ("m/s2", 1, 1.0),
    "true_acceleration": ("true m/s2", 1, 1.0),
    "slide_cm": ("slide cm", 1, 1.0),
    "own_slide_cm": ("own cm", 1, 1.0),
    "true_slide_cm": ("true cm", 1, 1.0),
}
GROUPS = {"passing": PASSING, "always there": ALWAYS}
COMPARED = ("mask_iou", "body_iou", "mpjpe_mm", "facing_right", "lost", "swapped", "acceleration", "own_slide_cm")


def by_presence(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return the means over rows of those who pass and of those who are always there, by extraction and cameras.

    Of what was refused there are no figures; `refused` is how many rows that are.
    """
    found = []
    for extraction, views in dict.fromkeys((row["extraction"], row["views"]) for row in rows):
        for group, situations in GROUPS.items():
            mine = [
                row
                for row in rows
                if (row["extraction"], row["views"]) == (extraction, views) and row["situation"] in situations
            ]
            told = [row for row in mine if "refused" not in row]
            if mine:
                means = {name: _mean([row.get(name) for row in told]) for name in COMPARED}
                counts = {"rows": len(mine), "refused": len(mine) - len(told)}
                found.append({"extraction": extraction, "views": views, "group": group, **counts, **means})
    return found


def composites_lines(told: Mapping[str, Any]) -> Iterator[str]:
    """Yield a line a row, then one for each group of situations."""
    names = [name for name in COLUMNS if any(name in row for row in told["rows"])]
    yield f"{'situation':10} {'cameras':>7} {'extraction':10} {'seed':>4} " + _heads(names)
    for row in told["rows"]:
        start = f"{row['situation']:10} {row['views']:7} {row['extraction']:10} {row['seed']:4} "
        yield start + (f" refused: {row['refused']}" if "refused" in row else _cells(row, names))
    yield ""
    yield f"{'means':12} {'cameras':>7} {'extraction':10} {'rows':>4} {'refused':>7} " + _heads(COMPARED)
    for one in told["groups"]:
        start = f"{one['group']:12} {one['views']:7} {one['extraction']:10} {one['rows']:4} {one['refused']:7} "
        yield start + _cells(one, COMPARED)


def _heads(names: Sequence[str]) -> str:
    return " ".join(f"{COLUMNS[name][0]:>11}" for name in names)


def _cells(row: Row, names: Sequence[str]) -> str:
    return " ".join(f"{_shown(row.get(name), *COLUMNS[name][1:]):>11}" for name in names)


def _shown(value: float | None, digits: int, factor: float) -> str:
    return "-" if value is None else f"{factor * value:.{digits}f}"


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
