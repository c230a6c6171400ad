"""People whom the library has never seen, followed; the rows of all tracks, and what they come to."""

import json
from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any

from people.clips import GROUPS, WALKS
from people.closest import closest_mm
from people.design import BASE, FULL, METHODS, QUICK, SIDES, Planned, design
from people.recovery import recoveries
from people.tables import recovery_table, tables
from posefit.files import new_file
from posefit.sweep.plan import Plan
from posefit_reproduce.grid import Progress, Say, rows

EVALUATIONS = 2440  # of a frame
RECOVERED, RECOVERED_QUICK = 5, 1  # walks of which some frames are not seen
LEFT_OUT = ("trace", "joint_errors_mm")  # of rows that are written for other programs


def people(
    method: str,
    evaluations: int,
    others: bool,
    quick: bool,
    workers: int | None,
    ledger: str | None,
    out: str | None,
    say: Say,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return what a method reaches on people whom it has not learned from, by group, view and what was changed.

    With `others`, what other methods reach on some of the tracks. `out` is a new file for a row a track.
    """
    with new_file(out) if out else nullcontext() as file:
        found = design(QUICK if quick else FULL, method, evaluations, METHODS if others else ())
        plan = Plan.of({"cells": [track.spec for track in found]})
        measured = rows(plan, workers, ledger, say)
        if file is not None:
            file.write_text("".join(f"{line}\n" for line in _lines(found, measured)), encoding="utf-8")
        near = closest_mm((track.clip for track in found if track.part == BASE), workers, progress)
    return {"method": method, "evaluations": evaluations, **tables(found, measured, near)}


def recovery(
    method: str,
    evaluations: int,
    quick: bool,
    workers: int | None,
    out: str | None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return in how many trials a person who was not seen for a while is found again within ten frames.

    `out` is a new file for a row a trial.
    """
    with new_file(out) if out else nullcontext() as file:
        clips, views = (RECOVERED_QUICK, SIDES[1:2]) if quick else (RECOVERED, SIDES[1:3])
        trials = recoveries(GROUPS[WALKS][:clips], views, method, evaluations, workers, progress)
        if file is not None:
            file.write_text("".join(f"{json.dumps(trial)}\n" for trial in trials), encoding="utf-8")
    return {"method": method, "evaluations": evaluations, "recovery": recovery_table(trials)}


def _lines(found: Sequence[Planned], measured: Sequence[dict[str, Any]]) -> list[str]:
    return [
        json.dumps(
            {
                "part": track.part,
                "group": track.group,
                "shows": track.clip.shows,
                **{name: value for name, value in row.items() if name not in LEFT_OUT},
            }
        )
        for track, row in zip(found, measured, strict=True)
    ]
