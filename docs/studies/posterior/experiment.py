"""People whom the library has never seen, followed; and how sure the tracker may be of what it says."""

import json
from contextlib import ExitStack
from functools import partial
from typing import Any

from posefit.files import new_file
from posefit_reproduce.grid import Progress, each
from posterior.design import METHOD, OTHERS, TEMPERATURES, planned_tracks
from posterior.fit import Kept, doubt_of
from posterior.frames import followed, load_tracks, save_tracks
from posterior.tables import best_modes, coverages, judgement, kept_table, searches_lost

PEOPLE = 3  # at least, of which one is left out at a time


def posterior(
    temperature: float,
    quick: bool,
    again: str | None,
    out: str | None,
    store: str | None,
    workers: int | None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return what intervals and modes are worth on everybody who was left out of library and fit.

    `again` is a file of tracks that an earlier `out` wrote, in place of following. `out` is a new file .npz for the
    frames of all tracks, `store` a new one .json for what was fitted to all people.
    """
    if temperature not in TEMPERATURES:
        raise ValueError(
            f"temperature must be one of {', '.join(f'{one:g}' for one in TEMPERATURES)}, got {temperature:g}"
        )
    if again is not None and (quick or out):
        raise ValueError(f"again must not be given beside {'--quick' if quick else '--out'}, got --again {again}")
    with ExitStack() as stack:
        file, table = (stack.enter_context(new_file(path)) if path else None for path in (out, store))
        if again is not None:
            tracks = load_tracks(again)
        else:
            base, more = planned_tracks(temperature, quick)
            found = each({seen: partial(followed, seen) for seen in (*base, *more)}, workers, progress)
            tracks = list(found.values())
            if file is not None:
                save_tracks(tracks, file)
        kept = [Kept.of(one) for one in tracks]
        mine = [one for one in kept if one.track.seen.method == METHOD]
        base_kept = [one for one in mine if one.track.seen.temperature == temperature]
        people = list(dict.fromkeys(one.track.seen.clip.subject for one in base_kept))
        if len(people) < PEOPLE:
            raise ValueError(f"tracks must be of {PEOPLE} people or more at {temperature:g}, got {len(people)}")
        said = []
        for person in people:
            doubt = doubt_of([one for one in base_kept if one.track.seen.clip.subject != person])
            his = [one for one in base_kept if one.track.seen.clip.subject == person]
            said += [judgement(doubt, one) for one in his]
        if table is not None:
            doubt = doubt_of(base_kept)
            table.write_text(json.dumps({"temperature": temperature, **doubt.as_dict()}) + "\n", encoding="utf-8")
    others = [one for one in kept if one.track.seen.method in OTHERS]
    return {
        "temperature": temperature,
        "coverage": coverages(said),
        "modes": {"recalibrated": best_modes([one.kept for one in said], said), **_temperatures(mine, temperature)},
        "kept": kept_table(said, others) if others else {},
        "searches": searches_lost(others) if others else {},
    }


def _temperatures(tracks: list[Kept], temperature: float) -> dict[str, Any]:
    """Return what best modes are worth at each temperature, on the same clips and views; and on all tracks of ours."""
    told = {f"{temperature:g}, all": best_modes([one for one in tracks if one.track.seen.temperature == temperature])}
    names = {one.track.seen.temperature for one in tracks}
    places = [{_place(one) for one in tracks if one.track.seen.temperature == name} for name in names]
    same = set.intersection(*places)
    if len(names) > 1 and same:
        for name in sorted(names):
            some = [one for one in tracks if one.track.seen.temperature == name and _place(one) in same]
            told[f"{name:g}"] = best_modes(some)
    return told


def _place(kept: Kept) -> tuple[Any, ...]:
    seen = kept.track.seen
    return seen.clip, seen.views, seen.translation
