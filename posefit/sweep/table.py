"""The rows of a ledger as a pandas table, or as a CSV file.

`Ledger.frame` returns the pandas table, with one row per cell. Its columns are:

- `key`, `version`, `status` ("done" or "quarantined") and `reason`
- the cell's spec, with `settings`, `corruption`, `train`, `view_degrees` and `size` as
  text, so that rows can be grouped by them
- every figure; a group of figures has columns such as `error_degrees.mean`,
  `skill.nearest` and `baselines_degrees.mean_pose`
- `joint_errors_mm.NAME` for each of the 27 joints
- `seconds`, `seconds_per_frame` and `cpu_seconds_per_frame`, the only figures that
  differ when a cell runs again

Rows are sorted by their spec, not by the time when they were finished.
"""

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from posefit.errors import InputError
from posefit.geometry.skeleton import JOINTS
from posefit.measuring.tables import import_pandas
from posefit.settings import settings_text

if TYPE_CHECKING:
    import pandas as pd

ORDER = (
    "motion",
    "view_degrees",
    "corruption",
    "suite",
    "function",
    "dimension",
    "instance",
    "method",
    "settings",
    "seed",
    "key",
)
FORMULA_SIGNS = ("=", "+", "-", "@", "\t", "\r")
_TEXTS = (
    "key",
    "version",
    "status",
    "reason",
    "kind",
    "method",
    "name",
    "motion",
    "train",
    "settings",
    "view_degrees",
    "corruption",
)


def dataframe(rows: Iterable[Mapping[str, Any]]) -> "pd.DataFrame":
    """Return the pandas table of a ledger's rows, finished or quarantined.

    Args:
        rows: Rows as `posefit.sweep.ledger.Ledger.all_rows` yields them.

    Returns:
        The table. This module's docstring describes its columns.

    Raises:
        ImportError: pandas is not installed.
    """
    pandas = import_pandas()
    table: pd.DataFrame = pandas.DataFrame(
        [{**dict.fromkeys(_TEXTS), **flat(row)} for row in rows]
    )
    if table.empty:
        return table.reindex(columns=list(_TEXTS))
    # tracks have no function, and searches no motion
    order = [name for name in ORDER if name in table]
    return table.sort_values(order, ignore_index=True)


def flat(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns of one row of a ledger, by name."""
    spec = row["spec"]
    columns: dict[str, Any] = {
        "key": row["key"],
        "version": spec["version"],
        "status": row["status"],
        "reason": "; ".join(row.get("reasons", [])),
    }
    for name, value in spec.items():
        if name not in ("files", "version"):
            columns[name] = value
    columns["settings"] = ", ".join(settings_text(spec["settings"]))
    if spec["kind"] == "track":
        columns["corruption"] = ", ".join(damage(spec))
        columns["train"] = ", ".join(spec["train"])
        columns["view_degrees"] = ", ".join(views(spec))
        columns["size"] = "x".join(map(str, spec["size"]))
    for name, value in row.items():
        if name in ("key", "spec", "status", "reasons", "trace", "mode_reliability"):
            continue
        if name == "joint_errors_mm":
            for joint, error in zip(JOINTS, value, strict=True):
                columns[f"{name}.{joint}"] = error
        elif isinstance(value, Mapping):
            for part, figure in value.items():
                columns[f"{name}.{part}"] = figure
        elif isinstance(value, list):
            columns[name] = "; ".join(value)
        else:
            columns[name] = value
    return columns


def views(spec: Mapping[str, Any]) -> list[str]:
    """Return the directions of a track's cameras in degrees."""
    return [f"{view:g}" for view in spec["view_degrees"]]


def damage(spec: Mapping[str, Any]) -> list[str]:
    """Return the kinds of damage of a track's masks with their strengths."""
    kinds = sorted(spec["corruption"].items())
    return [f"{kind} {strength:g}" for kind, strength in kinds]


def write_csv(rows: Iterable[Mapping[str, Any]], path: str | Path) -> None:
    """Write rows as a CSV file in UTF-8.

    The file has all columns that any row has, in the order of their first row. Missing
    values are empty. If a spreadsheet would run a text as a formula, an apostrophe is
    put before it.

    Args:
        rows: The values of each row by column.
        path: The file.

    Raises:
        ValueError: There is no row.
        OSError: The file cannot be written.
    """
    table = list(rows)
    if not table:
        raise InputError("rows must contain at least one row, got none")
    columns: dict[str, None] = {}  # an ordered set
    for row in table:
        columns.update(dict.fromkeys(row))
    with Path(path).open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, restval="")
        writer.writeheader()
        for row in table:
            writer.writerow({name: _inert(value) for name, value in row.items()})


def _inert(value: Any) -> Any:
    """Return a value of a CSV file that no spreadsheet runs as a formula."""
    # names in a ledger may come from anybody
    if isinstance(value, str) and value.startswith(FORMULA_SIGNS):
        return f"'{value}"
    return value
