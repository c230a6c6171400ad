"""Footage made from the truth is tracked as any footage: row by row, each kept as it comes."""

import tempfile
import time
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from composites.figures import extraction_figures, track_figures
from composites.filming import BEFORE, film
from composites.plates import check_video, plate
from composites.situations import PLACES, SHOWS, SIZE, check_situation, situation
from composites.stills import stills
from composites.tables import by_presence
from posefit.footage.extract import extract
from posefit.footage.segmentation import Extraction
from posefit.motion import recorded
from posefit.registry import registry
from posefit.settings import parse_texts
from posefit.tracking.front import track
from posefit_reproduce.grid import Progress, check_seeds, each, earlier, kept

GIVEN = "mean"  # the extraction that is given pictures without anybody
QUICK = (("through", 1), ("stands", 1))  # situations and numbers of cameras of a quick look


class Shot(NamedTuple):
    """One row: what happens, before how many cameras, how the person is taken out, and which people it is.

    `extraction` is a segmenter's name, with settings of it behind.
    """

    situation: str
    views: int
    extraction: str
    seed: int


def composites(
    video: str,
    situations: Sequence[str],
    views: Sequence[int],
    extractions: Sequence[str],
    seeds: int,
    quick: bool,
    rows: str | None,
    pictures: str | None,
    workers: int | None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return a row of figures for each situation, number of cameras, extraction and seed.

    `rows` is a file for a row a line as they come; what it holds already is not measured again. `pictures` is a folder
    for a picture a row. Raises ValueError where something asked for is not there.
    """
    shots = asked(situations, views, extractions, seeds, quick)
    check_video(video)
    done = earlier(rows, Shot._fields, shot_of)
    if pictures is not None:
        _check_folder(Path(pictures))
    jobs = {shot: partial(measured, video, shot, pictures) for shot in shots if shot not in done}
    done |= each(jobs, workers, partial(kept, rows, progress)) if jobs else {}
    found = [done[shot] for shot in shots]
    return {"rows": found, "groups": by_presence(found)}


def asked(
    situations: Sequence[str], views: Sequence[int], extractions: Sequence[str], seeds: int, quick: bool
) -> list[Shot]:
    """Return the rows that are asked for; nothing named is all. Raises ValueError where a name or number is none."""
    check_seeds(seeds)
    grid = list(product(situations or SHOWS, views or PLACES))
    for place in grid:
        check_situation(*place)
    for method in extractions:
        extraction_named(method)
    places = [place for place in grid if not quick or place in QUICK]
    shots = [Shot(*place, method, seed) for seed in range(seeds) for method in extractions for place in places]
    return list(dict.fromkeys(shots))


def shot_of(row: Mapping[str, Any]) -> Shot:
    """Return whose row it is."""
    return Shot(*(row[name] for name in Shot._fields))


def measured(video: str, shot: Shot, pictures: str | None) -> dict[str, Any]:
    """Return the row of a shot: it is filmed, taken out and tracked; what was refused is said in the tool's words."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scene = situation(shot.situation, shot.views, shot.seed)
        plates = [plate(video, number, SIZE) for number in range(shot.views)]
        how = extraction_named(shot.extraction)
        made = film(scene, plates, shot.seed, how.name == GIVEN, folder)
        frames = (made.first, None)
        row: dict[str, Any] = {**shot._asdict(), "people": scene.people, "frames": len(scene)}
        try:
            masks, usable = _taken_out(made.videos, how, frames, folder)
            row |= extraction_figures(masks, usable, made.masks)
        except ValueError as error:
            return row | {"refused": str(error).replace(f"{folder}/", "")}
        began, said = time.perf_counter(), list[str]()
        try:
            result = track(
                made.videos,
                camera=made.calibration,
                up="y",
                extraction=how,
                frames=frames,
                height=scene.actors[0].body.stature,
                train=[recorded.leaving_out(recorded.LIBRARY, scene.people)],
                out=folder / "track",
                say=said.append,
            )
        except ValueError as error:
            return row | {"refused": str(error).replace(f"{folder}/", "")}
        row["minutes"] = (time.perf_counter() - began) / 60.0
        with np.load(folder / "track" / "poses.npz") as stored:
            radii = stored["radii"]
        row |= track_figures(result, radii, scene, made.masks)
        row["warnings"] = [one.replace(f"{folder}/", "") for one in said if one.startswith("warning")]
        if pictures is not None:
            stills(Path(pictures) / f"{_named(shot)}.jpg", made, scene, masks, result, radii)
        return row


def extraction_named(text: str) -> Extraction:
    """Return how people are taken out: a segmenter's name, and settings behind such as `mixture history=90`.

    Raises ValueError where there is no segmenter of that name, or a setting does not fit it.
    """
    name, *given = text.split() or [""]
    if not name:
        raise ValueError(f"extraction must name a segmenter such as mixture, got {text!r}")
    offer = registry().offer("segmenter", name)
    settings = parse_texts(offer.name, offer.factory, given)
    if name == GIVEN:
        settings = {"background": f"0:{BEFORE}", **settings}
    return Extraction(name, settings=settings)


def _check_folder(path: Path) -> None:
    """Return nothing. Raises ValueError where a path is no folder and none can be made."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f"{path}: expected a folder for pictures, got {error.strerror}") from None


def _taken_out(videos: Sequence[Path], how: Extraction, frames: Any, folder: Path) -> tuple[Any, Any]:
    """Return masks (views, T, height, width) that are taken out of videos, and whether they are usable (views, T)."""
    masks, usable = [], []
    for number, video in enumerate(videos):
        extract(video, folder / f"masks-{number}", how, frames=frames)
        with np.load(folder / f"masks-{number}" / "masks.npz") as stored:
            masks.append(stored["masks"] > 0)
            usable.append(stored["usable"])
    return np.stack(masks), np.stack(usable)


def _named(shot: Shot) -> str:
    return "-".join(str(part).replace(" ", "-") for part in shot)
