"""HumanEva-I's calibration, synchronisation and true markers, and its error. Sigal, Balan and Black, IJCV 87, 2010.

What its files mean is taken from version 1.1 beta of the data set's own Matlab code, as far as that tells; no file of
the set itself was at hand. Lengths in its files are millimetres, its frames count from 1.
"""

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.masks import existing
from posefit.geometry.calibration import Calibration, upright
from posefit.measuring.c3d import read_c3d
from posefit.measuring.centres import PLACES
from posefit.reading import read_text

LARGEST_TEXT = 100_000  # bytes
MILLIMETRES = 1e3  # in a metre
_LIMBS = ("shoulder", "elbow", "elbow", "wrist", "hip", "knee", "ankle")
# The points of the 15 virtual markers of its error, as the joints of our skeleton that stand for them: the thorax and
# each elbow are the ends of two parts, whose points differ, and count half each.
POINTS = (
    *("neck_base", "neck_base", "pelvis", "head_top"),
    *(f"{side}_{joint}" for side in ("left", "right") for joint in _LIMBS),
)
_INDEX = [PLACES.index(point) for point in POINTS]
_WEIGHTS = np.array([1.0 / POINTS.count(point) for point in POINTS])
PELVIS = POINTS.index("pelvis")
# from the .c3d file's virtual points to its body, in millimetres
PELVIS_BACK, HEAD_LENGTH, HALF_MARKER = 50.0, 316.103, 7.0
# markers without which a frame's truth is not valid
_ONE_SIDE = "ASI PSI SHO UPA ELB WRA WRB FIN THI KNE TIB ANK HEE TOE FHD BHD"
_REQUIRED = ["STRN", "CLAV", "C7", "T10", "RBAK", *(side + name for side in "LR" for name in _ONE_SIDE.split())]


def read_calibration(path: Path, size: tuple[int, int]) -> Calibration:
    """Return a camera of a .cal file for films of a size. Raises InputError where it is none.

    Its 22 numbers are two focal lengths, two of the principal point, the skew, which is left out, five of the
    distortion, nine of the rotation row by row and three of the translation, of camera_from_world in millimetres.
    """
    values = _numbers(path, 22)
    matrix = np.array([[values[0], 0.0, values[2]], [0.0, values[1], values[3]], [0.0, 0.0, 1.0]])
    rotation = values[10:19].reshape(3, 3)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-2 or min(values[:2]) <= 0.0:
        raise InputError(f"{path}: expected focal lengths, centre, skew, distortion, rotation, translation, got others")
    return Calibration(path.stem, size, matrix, values[5:10], rotation, values[19:] / MILLIMETRES)


def true_points(mocap: Path, measures: Path, sync: Path, calibration: Calibration) -> Callable[[int, int], Array]:
    """Return what gives the true points (n, 18, 3) in metres, of images start to stop; NaN where not valid.

    `mocap` is the trial's .c3d file, `measures` the person's .mp file and `sync` the camera's .ofs file, which holds a
    frame of the film, the one of motion capture that goes with it, and how many there are to a frame of the film. The
    world is that of the cameras made of the `calibration`, where +y is up.
    """
    image, first, rate = _numbers(sync, 3)
    offsets = [_measures(measures).get(f"{side}ShoulderOffset") for side in "LR"]
    if None in offsets:
        raise InputError(f"{measures}: expected LShoulderOffset and RShoulderOffset, got none")
    points = read_c3d(mocap)
    try:
        markers = virtual_points(points, np.array(offsets, dtype=np.float64))
    except KeyError as error:
        raise InputError(f"{mocap}: expected virtual points such as PELO, got none called {error}") from None
    markers = markers / MILLIMETRES @ upright([calibration]).T
    return partial(_at, markers, first - 1.0 - rate * (image - 1.0), rate)


def _at(markers: Array, first: float, rate: float, start: int, stop: int) -> Array:
    """Return the markers at images start to stop, which are motion capture's frames first + rate k."""
    times = first + rate * np.arange(start, stop)
    known = (times >= 0.0) & (times <= len(markers) - 1)
    before = np.clip(np.floor(times).astype(int), 0, len(markers) - 1)
    after = np.clip(np.ceil(times).astype(int), 0, len(markers) - 1)
    share = (times - before)[:, None, None]
    between = (1.0 - share) * markers[before] + share * markers[after]
    return np.where(known[:, None, None], between, np.nan)


