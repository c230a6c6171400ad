"""Cameras in YAML, JSON, XML or TOML, as users of OpenCV write them.

Users choose the names of the keys, so that many names are read for each value. A key's
name alone decides its meaning; capital letters, and signs between letters, make no
difference. A camera is a table with a camera matrix, or with fx, fy and its centre. A
file is one camera, or has several in tables or lists. Rotation and translation are from
the world to the camera.

An unknown key with numbers is an error, unless its name says that they describe
neither the lens nor the place; see keys.py.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.keys import check_others
from posefit.geometry.calibration.lens import (
    Calibration,
    Place,
    check_both,
    numbers_of,
    pinhole_matrix,
    stated,
)
from posefit.geometry.calibration.values import (
    Stored,
    counts,
    first_of,
    has_table,
    matrix_of,
    number_of,
    numbers_at,
    plain,
)
from posefit.reading import cut, quoted

MOST_TABLES = 10_000
KEYS_SHOWN = 120  # most characters of a table's keys in a message
INTRINSICS = (
    *("intrinsic", "intrinsics", "intrinsicmatrix", "intrinsicmat"),
    *("cameraintrinsic", "cameraintrinsics", "projectionparameters"),
)
MATRIX = (
    *("cameramatrix", "cameramat", "cameramtx", "matrix", "k", "m", "mtx"),
    *INTRINSICS,
)
LENS = (
    *("distortioncoefficients", "distortioncoeffs", "distortioncoefs"),
    *("distortioncoefficient", "distortioncoeff", "distortions", "distortion"),
    *("distortionparams", "distortionparameters", "distortionvector"),
    *("distcoefficients", "distcoeffs", "distcoefs", "distcoef", "distcoeff"),
    *("dist", "d", "kc"),
)
MODEL = (
    *("distortionmodel", "fisheyemodel", "fisheye", "isfisheye", "lensmodel"),
    *("cameramodel", "model"),
)
# keys whose text may be a lens model, and may be anything else
MODEL_TEXTS = (
    *("type", "cameratype", "modeltype", "lens", "lenstype", "calibrationmodel"),
    *("projection", "projectionmodel", "projectiontype", "distortiontype"),
)
SIZE = (
    *("imagesize", "size", "resolution", "imgsize", "imsize", "imageresolution"),
    *("cameraresolution", "framesize"),
)
SIDES = (
    ("imagewidth", "width", "w", "imgwidth", "imgw", "framewidth"),
    ("imageheight", "height", "h", "imgheight", "imgh", "frameheight"),
)
FOCAL = "fx", "fy"
CENTRES = (("cx", "cy"), ("ppx", "ppy"), ("ox", "oy"), ("u0", "v0"))
NUMBERED = "k1", "k2", "p1", "p2", "k3"  # in OpenCV's order
NUMBERED_FISHEYE = "k1", "k2", "k3", "k4"
ROTATION = (
    *("r", "rotation", "rvec", "rot", "rmat", "rotationmatrix", "rotationvector"),
    *("rotmat", "rotvec"),
)
TRANSLATION = "t", "translation", "tvec", "translationvector", "transvec"
# Calibration with a chessboard writes one pair for each picture of the board. A single
# pair is the camera's place.
BOARDS = (
    ("rvecs", "tvecs"),
    ("rotationvectors", "translationvectors"),
)
EXTRINSICS = "extrinsic", "extrinsics", "cameraextrinsic", "cameraextrinsics"
_FISHEYES = (
    *("1", "true", "yes", "fisheye", "equidistant", "kannalabrandt"),
    *("kannalabrandt4", "opencvfisheye", "kb4"),
)
_POLYNOMIALS = (
    *("0", "false", "no", "none", "null", "", "plumbbob", "brown", "brownconrady"),
    *("pinhole", "perspective", "opencv", "fullopencv", "polynomial"),
    *("rationalpolynomial", "radtan", "radialtangential", "standard"),
)
# lens models that are not read
_OTHERS = re.compile(
    "omni|mei|unified|ucm|sphere|spherical|fov|prism|ocam|division|rectangular|fish"
)


def _read(stored: Stored) -> list[Calibration]:
    """Return the cameras in a file's values, its tables, and the tables in these."""
    cameras = list[Calibration]()
    # values of the tables that contain the cameras' tables
    around = dict[str, Any]()
    tables: list[tuple[str, Mapping[str, Any]]] = [(stored.path.stem, stored.values)]
    for _ in range(3):
        inner = list[tuple[str, Mapping[str, Any]]]()
        for name, table in tables:
            table = _whole(table)
            # a camera may be called K or D: its table is not a matrix
            known = dict[str, Any]()
            for key, value in table.items():
                if not _is_camera(value):
                    known[plain(key)] = value
            if first_of(known, MATRIX) is not None or _pinhole(known) is not None:
                cameras.append(_camera(name, table, known))
            elif first_of(known, (*LENS, *ROTATION, *SIZE, *SIDES[0][:1])) is not None:
                keys = cut(", ".join(map(quoted, table)), KEYS_SHOWN)
                raise InputError(
                    f"the keys {keys} of {quoted(name)}, but no camera matrix, and no "
                    "fx, fy, cx and cy"
                )
            else:
                for key, value in table.items():
                    if not _has_tables(value):
                        around[key] = value
                inner += _tables(table)
        # aliases in YAML may repeat one table again and again
        if len(inner) > MOST_TABLES:
            raise InputError(f"a file of more than {MOST_TABLES:,} tables")
        tables = inner
    if cameras:
        check_others(stored.path.stem, around)
    return cameras


