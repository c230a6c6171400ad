"""Where the 17 points are in a silhouette, by rules, and where hidden ones are by prediction. VSMM step 2.

Errors and gates are in legs (hip to ankle, projected at the person's depth), whatever the sizes of image and person.
"""

import json
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit_vsmm.preprocess import Lines
from posefit_vsmm.state import AT, POINTS

BODY = (
    "torso",
    "left clavicle",
    "right clavicle",
    "left shoulder",
    "right shoulder",
    "left hip",
    "right hip",
)
_TORSO = np.array([AT[name] for name in BODY])
_TIPS = np.array(
    [
        AT[name]
        for name in ("head", "left hand", "right hand", "left foot", "right foot")
    ]
)
_RINGS = np.array([0.8, 1.0, 1.2])  # radii of the head
# pixels: what is nearer together is one crossing of the skeleton line
ONE_CROSSING = 2.0
# legs: the limits of a point's gate, and a gate that is none
GATE = (0.35, 1.2)
NO_GATE = (1e3, 1e3)

Indices = NDArray[np.intp]
# rows and columns, by distances (n, m)
Pairs = Callable[[Array], tuple[Indices, Indices]]
# of two knees, by distances (2, n) and places along the line (n,)
Crossings = Callable[[Array, Array], Indices]


class Rules(NamedTuple):
    """How points are detected, and how far a detection is trusted. Interpretations V8 and V15."""

    bias: Array  # (17, 2) legs, detected less true
    deviation: Array  # (17, 2) legs, around the bias
    pairs: Pairs  # of limbs and end points
    crossings: Crossings
    gate: tuple[float, float]  # legs: a point's gate is between these
    # squared standard deviations in the image: a detection farther off is rejected
    max_distance: float
    # a lower one counts as this one where variances are divided by it
    min_confidence: float


@cache
def default_rules() -> Rules:
    """Return the default rules, with the errors that make_joint_errors.py measured."""
    stored = json.loads(
        (files("posefit_vsmm") / "joints.json").read_text(encoding="utf-8")
    )
    bias, deviation = (
        np.array([stored["points"][name][key] for name in POINTS])
        for key in ("bias", "deviation")
    )
    return Rules(bias, deviation, optimal_pairs, nearest_crossings, GATE, 16.0, 0.05)


def patent_rules() -> Rules:
    """Return those to the patent's letter: unbiased, the torso as the root, and neither gate nor confidence counts."""
    bias = np.zeros((len(POINTS), 2))
    deviation = default_rules().deviation.copy()
    deviation[_TORSO] = deviation[AT["root"]]
    return Rules(bias, deviation, nearest_pairs, two_crossings, NO_GATE, np.inf, 1.0)


def detect(
    lines: Lines, expected: Array, gates: Array, leg: float, head: float, rules: Rules
) -> tuple[Array, Array, int]:
    """Return the points (17, 2) of a silhouette, the confidence (17,), 0 to 1, and how many end points are unassigned.

    They are pixels near where they are expected (17, 2); one that is not detected is there, with a confidence of 0.
    What is farther away than a point's gate (17,) in pixels is another one. `leg` and `head` are the lengths of a leg
    and of the head's radius in pixels.
    """
    points = expected.copy()
    confidence = np.zeros(len(POINTS))

    def place(name: str, point: Array) -> None:
        distance = float(np.linalg.norm(point - expected[AT[name]]) / gates[AT[name]])
        points[AT[name]], confidence[AT[name]] = (
            point,
            max(0.0, 1.0 - distance * distance),
        )

    # VSMM 2.2
    points[AT["root"]], confidence[AT["root"]] = lines.pixels.mean(axis=0), 1.0
    centre = _head(lines, expected[AT["head"]], head, gates[AT["head"]])
    if centre is not None:
        points[AT["head"]], confidence[AT["head"]] = centre
    tips, unassigned = _tips(lines.ends, expected[_TIPS], gates[_TIPS], rules.pairs)
    for name, end in tips.items():  # VSMM 2.4
        place(name, end)
    bias = rules.bias * leg
    points -= bias * (confidence > 0.0)[:, None]
    # VSMM 2.3
    points[_TORSO] = expected[_TORSO] + points[AT["root"]] - expected[AT["root"]]
    confidence[_TORSO] = 1.0
    elbows = {
        f"{side} elbow": _elbow(lines, points, confidence, expected, side, gates)
        for side in ("left", "right")
    }
    knees = _knees(lines, points, confidence, expected, gates, rules.crossings)
    for name, point in {**elbows, **knees}.items():
        if point is not None:
            place(name, point)
            points[AT[name]] -= bias[AT[name]]
    return points, confidence, unassigned


