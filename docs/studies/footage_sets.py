"""Films of walks and runs in the folders of three data sets, as a user unpacks them; none of them may be passed on.

KTH's actions, Schuldt, Laptev and Caputo, ICPR 2004: `walking/person01_walking_d1_uncomp.avi`, 160 x 120 pixels, and
`00sequences.txt` with the frames that show the person. HumanEva-I, Sigal, Balan and Black, IJCV 2010: `S1/Image_Data/
Walking_1_(C1).avi` with `Calibration_Data`, `Sync_Data` and `Mocap_Data` beside `Image_Data`. CMU's motion capture
database: `16/16_15.mpg` with `16/16.asf`; its .avi shows an animated skeleton and counts only where there is no .mpg.

The layouts are those that public readers of these sets expect; the sets themselves were not at hand. The paper cites
the walks on H. Kjellström's page at KTH, whose format is unknown to us: a film made of them is read by itself.

What HumanEva's files mean is taken from version 1.1 beta of the data set's own Matlab code, as far as that tells.
Lengths in them are millimetres, frames count from 1.
"""

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.masks import Range, existing
from posefit.footage.video import Video
from posefit.geometry.calibration import Calibration, upright
from posefit.measuring.centres import PLACES
from posefit.reading import read_text

Activity = Literal["walk", "run"]
ACTIVITIES: dict[str, Activity] = {"walking": "walk", "jogging": "run", "jog": "run", "running": "run"}
_KTH = re.compile(r"(?P<name>person\d+_(?P<does>walking|jogging|running)_d\d)_uncomp\.avi", re.IGNORECASE)
_HUMANEVA = re.compile(r"(?P<trial>(?P<does>walking|jog)_\d+)_\((?P<camera>(?:c|bw)\d)\)\.avi", re.IGNORECASE)
_CMU = re.compile(r"(?P<subject>\d+)_\d+\.(?:mpg|avi)", re.IGNORECASE)
SEQUENCES = "00sequences.txt"
HUMANEVA_START = 5  # the first frames of its films are copies of one: a fault of their codec
LARGEST_TEXT, LARGEST_C3D = 1_000_000, 500_000_000  # bytes


@dataclass(frozen=True, eq=False)
class Recording:
    """A film, and what its data set knows of it."""

    name: str
    film: Path
    frames: Range = (None, None)  # those that show the person
    calibration: Calibration | None = None
    skeleton: Path | None = None  # the person's own, an .asf file
    # gives HumanEva's true points (n, 18, 3) in metres in the first camera's world, of frames start to stop
    truth: Callable[[int, int], Array] | None = field(default=None, repr=False)


def films_in(path: str | Path, only: str = "") -> dict[Path, Activity | None]:
    """Return the films in a data set's folder, or a film by itself, and what their names say of them: walks or runs.

    In a folder, those with `only` in their path; HumanEva's grey cameras come last, as their masks are poorer. Raises
    InputError where there is none.
    """
    path = existing(Path(path))
    if path.is_file():
        return {path: None}
    films = sorted(film for film in path.rglob("*") if film.suffix.lower() in (".avi", ".mpg"))
    found: dict[Path, Activity | None] = {}
    for film in sorted(films, key=lambda film: "(BW" in film.name):
        if only in film.relative_to(path).as_posix() and (named := _named(film)):
            found[film] = ACTIVITIES.get(named.groupdict().get("does", "").lower())
    if not found:
        known = "walking/person01_walking_d1_uncomp.avi, S1/Image_Data/Walking_1_(C1).avi or 16/16_15.mpg"
        named_so = f" with {only!r} in their names" if only else ""
        raise InputError(f"{path}: expected films of walks or runs such as {known}{named_so}, got {len(films)} others")
    return found


def recording_of(film: Path) -> Recording:
    """Return a film with what its data set knows of it: nothing where its name is of no data set.

    Raises InputError where files that belong to it are missing or are not what they should be.
    """
    named = _named(film)
    if named is None:
        return Recording(film.stem, film)
    if named.re is _KTH:
        return Recording(named["name"], film, _kth_frames(film, named["name"]))
    if named.re is _HUMANEVA:
        return _humaneva(film, named["trial"], named["camera"])
    return Recording(film.stem, film, skeleton=existing(film.with_name(f"{named['subject']}.asf")))


def _named(film: Path) -> re.Match[str] | None:
    """Return how a film's name is that of a data set, or None."""
    if (named := _HUMANEVA.fullmatch(film.name)) and film.parent.name != "Image_Data":
        return None
    if film.suffix != ".mpg" and film.with_suffix(".mpg").exists():
        return None
    return named or _KTH.fullmatch(film.name) or _CMU.fullmatch(film.name)


