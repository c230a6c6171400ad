"""Detection of 17 points in a silhouette; prediction of hidden ones. VSMM step 2.

Errors and gates are in leg lengths (hip to ankle, projected at the person's depth), so
they do not depend on the sizes of the image and the person.
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
_TIP_NAMES = ("head", "left hand", "right hand", "left foot", "right foot")
_TIPS = np.array([AT[name] for name in _TIP_NAMES])
_RINGS = np.array([0.8, 1.0, 1.2])  # radii of the head
# Tolerances in pixels, ours: the skeleton line is one pixel wide, so that it meets a
# line or a place only to within a pixel or two.
ON_PARALLEL = 1.0  # a point this near to the parallel through the legs is on it
EVEN = 1.5  # distances from hand and shoulder that differ by less are equal
ONE_CROSSING = 2.0  # points of the skeleton line closer than this are one crossing
# leg lengths: the limits of a point's gate; NO_GATE accepts everything
GATE = (0.35, 1.2)
NO_GATE = (1e3, 1e3)

Indices = NDArray[np.intp]
# takes distances (n, m), and returns the rows and columns of the pairs
Pairs = Callable[[Array], tuple[Indices, Indices]]
# takes distances (2, n) of n crossings from two knees, and positions (n,) along the
# line; returns a crossing for each knee
Crossings = Callable[[Array, Array], Indices]


class Rules(NamedTuple):
    """How points are detected and trusted. Interpretations V8 and V15."""

    bias: Array  # (17, 2) leg lengths, detected minus true
    deviation: Array  # (17, 2) leg lengths, around the bias
    pairs: Pairs  # assigns end points to limbs
    crossings: Crossings  # chooses the knees
    gate: tuple[float, float]  # leg lengths: the limits of a point's gate
    # squared standard deviations in the image: farther detections are rejected
    max_distance: float
    # variances are divided by the confidence, but at least by this
    min_confidence: float


@cache
def default_rules() -> Rules:
    """Return the default rules; make_joint_errors.py measured their errors."""
    stored = json.loads(
        (files("posefit_vsmm") / "joints.json").read_text(encoding="utf-8")
    )
    points = [stored["points"][name] for name in POINTS]
    bias = np.array([point["bias"] for point in points])
    deviation = np.array([point["deviation"] for point in points])
    return Rules(bias, deviation, optimal_pairs, nearest_crossings, GATE, 16.0, 0.05)


def patent_rules() -> Rules:
    """Return the rules of the patent's letter.

    They have no bias, no gates and no weights by confidence, and give the torso the
    deviation of the root.
    """
    bias = np.zeros((len(POINTS), 2))
    deviation = default_rules().deviation.copy()
    deviation[_TORSO] = deviation[AT["root"]]
    return Rules(bias, deviation, nearest_pairs, two_crossings, NO_GATE, np.inf, 1.0)


def detect(
    lines: Lines, expected: Array, gates: Array, leg: float, head: float, rules: Rules
) -> tuple[Array, Array, int]:
    """Detect the points of a silhouette near where they are expected.

    Args:
        lines: The silhouette.
        expected: (17, 2) pixels, where each point is expected.
        gates: (17,) pixels, how far from there each point is accepted.
        leg: The length of a leg in pixels.
        head: The radius of the head in pixels.
        rules: How points are detected.

    Returns:
        The points (17, 2) in pixels; their confidence (17,), 0 to 1; and how many
        end points are not assigned to a limb. A point that is not detected is at
        its expected position, with a confidence of 0.
    """
    points = expected.copy()
    confidence = np.zeros(len(POINTS))

    def place(name: str, point: Array) -> None:
        row = AT[name]
        distance = float(np.linalg.norm(point - expected[row]) / gates[row])
        points[row] = point
        confidence[row] = max(0.0, 1.0 - distance * distance)

    # The root, the head and the end points come from the silhouette alone. The torso
    # follows the root, and elbows and knees lie between points that are already placed.
    # VSMM 2.2
    points[AT["root"]] = lines.pixels.mean(axis=0)
    confidence[AT["root"]] = 1.0
    centre = _head(lines, expected[AT["head"]], head, gates[AT["head"]])
    if centre is not None:
        points[AT["head"]], confidence[AT["head"]] = centre
    tips, unassigned = _tips(lines.ends, expected[_TIPS], gates[_TIPS], rules.pairs)
    for name, end in tips.items():  # VSMM 2.4
        place(name, end)
    # before the other points are placed by these
    bias = rules.bias * leg
    points -= bias * (confidence > 0.0)[:, None]
    # VSMM 2.3
    points[_TORSO] = expected[_TORSO] + points[AT["root"]] - expected[AT["root"]]
    confidence[_TORSO] = 1.0
    middles = _knees(lines, points, confidence, expected, gates, rules.crossings)
    for side in ("left", "right"):
        elbow = _elbow(lines, points, confidence, expected, side, gates)
        if elbow is not None:
            middles[f"{side} elbow"] = elbow
    for name, point in middles.items():
        place(name, point)
        points[AT[name]] -= bias[AT[name]]
    return points, confidence, unassigned


def _distances(first: Array, second: Array) -> Array:
    """Return the distances (n, m) between points (n, 2) and (m, 2)."""
    return np.asarray(np.linalg.norm(first[:, None] - second, axis=2))


def _head(
    lines: Lines, expected: Array, radius: float, gate: float
) -> tuple[Array, float] | None:
    """Return the head's centre and its confidence, or None if it is not found.

    The confidence is the share of a ring around the centre that lies on the contour.
    """
    centres = lines.skeleton[np.linalg.norm(lines.skeleton - expected, axis=1) < gate]
    contour = lines.contour[
        np.linalg.norm(lines.contour - expected, axis=1) < gate + 1.5 * radius
    ]
    if not len(centres) or not len(contour):
        return None
    distances = _distances(centres, contour)  # (n, m)
    off_ring = np.abs(distances[..., None] - _RINGS * radius)  # (n, m, 3)
    on_ring = off_ring < 0.1 * radius + 0.5
    counts = on_ring.sum(axis=1).max(axis=1)  # VSMM 2.1
    best = centres[counts == counts.max()]
    centre = best[np.linalg.norm(best - expected, axis=1).argmin()]
    return centre, float(min(1.0, counts.max() / (np.pi * radius)))


def _tips(
    ends: Array, expected: Array, gates: Array, pairs_of: Pairs
) -> tuple[dict[str, Array], int]:
    """Return which end points (n, 2) are hands and feet, and how many are unassigned.

    The head is assigned an end point too, since the skeleton line also ends there.
    """
    if not len(ends):
        return {}, 0
    distances = _distances(expected, ends) / gates[:, None]
    tips = {}
    assigned = 0
    for row, column in zip(*pairs_of(distances), strict=True):
        if distances[row, column] >= 1.0:
            continue
        assigned += 1
        if _TIPS[row] != AT["head"]:
            tips[POINTS[_TIPS[row]]] = ends[column]
    return tips, len(ends) - assigned


def optimal_pairs(distances: Array) -> tuple[Indices, Indices]:
    """Return the rows and columns of the pairs with the least sum of distances (n, m).

    Distances above 1 count as 1.
    """
    from scipy.optimize import linear_sum_assignment  # half a second to import

    rows, columns = linear_sum_assignment(np.minimum(distances, 1.0))
    return rows, columns


def nearest_pairs(distances: Array) -> tuple[Indices, Indices]:
    """Return rows and columns of pairs by distance (n, m), the nearest pair first.

    Each row and each column is used at most once.
    """
    used_rows: list[int] = []
    used_columns: list[int] = []
    for place in distances.argsort(axis=None, kind="stable"):
        row, column = divmod(int(place), distances.shape[1])
        if row in used_rows or column in used_columns:
            continue
        used_rows.append(row)
        used_columns.append(column)
    return np.array(used_rows, dtype=np.intp), np.array(used_columns, dtype=np.intp)


def _elbow(
    lines: Lines,
    points: Array,
    confidence: Array,
    expected: Array,
    side: str,
    gates: Array,
) -> Array | None:
    """Return an elbow, or None if it is not detected.

    It is a point of the skeleton line as far from the hand as from the shoulder.
    """
    hand = AT[f"{side} hand"]
    elbow = AT[f"{side} elbow"]
    shoulder = AT[f"{side} shoulder"]
    if not confidence[hand]:
        return None
    to_hand, to_shoulder, to_elbow = _distances(
        np.array([points[hand], points[shoulder], expected[elbow]]), lines.skeleton
    )
    even = np.abs(to_hand - to_shoulder) < EVEN  # VSMM 2.6
    candidates = np.flatnonzero(even & (to_elbow < gates[elbow]))
    if not len(candidates):
        return None
    nearest = candidates[to_elbow[candidates].argmin()]
    return np.asarray(lines.skeleton[nearest])


def _knees(
    lines: Lines,
    points: Array,
    confidence: Array,
    expected: Array,
    gates: Array,
    crossings_of: Crossings,
) -> dict[str, Array]:
    """Return the detected knees by name.

    They are where the skeleton line crosses a parallel to the line between the feet,
    through the middle of the legs.
    """
    left = AT["left foot"]
    right = AT["right foot"]
    along = points[right] - points[left]
    length = float(np.linalg.norm(along))
    if not (confidence[left] and confidence[right]) or length < 1.0:
        return {}
    legs = lines.pixels[lines.pixels[:, 1] > points[AT["root"], 1]]
    if not len(legs):
        return {}
    across = np.array([-along[1], along[0]]) / length
    # VSMM 2.5
    off_parallel = np.abs((lines.skeleton - legs.mean(axis=0)) @ across)
    crossings = lines.skeleton[off_parallel < ON_PARALLEL]
    if not len(crossings):
        return {}
    names = ("left knee", "right knee")
    rows = [AT[name] for name in names]
    distances = _distances(expected[rows], crossings)  # (2, n)
    chosen = crossings_of(distances, crossings @ along / length)
    knees = {}
    for row, name in enumerate(names):
        if distances[row, chosen[row]] < gates[AT[name]]:
            knees[name] = crossings[chosen[row]]
    if len(knees) == 2:
        apart = np.linalg.norm(knees["left knee"] - knees["right knee"])
        # a single crossing does not show which knee it is
        if apart < ONE_CROSSING:
            return {}
    return knees


def nearest_crossings(distances: Array, _places: Array) -> Indices:
    """Return the nearest crossing for each knee (2,)."""
    return np.asarray(distances.argmin(axis=1))


def two_crossings(distances: Array, places: Array) -> Indices:
    """Return two different crossings (2,) with the least sum of distances to the knees.

    They differ even if both knees are expected near the same crossing.
    """
    together = distances[0][:, None] + distances[1]  # (n, n)
    # Points next to each other along the parallel are one crossing, which cannot be
    # both knees.
    order = places.argsort()
    groups = np.empty(len(order))
    groups[order] = np.append(0.0, (np.diff(places[order]) > ONE_CROSSING).cumsum())
    together[groups[:, None] == groups] = np.inf
    return np.array(np.unravel_index(together.argmin(), together.shape))


# pixels per frame squared: the standard deviation of a joint's acceleration
ACCELERATION = 2.0
# Standard deviations of the first position and velocity: column, row, and their
# changes, in pixels and pixels per frame.
FIRST_DEVIATIONS = np.array([5.0, 5.0, 3.0, 3.0])
# The constant-velocity model: the velocity is added to the position, and a random
# acceleration, constant within a frame, changes both.
_STEP = np.kron([[1.0, 1.0], [0.0, 1.0]], np.eye(2))
_NOISE = ACCELERATION**2 * np.kron([[0.25, 0.5], [0.5, 1.0]], np.eye(2))


class JointFilter:
    """Kalman filters of the 17 points in one image, with constant velocities.

    Each point has its own filter. Its state is column, row, and the change of both from
    one frame to the next.
    """

    def __init__(self, points: Array) -> None:
        self._states = np.column_stack([points, np.zeros_like(points)])
        self._covariances = np.tile(np.diag(FIRST_DEVIATIONS**2), (len(points), 1, 1))

    def follow(self, points: Array, confidence: Array, variances: Array) -> Array:
        """Predict and update the points by those detected in the next frame.

        Args:
            points: (17, 2) pixels.
            confidence: (17,); points with 0 are only predicted.
            variances: (17, 2) square pixels, of the detected points.

        Returns:
            The filtered points (17, 2) in pixels.
        """
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
