"""The rows of a ledger as a table of pandas, one row a cell: `Ledger.frame` gives it; as CSV; or as runs of a suite.

Columns are `key`, `version`, `status` ("done" or "quarantined"), `reason`; the cell's spec, with `settings`,
`corruption`, `train`, `view_degrees` and `size` as text, so that rows can be grouped by them; every figure, those of a
kind as `error_degrees.mean`, `skill.nearest`, `baselines_degrees.mean_pose`; `joint_errors_mm.NAME` of the 27 joints;
and `seconds`, `seconds_per_frame` and `cpu_seconds_per_frame`, the only ones that differ when a cell is run again. Rows
are sorted by what the spec says, not by when they were finished.
"""

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from posefit.errors import InputError
from posefit.files import new_file
from posefit.geometry.skeleton import JOINTS
from posefit.measuring.tables import import_pandas
from posefit.settings import settings_text
from posefit.suites.problem import TARGETS
from posefit.suites.running import SuiteRun

if TYPE_CHECKING:
    import pandas as pd

ORDER = (
    "motion",
    "view_degrees",
    "corruption",
    "instance",
    "method",
    "settings",
    "seed",
    "key",
)
FORMULA_SIGNS = ("=", "+", "-", "@", "\t", "\r")
_TEXTS = (
    "key", "version", "status", "reason", "kind", "method", "name", "motion", "train", "settings", "view_degrees",
    "corruption",
)  # fmt: skip


def dataframe(rows: Iterable[Mapping[str, Any]]) -> "pd.DataFrame":
    """Return the table of rows, finished or quarantined. Raises ImportError where pandas is not installed."""
    pandas = import_pandas()
    table: pd.DataFrame = pandas.DataFrame(
        [{**dict.fromkeys(_TEXTS), **flat(row)} for row in rows]
    )
    if table.empty:
        return table.reindex(columns=list(_TEXTS))
    return table.sort_values(list(ORDER), ignore_index=True)


def flat(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the columns of a row of a ledger."""
    spec = row["spec"]
    columns: dict[str, Any] = {
        "key": row["key"],
        "version": spec["version"],
        "status": row["status"],
    }
    columns["reason"] = "; ".join(row["reasons"]) if "reasons" in row else ""
    columns |= {
        name: value for name, value in spec.items() if name not in ("files", "version")
    }
    columns["settings"] = ", ".join(settings_text(spec["settings"]))
    if spec["kind"] == "track":
        columns |= {
            "corruption": ", ".join(
                f"{kind} {strength:g}"
                for kind, strength in sorted(spec["corruption"].items())
            ),
            "train": ", ".join(spec["train"]),
            "view_degrees": ", ".join(f"{view:g}" for view in spec["view_degrees"]),
            "size": "x".join(map(str, spec["size"])),
        }
    for name, value in row.items():
        if name in ("key", "spec", "status", "reasons", "trace", "mode_reliability"):
            continue
        if name == "joint_errors_mm":
            columns |= {
                f"{name}.{joint}": error
                for joint, error in zip(JOINTS, value, strict=True)
            }
        elif isinstance(value, Mapping):
            columns |= {f"{name}.{part}": figure for part, figure in value.items()}
        else:
            columns[name] = "; ".join(value) if isinstance(value, list) else value
    return columns


def write_csv(rows: Iterable[Mapping[str, Any]], path: str | Path) -> None:
    """Write rows as a new CSV file, in UTF-8; columns are all that any row has, in the order of their first row.

    Missing values are left empty. A text that a spreadsheet would run as a formula begins with an apostrophe. Raises
    ValueError if there is no row, or if the file exists or cannot be written.
    """
    table = list(rows)
    if not table:
        raise InputError("rows must be at least one, got none")
    with (
        new_file(path) as building,
        building.open("w", newline="", encoding="utf-8") as file,
    ):
        writer = csv.DictWriter(
            file, list(dict.fromkeys(name for row in table for name in row)), restval=""
        )
        writer.writeheader()
        for row in table:
            writer.writerow({name: _inert(value) for name, value in row.items()})


def _inert(value: Any) -> Any:
    """Return a value of a CSV file; names in a ledger may come from anybody, and spreadsheets run formulas."""
    if isinstance(value, str) and value.startswith(FORMULA_SIGNS):
        return f"'{value}"
    return value


def search_run(row: Mapping[str, Any]) -> SuiteRun:
    """Return the run of a row of a single search."""
    spec = row["spec"]
    trace = row["trace"]
    return SuiteRun(
        **{
            name: value
            for name, value in spec.items()
            if name not in ("kind", "name", "evaluations", "version")
        },
        budget=spec["evaluations"],
        truth_cost=row["truth_cost"],
        targets=row["truth_cost"] + TARGETS,
        evaluations=np.array(trace["evaluations"], dtype=np.float64),
        costs=np.array(trace["cost"], dtype=np.float64),
    )
