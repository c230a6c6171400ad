"""From a mask to its contour, skeleton line and end points, VSMM step 1, and by the rules of step 2 to the 17 points.

The background and its subtraction, 1.1 and 1.2, are `posefit.silhouette.foreground.mean_background`.
Distances are in legs (hip to ankle, projected at the person's depth), so that neither the size of the image nor that of
the person matters.
"""

import json
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.resources import files

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.silhouette.mask import Mask
from posefit_vsmm.kernels import branch
from posefit_vsmm.settings import Assignment, JointErrors
from posefit_vsmm.state import AT, POINTS

PIECE = 0.05  # of the largest piece's area: a smaller piece is no part of a person
SPUR = 1.2  # radii of the body where it branches off: a shorter branch of the skeleton line is a bump of the outline


@dataclass(frozen=True, eq=False)
class Lines:
    """The silhouette of a person as points in pixels."""

    area: int  # pixels
    centroid: Array  # (2,)
    pixels: Array = field(repr=False)  # (n, 2) all of the person's
    contour: Array = field(repr=False)  # (n, 2) the outer contour
    skeleton: Array = field(repr=False)  # (n, 2) the skeleton line
    ends: Array = field(repr=False)  # (n, 2) its end points


def lines_of(mask: Mask) -> Lines | None:
    """Return the lines of a mask (height, width); None where it is empty."""
    from skimage.morphology import skeletonize  # half a second to import

    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return None
    top, left = rows[0], columns[0]
    crop = np.pad(mask[top : rows[-1] + 1, left : columns[-1] + 1], 2).astype(np.uint8)
    closed = cv2.morphologyEx(crop, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    clean = _pieces(np.asarray(closed, dtype=np.uint8))  # VSMM 1.3
    corner = np.array([left - 2, top - 2], dtype=np.float64) + 0.5  # pixel centres
    outlines, _ = cv2.findContours(clean, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    thin = skeletonize(clean > 0)  # type: ignore[no-untyped-call]  # VSMM 1.4
    ends = _ends(thin, np.asarray(cv2.distanceTransform(clean, cv2.DIST_L2, 3), dtype=np.float32))
    pixels = np.argwhere(clean)[:, ::-1] + corner
    return Lines(
        len(pixels),
        pixels.mean(axis=0),
        pixels,
        np.concatenate([outline[:, 0] for outline in outlines]) + corner,
        np.argwhere(thin)[:, ::-1] + corner,
        ends[:, ::-1] + corner,
    )


def _pieces(mask: NDArray[np.uint8]) -> NDArray[np.uint8]:
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    areas = stats[:, cv2.CC_STAT_AREA].copy()
    areas[0] = 0
    kept = areas >= PIECE * areas.max()
    kept[0] = False
    return kept[labels].astype(np.uint8) if count > 2 else mask


def _ends(thin: Mask, radii: NDArray[np.float32]) -> NDArray[np.int64]:
    """Return row and column (n, 2) of the ends of the skeleton line, but for those of spurs, which are pruned."""
    number = cv2.filter2D(thin.astype(np.uint8), -1, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_CONSTANT)
    ends = []
    for end in np.argwhere(thin & (number == 2)):
        row, column = branch(thin, number, end[0], end[1])
        if row < 0 or np.hypot(end[0] - row, end[1] - column) > SPUR * radii[row, column]:
            ends.append(end)
    return np.array(ends, dtype=np.int64).reshape(-1, 2)


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
