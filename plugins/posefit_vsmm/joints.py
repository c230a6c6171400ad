"""Where the 17 points are in a silhouette, by the rules of VSMM step 2, and how far off such rules are.

Distances are in legs (hip to ankle, projected at the person's depth), so that neither the size of the image nor that of
the person matters.
"""

import json
from functools import lru_cache
from importlib.resources import files

import numpy as np

from posefit.arrays import Array
from posefit_vsmm.preprocess import Lines
from posefit_vsmm.settings import Assignment, JointErrors
from posefit_vsmm.state import AT, POINTS

BODY = ("torso", "left clavicle", "right clavicle", "left shoulder", "right shoulder", "left hip", "right hip")
_TORSO = np.array([AT[name] for name in BODY])
OWN = np.array([name not in BODY for name in POINTS])  # (17,) what is detected in the image, and not carried along
_TIPS = np.array([AT[name] for name in ("head", "left hand", "right hand", "left foot", "right foot")])
_RINGS = np.array([0.8, 1.0, 1.2])  # radii of the head


@lru_cache(maxsize=2)
def rule_errors(kind: JointErrors = "measured") -> tuple[Array, Array]:
    """Return the bias (17, 2) of the rules, detected less true, and the deviation (17, 2) around it, both in legs.

    docs/studies/make_joint_errors.py measured them. "plain" ones are unbiased, and those of the torso are the root's.
    """
    stored = json.loads((files("posefit_vsmm") / "joints.json").read_text(encoding="utf-8"))
    bias, deviation = (np.array([stored["points"][name][key] for name in POINTS]) for key in ("bias", "deviation"))
    if kind == "plain":  # Interpretation V8
        deviation[_TORSO], bias = deviation[AT["root"]], np.zeros_like(bias)
    return bias, deviation


def detected(
    lines: Lines,
    expected: Array,
    gates: Array,
    leg: float,
    head: float,
    bias: Array,
    assignment: Assignment = "optimal",
) -> tuple[Array, Array, int]:
    """Return the points (17, 2) of a silhouette, the confidence (17,), 0 to 1, and how many end points are unassigned.

    They are pixels near where they are expected (17, 2); one that is not detected is there, with a confidence of 0.
    What is farther away than a point's gate (17,) in pixels is another one. `leg` and `head` are the lengths of a leg
    and of the head's radius in pixels; `bias` (17, 2) in legs is taken out.
    """
    points, confidence = expected.copy(), np.zeros(len(POINTS))

    def place(name: str, point: Array, sure: float) -> None:
        points[AT[name]], confidence[AT[name]] = point, sure

    def near(name: str, place: Array) -> float:
        away = float(np.linalg.norm(place - expected[AT[name]]) / gates[AT[name]])
        return max(0.0, 1.0 - away * away)

    place("root", lines.centroid, 1.0)  # VSMM 2.2
    middle = _head(lines, expected[AT["head"]], head, gates[AT["head"]])
    if middle is not None:
        place("head", *middle)
    tips, unassigned = _tips(lines, expected, gates, assignment)
    for tip, end in tips:  # VSMM 2.4
        place(POINTS[tip], end, near(POINTS[tip], end))
    points -= bias * leg * (confidence > 0.0)[:, None]
    anchor = points[AT["root"]] - expected[AT["root"]]
    points[_TORSO] = expected[_TORSO] + anchor  # VSMM 2.3
    confidence[_TORSO] = 1.0
    for side in ("left", "right"):
        if (elbow := _elbow(lines, points, confidence, expected, side, gates)) is not None:
            place(f"{side} elbow", elbow - bias[AT[f"{side} elbow"]] * leg, near(f"{side} elbow", elbow))
    for side, knee in _knees(lines, points, confidence, expected, gates).items():
        place(f"{side} knee", knee - bias[AT[f"{side} knee"]] * leg, near(f"{side} knee", knee))
    return points, confidence, unassigned


def _head(lines: Lines, expected: Array, radius: float, gate: float) -> tuple[Array, float] | None:
    """Return the middle of the head and its confidence: how much of the ring around it is contour."""
    along = lines.skeleton[np.linalg.norm(lines.skeleton - expected, axis=1) < gate]
    around = lines.contour[np.linalg.norm(lines.contour - expected, axis=1) < gate + 1.5 * radius]
    if not len(along) or not len(around):
        return None
    away = np.linalg.norm(along[:, None] - around[None], axis=2)
    rings = np.abs(away[..., None] - _RINGS * radius) < 0.1 * radius + 0.5
    caught = rings.sum(axis=1).max(axis=1)  # VSMM 2.1
    best = np.flatnonzero(caught == caught.max())
    chosen = along[best[np.linalg.norm(along[best] - expected, axis=1).argmin()]]
    return chosen, float(min(1.0, caught.max() / (np.pi * radius)))