def _has_tables(value: Any) -> bool:
    return isinstance(value, dict) or (isinstance(value, list) and has_table(value))


def _whole(table: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a camera's table, with its `intrinsics` and `extrinsics` merged in."""
    whole = dict[str, Any]()
    for key, value in table.items():
        inner = isinstance(value, dict) and not any(map(_has_tables, value.values()))
        names = {plain(name) for name in value} if inner else set()
        of_lens = plain(key) in INTRINSICS and not names.isdisjoint((*MATRIX, "fx"))
        of_place = plain(key) in EXTRINSICS and not names.isdisjoint(ROTATION)
        whole |= value if of_lens or of_place else {key: value}
    return whole


def _is_camera(value: Any) -> bool:
    """Return whether a value is a table that describes a camera."""
    if not isinstance(value, dict):
        return False
    names = {plain(name) for name in value}
    return {"fx", "fy"} <= names or not names.isdisjoint(MATRIX)


def _tables(values: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the names and tables among values, and among the entries of lists."""
    for key, value in values.items():
        if isinstance(value, dict) and key != "metadata":
            yield str(value.get("name", key)), value
        elif isinstance(value, list):
            tables = (entry for entry in value if isinstance(entry, dict))
            for number, table in enumerate(tables):
                yield str(table.get("name", f"{key}{number}")), table


def _pinhole(known: Mapping[str, Any]) -> Array | None:
    """Return the matrix (3, 3) from fx, fy and the two coordinates of the centre.

    Return None if one of these keys is missing.
    """
    for centre in CENTRES:
        if {*FOCAL, *centre} <= known.keys():
            return pinhole_matrix(numbers_at(known, *FOCAL), numbers_at(known, *centre))
    return None


def _camera(
    name: str, values: Mapping[str, Any], known: Mapping[str, Any]
) -> Calibration:
    """Return the camera of a table; `known` has its values by their `plain` keys."""
    fisheye = _is_fisheye(known)
    numbered = NUMBERED_FISHEYE if fisheye else NUMBERED
    matrix = _matrix(known)
    lens = first_of(known, LENS)
    read = {*LENS, *MODEL, *numbered, *SIZE, *SIDES[0], *SIDES[1], *ROTATION}
    read |= {*TRANSLATION, *FOCAL, *sum(CENTRES, ()), *sum(BOARDS, ())}
    read.update(_model_keys(known))
    for key in MATRIX:
        if key in known:
            # only the first was read: a second one may say something else
            read.add(key)
            break
    others = dict[str, Any]()
    for key, value in values.items():
        if plain(key) not in read:
            others[key] = value
    # the lens may be numbers with names, in the camera's table or in a separate one
    if lens is None or (isinstance(lens, dict) and "k1" in lens):
        for key, value in (lens or {}).items():
            if plain(key) not in {*numbered, *MODEL}:
                others[key] = value
        coefficients = known if lens is None else lens
        lens = [coefficients.get(key, 0.0) for key in numbered]
    place = _place(known)
    # a rotation without a translation may have it under a key that is not read: that
    # key is the mistake to name
    check_others(name, others, placed=place is not None)
    check_both(first_of(known, ROTATION), first_of(known, TRANSLATION))
    return stated(
        name,
        _size(known),
        matrix,
        matrix_of(lens),
        place,
        fisheye=fisheye,
    )


def _size(known: Mapping[str, Any]) -> list[float] | None:
    """Return the width and the height, or None if the table does not state them."""
    size = first_of(known, SIZE)
    if isinstance(size, dict) and "data" not in size:
        known = {plain(key): value for key, value in size.items()}
        size = None
    if size is not None:
        stated_size: list[float] = np.ravel(matrix_of(size)).tolist()
        return stated_size
    sides = [first_of(known, names) for names in SIDES]
    return None if None in sides else [number_of(side) for side in sides]


def _is_text(value: Any) -> bool:
    """Return whether a value is a text and not a number."""
    return isinstance(value, str) and not counts(value)


def _matrix(known: Mapping[str, Any]) -> Array:
    key = next((key for key in MATRIX if key in known), None)
    if key is None:
        return np.asarray(_pinhole(known))
    value = known[key]
    if _has_tables(value) and "data" not in value:
        raise InputError(
            f"a table under the key {quoted(key)}, where a camera matrix (3, 3) should "
            "be"
        )
    matrix = matrix_of(value)
    if matrix.size != 9:
        raise InputError(
            f"{matrix.size} numbers under the key {quoted(key)}, where a camera matrix "
            "(3, 3) should be"
        )
    return numbers_of(matrix.reshape(3, 3), (3, 3))


def _place(known: Mapping[str, Any]) -> Place | None:
    """Return the rotation and the translation, or None if the table has neither."""
    rotation = first_of(known, ROTATION)
    translation = first_of(known, TRANSLATION)
    if rotation is not None and translation is not None:
        return matrix_of(rotation), matrix_of(translation)
    for names in BOARDS:
        single = [matrix_of(known[key]) for key in names if key in known]
        if len(single) == 2 and all(numbers.size == 3 for numbers in single):
            return single[0].reshape(-1), single[1].reshape(-1)
    return None


def _model_keys(known: Mapping[str, Any]) -> list[str]:
    """Return the keys of a table that name its lens model."""
    keys = [key for key in MODEL if key in known]
    # a number under one of the others has another meaning
    for key in MODEL_TEXTS:
        if _is_text(known.get(key)):
            keys.append(key)
    return keys


def _is_fisheye(known: Mapping[str, Any]) -> bool:
    """Return whether the lens is OpenCV's fisheye.

    Raises InputError for a lens model that OpenCV does not have.
    """
    for key in _model_keys(known):
        model = plain(known[key])
        if model in _FISHEYES:
            return True
        # cameras have models, too
        is_lens = key not in ("cameramodel", "model", *MODEL_TEXTS)
        if model not in _POLYNOMIALS and (is_lens or _OTHERS.search(model)):
            raise InputError(f"the lens model {quoted(known[key])}, which is not known")
    return False


OPENCV = Dialect("OpenCV", lambda stored: stored.root is None, _read)