def _distances(first: Array, second: Array) -> Array:
    """Return the distances (n, m) between points (n, 2) and (m, 2)."""
    return np.asarray(np.linalg.norm(first[:, None] - second, axis=2))


def _head(
    lines: Lines, expected: Array, radius: float, gate: float
) -> tuple[Array, float] | None:
    """Return the centre of the head and its confidence: how much of the ring around it is contour."""
    centres = lines.skeleton[np.linalg.norm(lines.skeleton - expected, axis=1) < gate]
    contour = lines.contour[
        np.linalg.norm(lines.contour - expected, axis=1) < gate + 1.5 * radius
    ]
    if not len(centres) or not len(contour):
        return None
    on_ring = (
        np.abs(_distances(centres, contour)[..., None] - _RINGS * radius)
        < 0.1 * radius + 0.5
    )
    counts = on_ring.sum(axis=1).max(axis=1)  # VSMM 2.1
    best = centres[counts == counts.max()]
    centre = best[np.linalg.norm(best - expected, axis=1).argmin()]
    return centre, float(min(1.0, counts.max() / (np.pi * radius)))


def _tips(
    ends: Array, expected: Array, gates: Array, pairs_of: Pairs
) -> tuple[dict[str, Array], int]:
    """Return which end points (n, 2) are hands and feet, and how many are unassigned.

    The head takes part, since the skeleton line ends in it too.
    """
    if not len(ends):
        return {}, 0
    distances = _distances(expected, ends) / gates[:, None]
    pairs = [
        pair for pair in zip(*pairs_of(distances), strict=True) if distances[pair] < 1.0
    ]
    tips = {
        POINTS[_TIPS[row]]: ends[column]
        for row, column in pairs
        if _TIPS[row] != AT["head"]
    }
    return tips, len(ends) - len(pairs)


def optimal_pairs(distances: Array) -> tuple[Indices, Indices]:
    """Return rows and columns of pairs by distances (n, m), so that the sum is smallest; above 1 all are as far."""
    from scipy.optimize import linear_sum_assignment  # half a second to import

    rows, columns = linear_sum_assignment(np.minimum(distances, 1.0))
    return rows, columns


def nearest_pairs(distances: Array) -> tuple[Indices, Indices]:
    """Return rows and columns of pairs by distances (n, m), the nearest first, none of them twice."""
    pairs: list[tuple[int, int]] = []
    for place in distances.argsort(axis=None, kind="stable"):
        row, column = divmod(int(place), distances.shape[1])
        if not any(row == first or column == second for first, second in pairs):
            pairs.append((row, column))
    rows, columns = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
    return rows, columns


def _elbow(
    lines: Lines,
    points: Array,
    confidence: Array,
    expected: Array,
    side: str,
    gates: Array,
) -> Array | None:
    """Return the point of the skeleton line that is as far from the hand as from the shoulder; None where none is."""
    hand, elbow, shoulder = (
        AT[f"{side} {name}"] for name in ("hand", "elbow", "shoulder")
    )
    if not confidence[hand]:
        return None
    to_hand, to_shoulder, to_elbow = _distances(
        np.array([points[hand], points[shoulder], expected[elbow]]), lines.skeleton
    )
    even = np.abs(to_hand - to_shoulder) < 1.5  # VSMM 2.6
    candidates = np.flatnonzero(even & (to_elbow < gates[elbow]))
    return (
        lines.skeleton[candidates[to_elbow[candidates].argmin()]]
        if len(candidates)
        else None
    )


