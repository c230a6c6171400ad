"""What left-out people say: coverage, widths, modes, and errors over the frames that are kept; and its print."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.metrics import LOST_MM
from posefit.searching.doubt import LEAST_COST, lost_at
from posefit.uncertainty.calibration import LEVELS, auroc, calibration_error, kept_errors, reliability
from posefit.uncertainty.modes import APART
from posefit_exemplars.doubt import Doubt
from posterior.design import METHOD
from posterior.fit import (
    MEMBERS,
    Kept,
    frame_weights,
    logistic,
    radii_and_angles_held,
    sharpened,
)

LOST_METRES = 1e-3 * LOST_MM
KEPT = (0.25, 0.5, 0.75, 1.0)  # shares of frames, the most certain first


@dataclass(frozen=True, eq=False)
class Judged:
    """A track of somebody who was left out of the fit, and what was said of it."""

    kept: Kept
    doubts: Array = field(repr=False)  # (T,) metres
    sharpness: float
    none: Array = field(repr=False)  # (T,) probability that no mode is right
    inside: NDArray[np.bool_] = field(repr=False)  # (T, levels, 27)
    radii: Array = field(repr=False)  # (T, levels, 27) metres
    turned: Array = field(repr=False)  # (levels,) share of angles that are inside


def judgement(doubt: Doubt, kept: Kept) -> Judged:
    """Return what is said of a track."""
    logs = np.array([doubt.log(seen) for seen in kept.seen])
    radii, angles = radii_and_angles_held(doubt, kept)
    return Judged(
        kept,
        np.exp(logs),
        doubt.sharpness,
        np.array([doubt.none_right(log) for log in logs]),
        kept.track.off[:, None] <= radii,
        radii,
        angles.mean(axis=(0, 2)),
    )


def coverages(tracks: Sequence[Judged]) -> dict[str, Any]:
    """Return the coverage of left-out people: overall, by group of joints, by view and by kind of motion."""

    def told(mine: Sequence[Judged], joints: Any = slice(1, None)) -> dict[str, Any]:
        weights = frame_weights([one.kept for one in mine])
        inside, radii = (
            weights @ np.concatenate([getattr(one, name)[:, :, joints].mean(axis=2) for one in mine])
            for name in ("inside", "radii")
        )
        radius = np.concatenate([one.radii[:, 1, joints].mean(axis=1) for one in mine])
        return {
            "tracks": len(mine),
            "coverage": {f"{100 * level:.0f}": float(inside[k]) for k, level in enumerate(LEVELS)},
            "radius_mm": {f"{100 * level:.0f}": float(1e3 * radii[k]) for k, level in enumerate(LEVELS)},
            "median_radius_mm": float(1e3 * np.median(radius)),
        }

    def by(name: Callable[[Judged], str]) -> dict[str, Any]:
        names = sorted({name(one) for one in tracks})
        return {each: told([one for one in tracks if name(one) == each]) for each in names}

    return {
        "overall": told(tracks),
        "joints": {name: told(tracks, members) for name, members in MEMBERS.items()},
        "views": by(lambda one: seen_from(one.kept)),
        "motions": by(_group),
        "translations": by(_translation),
        "people": by(lambda one: one.kept.track.seen.clip.subject),
        "angles": dict(zip(("50", "80", "95"), np.mean([one.turned for one in tracks], axis=0).tolist(), strict=True)),
    }


def seen_from(kept: Kept) -> str:
    """Return from where a track is seen, three digits a view."""
    return ", ".join(f"{view:03.0f}" for view in kept.track.seen.views)


def _group(one: Judged) -> str:
    return one.kept.track.seen.group


def _translation(one: Judged) -> str:
    return one.kept.track.seen.translation


def best_modes(tracks: Sequence[Kept], said: Sequence[Judged] = ()) -> dict[str, Any]:
    """Return how far the best mode's probability is from how often it is right.

    It is right where the truth is nearer to it than to any other mode, and as near as poses of one mode are; `several`
    are the frames that have others, `none` those in which no mode is right. Modes' weights are those that `said` makes
    of them, in the order of the tracks; without it they are as they were drawn.
    """
    powers = [one.sharpness for one in said] or [1.0] * len(tracks)
    none = np.concatenate([one.none for one in said] or [np.zeros(len(one.track)) for one in tracks])
    pairs = zip(tracks, powers, strict=True)
    probable = (1.0 - none) * [sharpened(modes, power)[0] for one, power in pairs for modes in one.modes]
    several = np.array([len(modes) > 1 for one in tracks for modes in one.modes])
    nearest = np.concatenate([one.nearest for one in tracks])
    far = nearest[:, 1] > APART
    right = (nearest[:, 0] == 0.0) & ~far
    second, swapped = (np.concatenate([getattr(one, name) for one in tracks]) for name in ("second", "swapped"))
    return {
        "tracks": len(tracks),
        "mean_probability": float(probable.mean()),
        "right": float(right.mean()),
        "calibration_error": calibration_error(probable, right),
        "several": float(several.mean()),
        "calibration_error_several": calibration_error(probable[several], right[several]) if several.any() else 0.0,
        "none": float(far.mean()),
        "calibration_error_none": calibration_error(none, far),
        "auroc": auroc(probable, right),
        "second_side_auroc": auroc(second, swapped),
        "reliability": reliability(probable, right),
    }


def kept_table(tracks: Sequence[Judged], others: Sequence[Kept]) -> dict[str, Any]:
    """Return the mean error in millimetres of the frames that are least doubted, on the tracks that all methods have.

    Of `exemplars` by its doubt, of others by how likely they say that a frame is lost.
    """
    places = {(one.track.seen.clip, one.track.seen.views): len(one.track) for one in others}
    mine = [one for one in tracks if one.kept.track.seen.translation == "known"]
    pairs = [(one, places.get((one.kept.track.seen.clip, one.kept.track.seen.views), 0)) for one in mine]
    found = {METHOD: _curve([one.kept.error[:n] for one, n in pairs if n], [one.doubts[:n] for one, n in pairs if n])}
    for method in dict.fromkeys(one.track.seen.method for one in others):
        some = [one for one in others if one.track.seen.method == method]
        found[method] = _curve([one.error for one in some], [lost_at(one.track.costs) for one in some])
    return found


def searches_lost(others: Sequence[Kept]) -> dict[str, float]:
    """Return how frames that searches lose follow from their costs: the model that is fitted to all of them.

    And what one is worth on everybody who was left out of its fit.
    """
    said, came = [], []
    for person in dict.fromkeys(one.track.seen.clip.subject for one in others):
        his, rest = (
            [one for one in others if (one.track.seen.clip.subject == person) == mine] for mine in (True, False)
        )
        if rest:
            design, off = _costs(his)
            said.append(1.0 / (1.0 + np.exp(-design @ logistic(*_costs(rest), frame_weights(rest)))))
            came.append(off)
    bias, slope = logistic(*_costs(others), frame_weights(others))
    told = {"even": float(np.exp(-bias / slope)), "steepness": float(slope)}
    if not said:
        return told
    likely, off = np.concatenate(said), np.concatenate(came)
    rank = auroc(likely, off)
    ranked = {} if rank is None else {"auroc": rank}
    return {**told, "lost": float(off.mean()), "calibration_error": calibration_error(likely, off), **ranked}


def _costs(tracks: Sequence[Kept]) -> tuple[Array, NDArray[np.bool_]]:
    """Return 1 and the logarithm of the cost of each frame (n, 2), and whether it is lost (n,)."""
    costs = np.concatenate([one.track.costs for one in tracks])
    off = np.concatenate([one.error for one in tracks]) > LOST_METRES
    return np.column_stack([np.ones(len(costs)), np.log(np.maximum(costs, LEAST_COST))]), off


def _curve(errors: Sequence[Array], doubts: Sequence[Array]) -> dict[str, float]:
    means = 1e3 * kept_errors(np.concatenate(errors), np.concatenate(doubts), KEPT)
    return {f"{100 * share:.0f}": float(mean) for share, mean in zip(KEPT, means, strict=True)}


def posterior_lines(told: Mapping[str, Any]) -> Iterator[str]:
    """Yield the tables as they are printed."""
    levels = [f"{100 * level:.0f}" for level in LEVELS]
    held = told["coverage"]
    yield from _head(
        ["of", "which", "tracks", *(f"{level} % hold %" for level in levels), "80 % radius mm", "median mm"], 2
    )
    for part in ("overall", "joints", "views", "motions", "translations", "people"):
        rows = {"": held[part]} if part == "overall" else held[part]
        for name, one in rows.items():
            shown = [f"{100 * one['coverage'][level]:.1f}" for level in levels]
            widths = [f"{one['radius_mm']['80']:.0f}", f"{one['median_radius_mm']:.0f}"]
            yield _line([part, name, str(one["tracks"]), *shown, *widths])
    yield _line(["angles", "", "", *(f"{100 * held['angles'][level]:.1f}" for level in levels), "", ""])
    yield ""
    heads = ["best mode %", "right %", "error %", "several modes %", "error %", "none right %", "error %"]
    yield from _head(["modes", "tracks", *heads, "AUROC", "second side AUROC"], 1)
    for name, one in told["modes"].items():
        each = ["mean_probability", "right", "calibration_error", "several", "calibration_error_several"]
        each += ["none", "calibration_error_none"]
        ranks = ["" if one[key] is None else f"{one[key]:.2f}" for key in ("auroc", "second_side_auroc")]
        yield _line([name, str(one["tracks"]), *(f"{100 * one[key]:.1f}" for key in each), *ranks])
    if told["kept"]:
        yield ""
        yield from _head(["frames kept %", *next(iter(told["kept"].values()))], 1)
        for method, curve in told["kept"].items():
            yield _line([method, *(f"{value:.0f}" for value in curve.values())])
        yield ""
        yield "lost, by the cost of what other methods found: " + ", ".join(
            f"{name} {value:.3g}" for name, value in told["searches"].items()
        )


def _head(heads: Sequence[str], words: int) -> Iterator[str]:
    yield _line(heads)
    yield "|" + "---|" * words + "---:|" * (len(heads) - words)


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
