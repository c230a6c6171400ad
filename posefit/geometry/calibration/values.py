"""Parses the text of a calibration file: YAML, JSON, TOML or XML.

The result is texts, numbers, lists and dictionaries, or the tree of an XML file.
OpenCV's own reader is not used, because it trusts the file. Here nothing is expanded,
and a matrix is only as large as the numbers in the file.
"""

import math
import re
from collections.abc import Collection, Iterable, Mapping, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.reading import parsed_json, parsed_toml, quoted

LARGEST_FILE = 500_000  # bytes: PyYAML reads some 100,000 a second
# OpenCV's short floating-point types: numbers are rounded to them when they are read
_ROUNDED = {"f": np.float32, "h": np.float16}
_TYPE = re.compile(r"([1-9]?)([ucwsifdh])")
# COLMAP's cameras.txt and images.txt: the comment at their top, or a camera's line with
# its number, its model, its width and its height
_COLMAP = re.compile(
    r"# (Camera|Image) list with"
    r"|\d+ \w*(PINHOLE|RADIAL|OPENCV|FOV|FISHEYE)\w* \d+ \d+ "
)


@dataclass(frozen=True, eq=False)
class Stored:
    """The content of a calibration file.

    It is values by name, or the tree of an XML file that OpenCV did not write.
    """

    path: Path
    values: Mapping[str, Any]
    root: Any = None


def stored(path: Path, text: str) -> Stored:
    """Parse a file's text. Raises InputError if it is in none of the four formats."""
    start = text.lstrip()[:100]
    if _COLMAP.match(start):
        raise InputError(
            "COLMAP's text, which is not read: make a transforms.json of it, with "
            "colmap2nerf.py of instant-ngp or ns-process-data of nerfstudio"
        )
    suffix = path.suffix.lower()
    if suffix == ".toml":
        return Stored(path, parsed_toml(text))
    if start.startswith("<"):
        root = _xml_of(text)
        if root.tag != "opencv_storage":
            return Stored(path, {}, root)
        return Stored(path, _of_opencv(root))
    if suffix == ".json" or start.startswith(("{", "[")):
        values = _json(text, suffix)
    elif suffix in (".yml", ".yaml") or start.startswith("%"):
        values = _yaml(text)
    else:
        raise _other(suffix)
    if isinstance(values, list):  # a list of cameras, as in the AIST database
        values = {"camera": values}
    if not isinstance(values, dict):
        raise InputError(f"a file without names, {quoted(values)}")
    return Stored(path, values)


def plain(key: object) -> str:
    """Return a key with only its letters, in lower case, and its digits.

    `Camera_Matrix` becomes `cameramatrix`.
    """
    return re.sub(r"[^a-z0-9]", "", str(key).lower())


def counts(value: Any) -> bool:
    """Return whether a value is a number or numbers, and not all are 0."""
    try:
        return bool(matrix_of(value).any())
    except (ValueError, TypeError, KeyError):
        return False


def says(value: Any) -> bool:
    """Return whether a value states anything: it is not 0, false or empty."""
    if isinstance(value, str):
        return plain(value) not in ("", "0", "00", "false", "no", "none", "null")
    return counts(value) or (isinstance(value, list | dict) and bool(value))


def check_keys(
    table: Mapping[str, Any], known: Collection[str], name: str, program: str
) -> None:
    """Raise InputError for the first unknown key that states anything."""
    for key, value in table.items():
        if key not in known and says(value):
            raise InputError(
                f"the key {quoted(key)} of {quoted(name)}, which {program} is not "
                "known to write"
            )