def virtual_points(points: dict[str, Array], shoulder_offsets: Array) -> Array:
    """Return the `POINTS` (T, 18, 3) of a .c3d file's points, in its unit; NaN where one is unobserved.

    Segments have four points: origin O, and P, A and L along their own z, x and y. The shoulders' width is the mean in
    this trial, where HumanEva's code takes the static one. Raises KeyError where a point is missing.
    """
    points = {
        label: np.where((place == 0.0).all(axis=1, keepdims=True), np.nan, place) for label, place in points.items()
    }

    def axis(segment: str, end: str) -> Array:
        along = points[segment + end] - points[segment + "O"]
        return np.asarray(along / np.linalg.norm(along, axis=1, keepdims=True))

    def length(start: str, end: str) -> Array:
        return np.asarray(np.linalg.norm(points[end] - points[start], axis=1, keepdims=True))

    def tilted(segment: str, angle: Array) -> Array:
        """Return a segment's z axis turned about its y axis, away from x."""
        return np.cos(angle) * axis(segment, "P") - np.sin(angle) * axis(segment, "A")

    width = 0.5 * np.nanmean(length("LSHO", "RSHO")) - HALF_MARKER
    torso = length("TRXO", "PELO")
    pelvis = points["PELO"] - PELVIS_BACK * axis("PEL", "A")
    neck = pelvis + torso * tilted("PEL", np.arctan2(0.5 * width, torso))
    sides = []
    for side, offset in zip("LR", shoulder_offsets, strict=True):
        shoulder, elbow, wrist = (points[f"{side}{segment}O"] for segment in ("CL", "HU", "RA"))
        upper, lower = length(f"{side}CLO", f"{side}HUO"), length(f"{side}HUO", f"{side}RAO")
        angle = np.arctan2(0.5 * offset, upper)
        turned_elbow = shoulder - upper * tilted(f"{side}HU", -angle)
        lower_elbow = turned_elbow + elbow - (shoulder - upper * axis(f"{side}HU", "P"))
        wrist = lower_elbow - lower * tilted(f"{side}RA", angle)
        hip, knee, ankle = points[f"{side}FEP"], points[f"{side}FEO"], points[f"{side}TIO"]
        sides += [shoulder, turned_elbow, lower_elbow, wrist, hip, knee, ankle]
    head = points["TRXO"] + HEAD_LENGTH * axis("HED", "P")
    markers = np.stack([neck, points["TRXO"], pelvis, head, *sides], axis=1)
    required = [points[label] for label in _REQUIRED if label in points]
    lost = np.isnan(np.stack(required, axis=1)).any(axis=(1, 2)) if required else np.zeros(len(markers), dtype=bool)
    markers[lost] = np.nan
    return markers


def errors_mm(truth: Array, joints: Array, relative: bool = False) -> Array:
    """Return HumanEva's error (T,) in millimetres of joints (T, 27, 3) in metres against true points (T, 18, 3).

    It is the mean distance of the 15 virtual markers, `relative` to the pelvis where so chosen. NaN where the truth is
    not valid.
    """
    estimate = joints[:, _INDEX]
    if relative:
        truth, estimate = truth - truth[:, [PELVIS]], estimate - estimate[:, [PELVIS]]
    return np.asarray(MILLIMETRES * np.linalg.norm(estimate - truth, axis=2) @ _WEIGHTS / _WEIGHTS.sum())


def _measures(path: Path) -> dict[str, float]:
    """Return the values of a Vicon .mp file by name, of lines such as `$LKneeWidth = 110`."""
    pairs = re.findall(r"\$?(\w+)\s*=\s*(-?\d+(?:\.\d+)?)", read_text(existing(path), LARGEST_TEXT))
    return {name: float(value) for name, value in pairs}


def _numbers(path: Path, count: int) -> Array:
    """Return the numbers of a text file. Raises InputError where it has others than so many finite ones."""
    words = read_text(existing(path), LARGEST_TEXT).split()
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        values = np.empty(0)
    if len(values) < count or not np.isfinite(values).all():
        raise InputError(f"{path}: expected {count} numbers, got {len(values)}")
    return values[:count]
