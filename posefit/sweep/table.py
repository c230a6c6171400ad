"""The rows of a ledger as a table of pandas, one row a cell: `Ledger.frame` gives it.

Columns are `key`, `version`, `status` ("done" or "quarantined"), `reason`; the cell's spec, with `settings`,
`corruption`, `train`, `view_degrees` and `size` as text, so that rows can be grouped by them; every figure, those of a
kind as `error_degrees.mean`, `skill.nearest`, `baselines_degrees.mean_pose`; `joint_errors_mm.NAME` of the 27 joints;
and `seconds`, `seconds_per_frame` and `cpu_seconds_per_frame`, the only ones that differ when a cell is run again. Rows
are sorted by what the spec says, not by when they were finished.
"""

import importlib
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from posefit.geometry.skeleton import JOINTS
from posefit.sweep.cell import in_full, settings_text

if TYPE_CHECKING:
    import pandas as pd

ORDER = ("motion", "view_degrees", "corruption", "instance", "method", "settings", "seed", "key")
_TEXTS = ("key", "version", "status", "reason", "method", "motion", "train", "settings", "view_degrees", "corruption")


def is_search(spec: Mapping[str, Any]) -> bool:
    """Return whether a spec is that of a single search, which has no motion: see `posefit.sweep.single`."""
    return "suite" in spec


def dataframe(rows: Iterable[Mapping[str, Any]]) -> "pd.DataFrame":
    """Return the table of rows, finished or quarantined. Raises ImportError where pandas is not installed."""
    try:
        pandas = importlib.import_module("pandas")
    except ImportError as error:
        raise ImportError("tables need the library pandas: python -m pip install 'posefit[sweep]'") from error
    columns: dict[str, list[Any]] = {name: [] for name in _TEXTS}
    count = 0
    for row in rows:
        _add(columns, count, flat(row))
        count += 1
    for values in columns.values():
        values.extend([None] * (count - len(values)))
    table: pd.DataFrame = pandas.DataFrame({name: pandas.Series(values) for name, values in columns.items()})
    return table.sort_values(list(ORDER), ignore_index=True) if count else table


def _add(columns: dict[str, list[Any]], count: int, values: Mapping[str, Any]) -> None:
    for name, value in values.items():
        column = columns.setdefault(name, [])
        if len(column) < count:
            column.extend([None] * (count - len(column)))
        column.append(value)


def flat(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns of a row of a ledger."""
    spec = row["spec"]
    flat: dict[str, Any] = {"key": row["key"], "version": spec["version"], "status": row["status"]}
    flat["reason"] = "; ".join(row["reasons"]) if "reasons" in row else ""
    searched = is_search(spec)
    full = spec if searched else in_full(spec)
    flat |= {name: value for name, value in full.items() if name not in ("files", "version")}
    flat["settings"] = ", ".join(settings_text(spec["settings"]))
    if not searched:
        flat |= _told_of_track(spec)
    for name, value in row.items():
        if name in ("key", "spec", "status", "reasons", "trace", "mode_reliability", "joints"):
            continue
        if name == "joint_errors_mm":
            flat |= {f"{name}.{joint}": error for joint, error in zip(JOINTS, value, strict=True)}
        elif isinstance(value, Mapping):
            flat |= {f"{name}.{inner}": one for inner, one in value.items()}
        else:
            flat[name] = "; ".join(value) if isinstance(value, list) else value
    return flat


def _told_of_track(spec: Mapping[str, Any]) -> dict[str, str]:
    """Return those columns of a track's spec that are texts."""
    return {
        "corruption": ", ".join(f"{kind} {strength:g}" for kind, strength in sorted(spec["corruption"].items())),
        "train": ", ".join(spec["train"]),
        "view_degrees": ", ".join(f"{view:g}" for view in spec["view_degrees"]),
        "size": "x".join(map(str, spec["size"])),
    }
