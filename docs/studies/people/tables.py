"""What the tracks come to: medians over tracks with intervals, shares of frames; and how that is printed."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from people.clips import GROUPS, Piece
from people.design import AGAIN, BASE, CHANGES, OTHERS, OWN, STEPS, Planned, Views
from posefit.arrays import Array
from posefit.tracking.measures import BASELINES, MEASURES
from posefit_reproduce.columns import head_of, number

Row = Mapping[str, Any]
Found = Sequence[tuple[Planned, Row]]

RESAMPLES = 2000
LEVEL = 0.95
SHARES = ("lost_rate", "swap_rate")
TRIVIAL = ("nearest", "mean_pose")  # baselines that tables show


def tables(tracks: Sequence[Planned], measured: Sequence[Row], near: Mapping[Piece, float]) -> dict[str, Any]:
    """Return the tables of tracks and their rows; `near` is how far the library's closest poses are from a clip's."""
    pairs = list(zip(tracks, measured, strict=True))
    base = {track.place: (track, row) for track, row in pairs if track.part == BASE}
    return {
        "tracks": len(pairs),
        "groups": [
            _group(name, found, near)
            for name in GROUPS
            if (found := [one for one in pairs if one[0].part in (BASE, AGAIN) and one[0].group == name])
        ],
        "changes": list(_changes(CHANGES, pairs, base)),
        "steps": list(_changes(STEPS, pairs, base)),
        "methods": list(_methods(pairs, base)),
        "own": [_own(track, row) for track, row in pairs if track.part == OWN],
    }


def _group(name: str, mine: Found, near: Mapping[Piece, float]) -> dict[str, Any]:
    """Return what is reached in a group, with one camera and with two, and from each view."""
    views: list[Views] = list(dict.fromkeys(track.views for track, _ in mine))
    cameras = {
        f"{count}_camera": _figures([(track, row) for track, row in mine if len(track.views) == count])
        for count in sorted({len(view) for view in views})
    }
    return {
        "group": name,
        "clips": list(dict.fromkeys(track.clip.name for track, _ in mine)),
        "closest_mm": float(np.median([near[track.clip] for track, _ in mine])),
        **cameras,
        "views": [
            {"views_degrees": list(view), **_figures([(track, row) for track, row in mine if track.views == view])}
            for view in views
        ],
    }


def _figures(found: Found) -> dict[str, Any]:
    """Return medians over tracks of means over frames, and means of shares."""
    values = np.array([row["mpjpe_mm"] for _, row in found])
    low, high = interval(values, [track.clip.name for track, _ in found])
    return {
        "tracks": len(found),
        "mpjpe_mm": float(np.median(values)),
        "low_mm": low,
        "high_mm": high,
        **{name: float(np.mean([row[name] for _, row in found])) for name in SHARES},
        **{f"{name}_mm": float(np.median([row["baselines_mm"][name] for _, row in found])) for name in TRIVIAL},
    }


def interval(values: Array, names: Sequence[str]) -> tuple[float, float]:
    """Return the 95 % interval of the median of values (n,), by a bootstrap over the clips that they are of."""
    rng = np.random.default_rng(0)
    of_clip = [values[np.array(names) == name] for name in dict.fromkeys(names)]
    drawn = rng.integers(len(of_clip), size=(RESAMPLES, len(of_clip)))
    medians = [np.median(np.concatenate([of_clip[k] for k in rows])) for rows in drawn]
    low, high = np.quantile(medians, [0.5 - LEVEL / 2.0, 0.5 + LEVEL / 2.0])
    return float(low), float(high)


def _changes(names: Iterable[str], pairs: Found, base: Mapping[Any, tuple[Planned, Row]]) -> Iterator[dict[str, Any]]:
    """Yield what each change comes to, beside the same clips and views without it."""
    same = [base[track.place] for track, _ in pairs if track.part == next(iter(names), None)]
    if same:
        yield {"change": BASE, **_figures(same), "more_mm": 0.0}
    for name in names:
        mine = [(track, row) for track, row in pairs if track.part == name]
        if mine:
            more = [row["mpjpe_mm"] - base[track.place][1]["mpjpe_mm"] for track, row in mine]
            yield {"change": name, **_figures(mine), "more_mm": float(np.median(more))}


def _methods(pairs: Found, base: Mapping[Any, tuple[Planned, Row]]) -> Iterator[dict[str, Any]]:
    """Yield what every method reaches on the tracks that all of them have."""
    others = [(track, row) for track, row in pairs if track.part == OTHERS]
    names = dict.fromkeys(track.method for track, _ in others)
    places = list(dict.fromkeys(track.place for track, _ in others))
    mine = [base[place] for place in places]
    for one in [mine, *([pair for pair in others if pair[0].method == name] for name in names)]:
        if one:
            seconds = float(np.median([row["seconds_per_frame"] for _, row in one]))
            yield {"method": one[0][0].method, **_figures(one), "seconds_per_frame": seconds}


def _own(track: Planned, row: Row) -> dict[str, Any]:
    return {
        "train": track.group,
        "test": track.clip.name,
        "views_degrees": list(track.views),
        "error_degrees": row["error_degrees"]["mean"],
        **{name: row[name] for name in ("mpjpe_mm", *SHARES)},
    }


def recovery_table(trials: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return for each kind of absence and of translation in which shares of the trials a track was right."""
    told = []
    for place in dict.fromkeys((one["kind"], one["translation"]) for one in trials):
        mine = [one for one in trials if (one["kind"], one["translation"]) == place]
        shares = {name: float(np.mean([one[name] for one in mine])) for name in ("before", "right", "facing_right")}
        middle = float(np.median([one["mpjpe_mm"] for one in mine]))
        told.append({"kind": place[0], "translation": place[1], "trials": len(mine), **shares, "mpjpe_mm": middle})
    return told


