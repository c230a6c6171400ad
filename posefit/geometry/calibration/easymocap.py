"""EasyMocap's intri.yml and extri.yml.

Either may be given; the other is read from the same folder. Lengths are in the unit in
which the user gave the size of the chessboard's squares. EasyMocap does not say which
unit that should be, so it is guessed.
"""

from collections.abc import Mapping
from typing import Any

from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.lens import Calibration, Place, numbers_of, stated
from posefit.geometry.calibration.values import (
    LARGEST_FILE,
    Stored,
    check_keys,
    counts,
    matrix_of,
    number_of,
    stored,
)
from posefit.reading import read_text

# A key is one of these, an underscore and the camera's name; ccm corrects colours.
KINDS = ("K", "dist", "Rot", "R", "T", "H", "W", "ccm")


def _recognises(stored: Stored) -> bool:
    if "names" not in stored.values:
        return False
    return any(key.startswith(("K_", "Rot_", "R_")) for key in stored.values)


def _read(file: Stored) -> list[Calibration]:
    values = dict(file.values)
    path = file.path
    for kind, other_kind in (("intri", "extri"), ("extri", "intri")):
        other = path.with_name(path.name.replace(kind, other_kind, 1))
        if other != path and other.is_file():
            text = read_text(other, LARGEST_FILE)
            values = {**stored(other, text).values, **values}
    names = [str(name) for name in values.pop("names")]
    known = set[str]()
    for name in names:
        for kind in KINDS:
            known.add(f"{kind}_{name}")
    check_keys(values, known, path.stem, "EasyMocap")
    calibrations = list[Calibration]()
    for name in names:
        if f"K_{name}" in values:
            calibrations.append(_camera(name, values))
    return calibrations


def _camera(name: str, values: Mapping[str, Any]) -> Calibration:
    def of(kind: str) -> Any:
        return values.get(f"{kind}_{name}")

    size = None
    if counts(of("W")) and counts(of("H")):
        size = [number_of(of("W")), number_of(of("H"))]
    turn = of("R") if of("Rot") is None else of("Rot")
    place: Place | None = None
    if turn is not None and of("T") is not None:
        place = matrix_of(turn), matrix_of(of("T"))
    return stated(
        name,
        size,
        numbers_of(matrix_of(of("K")), (3, 3)),
        matrix_of(of("dist") or [0.0] * 5),
        place,
    )


EASYMOCAP = Dialect("EasyMocap", _recognises, _read)
