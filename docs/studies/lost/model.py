"""The logistic models, fitted to rows of tracks; and what they say of people whom they were not fitted to."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.metrics import LOST_MM
from posefit_exemplars.lost import NAMES, Detector, Judge, Memory

Row = Mapping[str, Any]
Flags = NDArray[np.bool_]

STRENGTH = 0.03  # of the weights' prior, a normal one: its variance
SWAPPED = 0.05  # of the frames whose sides are not called unknown: about, for `BOUNDS` come first, and footage differs
BOUNDS = (0.01, 0.5)  # of how likely exchanged sides have to be for that; from a half on they are likelier than not
DIGITS = 6
# What each model looks at, of the evidence of a frame: now, and its means
LOST_SIGNS = ("cost", "cost, lately", "farthest", "farthest, lately", "views")
SIDES_SIGNS = (
    *(f"{name}{mean}" for name in ("cost", "reflected", "mirrored", "second") for mean in ("", ", in general")),
    *("farthest, in general", "across", "ahead", "speed", "views"),
)


class Said(NamedTuple):
    """What is said of the frames of a row."""

    lost: Array  # (T,) how likely each is lost
    exchanged: Array  # (T,) how likely its sides are exchanged
    unknown: Flags  # (T,)


def features(row: Row) -> Array:
    """Return the features (T, F) of a track's frames, as the tracker has them."""
    memory = Memory(row["fps"])
    return np.array([memory.features(told) for told in row["evidence"]])


def lost_frames(rows: Sequence[Row]) -> Flags:
    """Return which frames of all rows are lost."""
    return np.concatenate([np.array(row["mpjpe_mm"]) > LOST_MM for row in rows])


def swapped_frames(rows: Sequence[Row]) -> Flags:
    """Return in which frames of all rows left and right are exchanged."""
    return np.concatenate([np.array(row["swapped"]) > 0 for row in rows])


def fit(rows: Sequence[Row]) -> dict[str, Any]:
    """Return the models that are fitted to rows, as JSON holds them. Raises ValueError where they are of one person."""
    return _fitted(rows, [features(row) for row in rows])


def judge(rows: Sequence[Row]) -> list[Said]:
    """Return what is said of each row by models that were fitted to other people.

    Raises ValueError where there are fewer than three: of the others, too, each is left out once.
    """
    if len(people := dict.fromkeys(row["subject"] for row in rows)) < 3:
        raise ValueError(f"rows must be of three people or more, got those of {', '.join(people)}")
    known = [features(row) for row in rows]
    found: list[Said] = [Said(np.empty(0), np.empty(0), np.empty(0, dtype=np.bool_))] * len(rows)
    for his, others in _left_out(rows):
        models = Judge.from_dict(_fitted([rows[k] for k in others], [known[k] for k in others]))
        for k in his:
            exchanged = np.array([models.sides.probability(one) for one in known[k]])
            lost = np.array([models.lost.probability(one) for one in known[k]])
            found[k] = Said(lost, exchanged, exchanged >= models.unknown)
    return found


def judge_costs(rows: Sequence[Row]) -> list[Array]:
    """Return what speaks for the frames of each row (T,) to be lost where nothing is known of them but their costs."""
    return [np.array(row["cost"]) for row in rows]


def _left_out(rows: Sequence[Row]) -> list[tuple[list[int], list[int]]]:
    """Return the rows of each person, and those of the others."""
    people = list(dict.fromkeys(row["subject"] for row in rows))
    each = [[k for k, row in enumerate(rows) if row["subject"] == person] for person in people]
    return [(his, [k for k in range(len(rows)) if k not in his]) for his in each]


def _fitted(rows: Sequence[Row], known: Sequence[Array]) -> dict[str, Any]:
    """Return both models, and from where on sides are unknown: judged on each person by what the others say."""
    lost = _logistic("lost", np.concatenate(known), lost_frames(rows), LOST_SIGNS)
    sides = _logistic("swapped", np.concatenate(known), swapped_frames(rows), SIDES_SIGNS)
    exchanged, swapped = list[Array](), list[Flags]()
    for his, others in _left_out(rows):
        mine = [rows[k] for k in others]
        told = _logistic("swapped", np.concatenate([known[k] for k in others]), swapped_frames(mine), SIDES_SIGNS)
        detector = Detector.from_dict(told)
        exchanged.append(np.array([detector.probability(one) for k in his for one in known[k]]))
        swapped.append(swapped_frames([rows[k] for k in his]))
    return {"lost": lost, "sides": sides, "unknown": _unknown(np.concatenate(exchanged), np.concatenate(swapped))}


def _unknown(exchanged: Array, swapped: Flags) -> float:
    """Return from which probability of exchanged sides on they are unknown: of the rest about `SWAPPED` are swapped."""
    order = np.argsort(exchanged, kind="stable")
    shares = np.cumsum(swapped[order]) / np.arange(1, len(order) + 1)
    few = np.flatnonzero(shares <= SWAPPED)
    return round(float(np.clip(exchanged[order][few[-1]] if len(few) else 0.0, *BOUNDS)), DIGITS)


def _logistic(name: str, known: Array, came: Flags, signs: Sequence[str]) -> dict[str, Any]:
    """Return a logistic model of some of the features (n, F), as JSON holds it."""
    from sklearn.linear_model import LogisticRegression

    if came.all() or not came.any():
        raise ValueError(
            f"frames must be {name} and not {name}, to be told apart, got {int(came.sum())} of {len(came)}"
        )
    mean, spread = known.mean(axis=0), known.std(axis=0)
    used = [k for k, sign in enumerate(NAMES) if sign in signs and spread[k] > 1e-9]
    model = LogisticRegression(C=STRENGTH, max_iter=2000)
    model.fit((known[:, used] - mean[used]) / spread[used], came)
    weights = model.coef_[0] / spread[used]
    bias = float(model.intercept_[0] - weights @ mean[used])
    named = {NAMES[row]: round(float(weight), DIGITS) for row, weight in zip(used, weights, strict=True)}
    return {"weights": named, "bias": round(bias, DIGITS)}