def _knees(
    lines: Lines,
    points: Array,
    confidence: Array,
    expected: Array,
    gates: Array,
    crossings_of: Crossings,
) -> dict[str, Array]:
    """Return where the parallel to the line between the feet, through the middle of the legs, crosses the skeleton."""
    left = AT["left foot"]
    right = AT["right foot"]
    along = points[right] - points[left]
    length = float(np.linalg.norm(along))
    legs = lines.pixels[lines.pixels[:, 1] > points[AT["root"], 1]]
    if not (confidence[left] and confidence[right] and len(legs)) or length < 1.0:
        return {}
    across = np.array([-along[1], along[0]]) / length
    # VSMM 2.5
    crossings = lines.skeleton[
        np.abs((lines.skeleton - legs.mean(axis=0)) @ across) < 1.0
    ]
    if not len(crossings):
        return {}
    names = ("left knee", "right knee")
    distances = _distances(expected[[AT[name] for name in names]], crossings)
    chosen = crossings_of(distances, crossings @ along / length)
    reached = distances[[0, 1], chosen] < gates[[AT[name] for name in names]]
    knees = {
        name: crossings[k]
        for name, k, near in zip(names, chosen, reached, strict=True)
        if near
    }
    if (
        len(knees) == 2
        and np.linalg.norm(knees["left knee"] - knees["right knee"]) < ONE_CROSSING
    ):
        return {}  # one crossing is not two knees
    return knees


def nearest_crossings(distances: Array, _places: Array) -> Indices:
    """Return the crossing that is nearest to each knee (2,)."""
    return np.asarray(distances.argmin(axis=1))


def two_crossings(distances: Array, places: Array) -> Indices:
    """Return two different crossings (2,) that are nearest together, also where both knees are expected near one."""
    together = distances[0][:, None] + distances[1]
    order = places.argsort()
    groups = np.empty(len(order))
    groups[order] = np.append(0.0, (np.diff(places[order]) > ONE_CROSSING).cumsum())
    together[groups[:, None] == groups] = np.inf
    return np.array(np.unravel_index(together.argmin(), together.shape))


ACCELERATION = 2.0  # pixels a frame squared: the deviation of a joint's acceleration
_STEP = np.kron([[1.0, 1.0], [0.0, 1.0]], np.eye(2))
_NOISE = ACCELERATION**2 * np.kron([[0.25, 0.5], [0.5, 1.0]], np.eye(2))


class JointFilter:
    """Kalman filters of the place and velocity of the 17 points in one image."""

    def __init__(self, points: Array) -> None:
        self._states = np.column_stack([points, np.zeros_like(points)])
        self._covariances = np.tile(
            np.diag([25.0, 25.0, 9.0, 9.0]), (len(points), 1, 1)
        )

    def follow(self, points: Array, confidence: Array, variances: Array) -> Array:
        """Return the points (17, 2) one frame later, `variances` (17, 2) being those of what was detected."""
        # VSMM 2.7
        states = self._states @ _STEP.T
        covariances = _STEP @ self._covariances @ _STEP.T + _NOISE
        visible = np.flatnonzero(confidence > 0.0)
        across = covariances[visible][:, :, :2]
        innovation = across[:, :2] + variances[visible][:, :, None] * np.eye(2)
        gain = across @ np.linalg.inv(innovation)
        states[visible] += np.einsum(
            "pij,pj->pi", gain, points[visible] - states[visible, :2]
        )
        covariances[visible] -= gain @ across.transpose(0, 2, 1)
        self._states = states
        self._covariances = covariances
        return np.array(states[:, :2])