def people_lines(told: Mapping[str, Any]) -> Iterator[str]:
    """Yield the tables as they are printed."""
    heads = ["tracks", head_of("mpjpe_mm", "median"), "95 % interval", *(head_of(name) for name in SHARES)]
    trivial = [f"{BASELINES[name]}, mm" for name in TRIVIAL]
    yield from _head(["group", "view", *heads, *trivial, "closest training pose, mm"], 2)
    for group in told["groups"]:
        near = number("mpjpe_mm", group["closest_mm"])
        rows = [("one camera", group.get("1_camera")), ("two cameras", group.get("2_camera"))]
        rows += [(_view(one), one) for one in group["views"]]
        for view, one in rows:
            if one is not None:
                yield _line([group["group"], view, *_cells(one), *(_mm(one[f"{name}_mm"]) for name in TRIVIAL), near])
    for name, head in (("changes", "walks"), ("steps", "walks and runs")):
        if told[name]:
            yield ""
            yield from _head([head, *heads, "more than base, mm"], 1)
            yield from (_line([one["change"], *_cells(one), _mm(round(one["more_mm"]) + 0.0)]) for one in told[name])
    if told["methods"]:
        yield ""
        yield from _head(["method", *heads, "ms a frame"], 1)
        for one in told["methods"]:
            yield _line([one["method"], *_cells(one), number("seconds_per_frame", one["seconds_per_frame"])])
        first = told["methods"][0]
        for name in TRIVIAL:
            yield _line([f"{BASELINES[name]}, true root", str(first["tracks"]), _mm(first[f"{name}_mm"]), *[""] * 4])
    if told["own"]:
        names = ("error_degrees", "mpjpe_mm", *SHARES)
        yield ""
        yield from _head(["trained on", "test", "view", *(head_of(name) for name in names)], 2)
        for one in told["own"]:
            yield _line([one["train"], one["test"], _view(one), *(number(name, one[name]) for name in names)])


def recovery_lines(told: Mapping[str, Any]) -> Iterator[str]:
    """Yield the table of the trials as it is printed."""
    heads = ["right before %", "right again %", "facing right %", head_of("mpjpe_mm", "median")]
    yield from _head(["nobody seen", "translation", "trials", *heads], 2)
    for one in told["recovery"]:
        shares = [f"{100.0 * one[name]:.0f}" for name in ("before", "right", "facing_right")]
        yield _line([one["kind"], one["translation"], str(one["trials"]), *shares, _mm(one["mpjpe_mm"])])


def _cells(one: Mapping[str, Any]) -> list[str]:
    shares = [replace(MEASURES[name], digits=1).number(one[name]) for name in SHARES]
    return [str(one["tracks"]), _mm(one["mpjpe_mm"]), f"{_mm(one['low_mm'])} to {_mm(one['high_mm'])}", *shares]


def _mm(value: float) -> str:
    return number("mpjpe_mm", value)


def _view(one: Mapping[str, Any]) -> str:
    return ", ".join(f"{view:g}" for view in one["views_degrees"])


def _head(heads: Sequence[str], words: int) -> Iterable[str]:
    return _line(heads), "|" + "---|" * words + "---:|" * (len(heads) - words)


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