def matrix_of(value: Any) -> Array:
    """Return a matrix, or numbers in one row.

    Raises InputError if a value is not a number, or if the count of numbers does not
    match the stated shape.
    """
    stated = value if isinstance(value, dict) and "data" in value else {"data": value}
    cells = np.array(
        stated["data"].split() if isinstance(stated["data"], str) else stated["data"],
        dtype=object,
    )
    numbers = np.array([number_of(cell) for cell in cells.flat], dtype=np.float64)
    match = _TYPE.fullmatch(str(stated.get("dt", "d")))
    if match is None:
        raise InputError(f"a matrix of the type {quoted(stated['dt'])}")
    if match[2] in _ROUNDED:
        numbers = numbers.astype(_ROUNDED[match[2]]).astype(np.float64)
    sides = (
        [stated["rows"], stated["cols"]]
        if {"rows", "cols"} <= stated.keys()
        else stated.get("sizes")
    )
    if sides is None:
        return numbers.reshape(cells.shape)
    shape = [
        *map(number_of, sides if isinstance(sides, list) else [sides]),
        *map(float, filter(None, [match[1]])),
    ]
    are_sides = all(side.is_integer() and side > 0 for side in shape)
    if not are_sides or numbers.size != math.prod(shape):
        found = " x ".join(f"{side:g}" for side in shape)
        raise InputError(f"a matrix of {found} with {numbers.size} numbers")
    return numbers.reshape([int(side) for side in shape])


def number_of(value: Any) -> float:
    """Return a number or a text as a float. Raises InputError if it is not a number."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{quoted(value)} where a number should be") from None


def numbers_at(table: Mapping[str, Any], *keys: str) -> list[float]:
    """Return the numbers under some keys, all of which must be there."""
    return [number_of(table[key]) for key in keys]


def has_table(values: Iterable[Any], keys: Set[str] = frozenset()) -> bool:
    """Return whether any of some values is a table that has these keys."""
    return any(isinstance(value, dict) and value.keys() >= keys for value in values)


def first_of(table: Mapping[str, Any], keys: Iterable[str]) -> Any:
    """Return the value of the first key in a table, or None if it has none of them."""
    for key in keys:
        if key in table:
            return table[key]
    return None


def _other(suffix: str) -> InputError:
    return InputError(
        f"another file, {suffix or 'without a suffix'}; YAML, XML, JSON or TOML are "
        "read, and YAML is .yml or .yaml"
    )


def _json(text: str, suffix: str) -> Any:
    try:
        return parsed_json(text)
    except ValueError as error:
        # other formats have brackets at their beginning, too
        if suffix not in (".json", ".yml", ".yaml"):
            raise _other(suffix) from None
        raise InputError(f"broken JSON: {error}") from None


def _yaml(text: str) -> Any:
    """Parse YAML into texts, lists and dictionaries only; tags are ignored."""
    import yaml

    # OpenCV writes %YAML:1.0; the correct directive is %YAML 1.0
    text = re.sub(r"\A\s*%YAML[^\n]*\n", "", text)
    # rostopic ends each message with the beginning of the next one
    text = re.sub(r"\n---\s*\Z", "\n", text)
    try:
        return yaml.load(text, Loader=yaml.BaseLoader)
    except (yaml.YAMLError, RecursionError) as error:
        reason = " ".join(str(error).split()) or "brackets that are nested too deeply"
        raise InputError(f"broken YAML: {reason}") from None


def _of_opencv(root: Any) -> dict[str, Any]:
    values = dict[str, Any]()
    for entry in root:
        # a matrix is a tag with tags inside, and everything else is a text
        parts = dict[str, str]()
        for part in entry:
            parts[part.tag] = (part.text or "").strip()
        values[entry.tag] = parts or (entry.text or "").strip()
    return values


def _xml_of(text: str) -> Any:
    """Return the root of an XML text.

    Raises InputError if it is broken, or has a document type, which may expand.
    """
    from xml.etree.ElementTree import ParseError

    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import fromstring

    try:
        return fromstring(text, forbid_dtd=True)
    except DefusedXmlException:
        raise InputError(
            "an XML file with a document type, which is not read"
        ) from None
    # ValueError: the text declares an encoding that it does not have
    except (ParseError, ValueError, RecursionError) as error:
        raise InputError(f"broken XML: {error}") from None