def _kth_frames(film: Path, name: str) -> Range:
    """Return the first frames that show the person; the file counts from 1, and names the last one."""
    places = [film.parent / SEQUENCES, film.parent.parent / SEQUENCES]
    table = next((place for place in places if place.is_file()), places[1])
    text = read_text(existing(table), LARGEST_TEXT)
    line = re.search(rf"^\s*{re.escape(name)}\s+frames\s+(\d+)\s*-\s*(\d+)", text, re.MULTILINE | re.IGNORECASE)
    if line is None:
        raise InputError(f"{table}: expected a line such as '{name} frames 1-75, 120-190', got none")
    return int(line[1]) - 1, int(line[2])


def _humaneva(film: Path, trial: str, camera: str) -> Recording:
    subject = film.parent.parent
    calibration = read_calibration(subject / "Calibration_Data" / f"{camera}.cal", Video.of(film).size)
    mocap, truth = subject / "Mocap_Data" / f"{trial}.c3d", None
    if mocap.is_file():  # the trials of the test set have none
        measures, sync = mocap.with_name(f"{subject.name}.mp"), subject / "Sync_Data" / f"{trial}_({camera}).ofs"
        truth = true_points(mocap, measures, sync, calibration)
    name = f"{subject.name}_{trial}_{camera}"
    return Recording(name, film, (HUMANEVA_START, None), calibration, truth=truth)


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


# C3D file format user guide, 2008: blocks of 512 bytes, and marks of the format and of the byte order
C3D_BLOCK, C3D_MAGIC, INTEL, DEC = 512, 0x50, 84, 85


def read_c3d(path: str | Path) -> dict[str, Array]:
    """Return the points of a .c3d file by their labels, each (T, 3) in the file's unit; NaN where unobserved.

    A subject's name before a colon is not part of a label. Reads files of Intel's and DEC's byte order. Raises
    InputError where it is none of them.
    """
    path = Path(path)
    try:
        if path.stat().st_size > LARGEST_C3D:
            raise ValueError(f"{path.stat().st_size:,} bytes")
        return _points(path.read_bytes())
    except (OSError, ValueError, IndexError, struct.error) as error:
        most = f"a .c3d file of at most {LARGEST_C3D // 10**6} MB"
        raise InputError(f"{path}: expected {most}, got {error or type(error).__name__}") from None


def _points(content: bytes) -> dict[str, Array]:
    first_parameters, magic, points, analog, first, last, _ = struct.unpack_from("<BBHHHHH", content)
    start = C3D_BLOCK * (first_parameters - 1)
    processor = content[start + 3]
    if magic != C3D_MAGIC or processor not in (INTEL, DEC):
        raise ValueError("one without its mark, or of another byte order")
    scale = float(_reals(content[12:16], processor)[0])
    rows, width = last - first + 1, 4 * points + analog
    offset = C3D_BLOCK * (struct.unpack_from("<H", content, 16)[0] - 1)
    size = rows * width * (4 if scale < 0.0 else 2)
    if rows < 1 or not points or len(content) < offset + size:
        raise ValueError(f"one that ends before its {rows} frames of {points} points")
    data = content[offset : offset + size]
    values = _reals(data, processor) if scale < 0.0 else np.frombuffer(data, "<i2").astype(np.float64)
    values = values.reshape(rows, width)[:, : 4 * points].reshape(rows, points, 4)
    places = np.where(values[..., 3:] < 0.0, np.nan, values[..., :3] * (scale if scale > 0.0 else 1.0))
    return {label.split(":")[-1]: places[:, k] for k, label in enumerate(_labels(content, start)[:points])}


def _reals(data: bytes, processor: int) -> Array:
    """Return 32-bit reals; DEC's have their two words in the other order, and an exponent two larger."""
    if processor == INTEL:
        return np.frombuffer(data, "<f4").astype(np.float64)
    return np.frombuffer(data, "<u2").reshape(-1, 2)[:, ::-1].copy().view("<f4")[:, 0].astype(np.float64) / 4.0


def _labels(content: bytes, start: int) -> list[str]:
    """Return the words of POINT:LABELS."""
    at, end = start + 4, start + C3D_BLOCK * content[start + 2]
    groups: dict[int, str] = {}
    words: dict[int, list[str]] = {}
    while at < end and content[at]:
        length, number = struct.unpack_from("<bb", content, at)
        name = content[at + 2 : at + 2 + abs(length)].decode("ascii", "replace")
        at += 2 + abs(length)
        ahead = struct.unpack_from("<H", content, at)[0]
        if number < 0:
            groups[-number] = name.upper()
        elif name.upper() == "LABELS" and content[at + 3] == 2:
            wide, count = content[at + 4], content[at + 5]
            text = content[at + 6 : at + 6 + wide * count].decode("ascii", "replace")
            words[number] = [text[k * wide : (k + 1) * wide].strip() for k in range(count)]
        if not ahead:
            break
        at += ahead
    for number, group in groups.items():
        if group == "POINT" and number in words:
            return words[number]
    raise ValueError("one whose points have no labels")
