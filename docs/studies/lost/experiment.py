"""Tracks of people whom the library has never seen, the evidence of their frames, and the models that are fitted."""

import json
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from typing import Any

from lost.damage import Worn
from lost.design import MASKS, Turn, turns
from lost.model import fit, judge, judge_costs
from lost.tables import lost_tables, sides_table
from posefit.files import new_file
from posefit.footage.training import training_clips, training_motions
from posefit.reading import parsed_json, read_text
from posefit.sweep.cell import TrackCell, cell_scene, parts
from posefit.sweep.check import cell_of
from posefit.tracking.method import Choice
from posefit.tracking.opening import Opening
from posefit.tracking.run import follow
from posefit_reproduce.grid import Progress, each

METHOD = "exemplars"
EVALUATIONS = 2440  # of a frame
DIGITS = 6  # of numbers in a file of rows
LARGEST = 200_000_000  # bytes of such a file
NEEDED = {"subject", "group", "views_degrees", "condition", "fps", "mpjpe_mm", "swapped", "cost"}


def lost(
    method: str,
    quick: bool,
    store: str | None,
    workers: int | None,
    rows: str | None,
    out: str | None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return how well it is told which frames are lost and swapped, of people whom neither model nor library has seen.

    `out` is a new file for a row a track, and `rows` such a file, from which the models are fitted without following
    anybody again. `store` is a new file for the models that are fitted to all of them, for `exemplars` to read.
    """
    if store and (method != METHOD or quick):
        raise ValueError(f"store must be asked for with all tracks of {METHOD}, got --store with a look at others")
    if rows is not None and out is not None:
        raise ValueError("out must be given for tracks that are followed, got --out with --rows")
    with new_file(out) if out else nullcontext() as file, new_file(store) if store else nullcontext() as kept:
        found = _read(rows) if rows is not None else _followed(method, turns(quick), workers, progress)
        if file is not None:
            file.write_text("".join(f"{json.dumps(row)}\n" for row in found), encoding="utf-8")
        told = {"method": method, "tracks": len(found)}
        if not all("evidence" in row for row in found):
            if store:
                raise ValueError(f"rows must have evidence to be fitted, got some of {rows or method} without")
            return told | lost_tables(found, judge_costs(found))
        said, model = judge(found), fit(found)
        if kept is not None:
            kept.write_text(json.dumps(model, indent=1) + "\n", encoding="utf-8")
    tables = lost_tables(found, [one.lost for one in said]) | {"sides": sides_table(found, said)}
    return told | {"model": model} | tables


def _followed(
    method: str, tracks: Sequence[Turn], workers: int | None, progress: Progress | None
) -> list[dict[str, Any]]:
    # all cells are made, and so checked, before any runs
    cells = {track: cell_of(track.spec(method, EVALUATIONS)) for track in tracks}
    found = each({track: partial(_tracked, cell, track) for track, cell in cells.items()}, workers, progress)
    return [found[track] for track in tracks]


def _tracked(cell: TrackCell, track: Turn) -> dict[str, Any]:
    """Return a row of a track: its frames' errors, costs, and evidence where the tracker tells it."""
    scene = cell_scene(cell)
    if track.condition == MASKS:
        seed = [track.clip.instance, *track.clip.name.encode()]
        scene = replace(scene, observations=Worn(scene.observations, seed))
    optimiser, prior, tracker = parts(cell.method)
    named: dict[str, Any] = {"tracker": tracker} if tracker else {"optimiser": optimiser, "prior": prior}
    training = training_motions(training_clips(cell.train, followed=cell.motion), scene.fps)
    choice = Choice(evaluations=cell.evaluations, **named)
    told = follow(scene, training, choice=choice, opening=Opening(translation=cell.translation), seed=cell.seed)  # type: ignore[arg-type]
    row = {
        "subject": track.clip.subject,
        "group": track.group,
        "clip": track.clip.name,
        "views_degrees": list(track.views),
        "condition": track.condition,
        "fps": scene.fps,
        "mpjpe_mm": [round(one["mpjpe_mm"], 2) for one in told.frames],
        "swapped": [int(one["swapped"]) for one in told.frames],
        "cost": [round(one["cost"], DIGITS) for one in told.frames],
    }
    evidence = [frame.details.get("evidence", {}) for frame in told.found]
    if all(evidence):
        row["evidence"] = [{name: round(value, DIGITS) for name, value in one.items()} for one in evidence]
    return row


def _read(path: str) -> list[dict[str, Any]]:
    """Return the rows of an earlier run. Raises ValueError where there is no such file, or a line is none."""
    found = []
    try:
        lines = read_text(path, LARGEST).splitlines()
    except FileNotFoundError:
        raise ValueError(f"{path}: expected a file of rows that --out wrote, got none") from None
    for number, line in enumerate(lines, 1):
        try:
            row = parsed_json(line)
        except ValueError:
            raise ValueError(f"{path}: line {number} must be a row of a track, got no JSON") from None
        if not (isinstance(row, dict) and row.keys() >= NEEDED):
            raise ValueError(f"{path}: line {number} must be a row of a track, with {', '.join(sorted(NEEDED))}")
        found.append(row)
    if not found:
        raise ValueError(f"{path}: expected a row a track, got an empty file")
    return found
