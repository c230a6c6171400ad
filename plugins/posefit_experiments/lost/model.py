"""The logistic model, fitted to rows of tracks; and what it says of people whom it was not fitted to."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.metrics import LOST_MM
from posefit_exemplars.lost import NAMES, Detector, Memory

Row = Mapping[str, Any]

STRENGTH = 0.03  # of the weights' prior, a normal one: its variance
DIGITS = 6


def features(row: Row) -> Array:
    """Return the features (T, F) of a track's frames, as the tracker has them."""
    memory = Memory(row["fps"])
    return np.array([memory.features(told) for told in row["evidence"]])


def lost_frames(rows: Sequence[Row]) -> NDArray[np.bool_]:
    """Return which frames of all rows are lost."""
    return np.concatenate([np.array(row["mpjpe_mm"]) > LOST_MM for row in rows])


def fit(rows: Sequence[Row]) -> dict[str, Any]:
    """Return the detector that is fitted to rows, as JSON holds it."""
    return _fitted(np.concatenate([features(row) for row in rows]), lost_frames(rows))


def judge(rows: Sequence[Row]) -> list[Array]:
    """Return how likely the frames of each row (T,) are lost, by a detector that was fitted to other people."""
    known = [features(row) for row in rows]
    found: list[Array] = [np.empty(0)] * len(rows)
    for subject in dict.fromkeys(row["subject"] for row in rows):
        others = [k for k, row in enumerate(rows) if row["subject"] != subject]
        if not others:
            raise ValueError(f"rows must be of two people or more, got those of {subject}")
        told = _fitted(np.concatenate([known[k] for k in others]), lost_frames([rows[k] for k in others]))
        detector = Detector.from_dict(told)
        for k, row in enumerate(rows):
            if row["subject"] == subject:
                found[k] = np.array([detector.probability(one) for one in known[k]])
    return found


def judge_costs(rows: Sequence[Row]) -> list[Array]:
    """Return what speaks for the frames of each row (T,) to be lost where nothing is known of them but their costs."""
    return [np.array(row["cost"]) for row in rows]


def _fitted(known: Array, lost: NDArray[np.bool_]) -> dict[str, Any]:
    """Return a logistic model of features (n, F) as JSON holds it."""
    from sklearn.linear_model import LogisticRegression

    if lost.all() or not lost.any():
        raise ValueError(f"frames must be lost and not lost, to be told apart, got {int(lost.sum())} of {len(lost)}")
    mean, spread = known.mean(axis=0), known.std(axis=0)
    used = np.flatnonzero(spread > 1e-9)
    model = LogisticRegression(C=STRENGTH, max_iter=2000)
    model.fit((known[:, used] - mean[used]) / spread[used], lost)
    weights = model.coef_[0] / spread[used]
    bias = float(model.intercept_[0] - weights @ mean[used])
    named = {NAMES[row]: round(float(weight), DIGITS) for row, weight in zip(used, weights, strict=True)}
    return {"weights": named, "bias": round(bias, DIGITS)}