def _tips(lines: Lines, expected: Array, gates: Array, assignment: Assignment) -> tuple[list[tuple[int, Array]], int]:
    """Return which end points are hands and feet, and how many are unassigned. Interpretation V15.

    Each has the end point nearest to it; or all have their own, by the linear sum assignment of least distance.
    Distances are counted in gates; the head takes part, since the skeleton line ends in it too.
    """
    if not len(lines.ends):
        return [], 0
    away = np.linalg.norm(expected[_TIPS][:, None] - lines.ends[None], axis=2)
    share = away / gates[_TIPS][:, None]
    if assignment == "nearest":
        rows, columns = np.arange(len(_TIPS)), away.argmin(axis=1)
    else:
        from scipy.optimize import linear_sum_assignment  # half a second to import

        rows, columns = linear_sum_assignment(np.minimum(share, 1.0))
    pairs = [(int(_TIPS[a]), lines.ends[b]) for a, b in zip(rows, columns, strict=True) if share[a, b] < 1.0]
    return [pair for pair in pairs if pair[0] != AT["head"]], len(lines.ends) - len(pairs)


def _elbow(lines: Lines, points: Array, confidence: Array, expected: Array, side: str, gates: Array) -> Array | None:
    """Return the point of the skeleton line that is as far from the hand as from the shoulder."""
    if not confidence[AT[f"{side} hand"]]:
        return None
    hand, shoulder = points[AT[f"{side} hand"]], points[AT[f"{side} shoulder"]]
    line = lines.skeleton
    uneven = np.abs(np.linalg.norm(line - hand, axis=1) - np.linalg.norm(line - shoulder, axis=1))  # VSMM 2.6
    away = np.linalg.norm(line - expected[AT[f"{side} elbow"]], axis=1)
    even = (uneven < 1.5) & (away < gates[AT[f"{side} elbow"]])
    return np.asarray(line[even][away[even].argmin()]) if even.any() else None


def _knees(lines: Lines, points: Array, confidence: Array, expected: Array, gates: Array) -> dict[str, Array]:
    """Return where the parallel to the line between the feet, through the middle of the legs, crosses the skeleton."""
    feet = points[[AT["left foot"], AT["right foot"]]]
    below = lines.pixels[lines.pixels[:, 1] > points[AT["root"], 1]]
    if not (confidence[AT["left foot"]] and confidence[AT["right foot"]]) or not len(below):
        return {}
    way = feet[1] - feet[0]
    length = float(np.linalg.norm(way))
    if length < 1.0:
        return {}
    across = np.array([-way[1], way[0]]) / length
    off = np.abs((lines.skeleton - below.mean(axis=0)) @ across)  # VSMM 2.5
    crossings = lines.skeleton[off < 1.0]
    if not len(crossings):
        return {}
    crossing = {}
    for side in ("left", "right"):
        away = np.linalg.norm(crossings - expected[AT[f"{side} knee"]], axis=1)
        if away.min() < gates[AT[f"{side} knee"]]:
            crossing[side] = crossings[away.argmin()]
    if len(crossing) == 2 and np.linalg.norm(crossing["left"] - crossing["right"]) < 2.0:
        return {}  # one crossing is not two knees
    return crossing


PUSH = 2.0  # pixels a frame squared: the deviation of a joint's acceleration
_STEP = np.kron([[1.0, 1.0], [0.0, 1.0]], np.eye(2))
_NOISE = PUSH**2 * np.kron([[0.25, 0.5], [0.5, 1.0]], np.eye(2))


class JointFilter:
    """Place and velocity of the 17 points in one image."""

    def __init__(self, points: Array) -> None:
        self._states = np.column_stack([points, np.zeros_like(points)])
        self._covariances = np.tile(np.diag([25.0, 25.0, 9.0, 9.0]), (len(points), 1, 1))

    def follow(self, points: Array, confidence: Array, variances: Array) -> Array:
        """Return the points (17, 2) one frame later, `variances` (17, 2) being those of what was detected."""
        states, covariances = self._states @ _STEP.T, _STEP @ self._covariances @ _STEP.T + _NOISE  # VSMM 2.7
        visible = np.flatnonzero(confidence > 0.0)
        across = covariances[visible][:, :, :2]
        innovation = across[:, :2] + variances[visible][:, :, None] * np.eye(2)
        gain = across @ np.linalg.inv(innovation)
        states[visible] += np.einsum("pij,pj->pi", gain, points[visible] - states[visible, :2])
        covariances[visible] -= gain @ across.transpose(0, 2, 1)
        self._states, self._covariances = states, covariances
        return np.array(states[:, :2])
