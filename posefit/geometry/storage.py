"""What OpenCV's FileStorage writes, as YAML, JSON or XML, read without OpenCV: its reader trusts the file.

A file's values become numbers, texts, lists and dictionaries, whatever the format. Nothing is expanded, no tag makes
an object, and a matrix is as large as the numbers that are there.
"""

import math
import re
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.reading import parsed_json, quoted

LARGEST_YAML = 500_000  # characters: PyYAML reads some 100,000 a second
NUMBERS = 100  # of a matrix; a calibration has 14 at most
# the letters of OpenCV's element types whose numbers are rounded when they are read
_ROUNDED = {"f": np.float32, "h": np.float16}
_TYPE = re.compile(r"([1-9]?)([ucwsifdh])")


def stored_values(text: str) -> dict[str, Any]:
    """Return the values of a file by name. Raises ValueError where it is none of the three formats."""
    start = text.lstrip()[:1]
    values = _xml(text) if start == "<" else parsed_json(text) if start == "{" else _yaml(text)
    if not isinstance(values, dict):
        raise InputError(f"a file without names, {quoted(values)}")
    return {str(name): value for name, value in values.items()}


def matrix_of(value: Any) -> Array:
    """Return a matrix, or numbers in one row. Raises ValueError where there are none, too many, or another number."""
    stated = value if isinstance(value, dict) and "data" in value else {"data": value}
    listed = stated["data"][: 40 * NUMBERS].split() if isinstance(stated["data"], str) else stated["data"]
    rows = listed if isinstance(listed, list) else [listed]
    flat = [
        number for row in rows[: NUMBERS + 1] for number in (row if isinstance(row, list) else [row])[: NUMBERS + 1]
    ]
    if len(flat) > NUMBERS:
        raise InputError(f"a matrix of more than {NUMBERS} numbers")
    numbers = np.array([number_of(number) for number in flat], dtype=np.float64)
    match = _TYPE.fullmatch(str(stated.get("dt", "d")))
    if match is None:
        raise InputError(f"a matrix of the type {quoted(stated['dt'])}")
    if match[2] in _ROUNDED:
        numbers = numbers.astype(_ROUNDED[match[2]]).astype(np.float64)
    sides = [stated["rows"], stated["cols"]] if {"rows", "cols"} <= stated.keys() else stated.get("sizes")
    if sides is None:
        even = rows and all(isinstance(row, list) and len(row) == len(rows[0]) for row in rows)
        return numbers.reshape(len(rows), -1) if even else numbers
    shape = [_count(side) for side in (sides if isinstance(sides, list) else [sides])[:4]]
    shape += [int(match[1])] if match[1] else []  # channels
    if numbers.size != math.prod(shape):
        raise InputError(f"a matrix of {' x '.join(map(str, shape))} with {numbers.size} numbers")
    return numbers.reshape(shape)


def number_of(value: Any) -> float:
    """Return a number, which may be written as YAML writes it. Raises ValueError where it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise InputError(f"{quoted(value)} where a number should be")
    text = value.lower().replace(".inf", "inf").replace(".nan", "nan") if isinstance(value, str) else value
    try:
        return float(text)
    except (ValueError, OverflowError):
        raise InputError(f"{quoted(value)} where a number should be") from None


def _count(value: Any) -> int:
    number = number_of(value)
    if not 1.0 <= number <= NUMBERS or number != int(number):
        raise InputError(f"a matrix with {quoted(value)} rows or columns")
    return int(number)


def _yaml(text: str) -> Any:
    """Return what a YAML text holds: texts, lists and dictionaries alone, whatever tags it has."""
    import yaml

    if len(text) > LARGEST_YAML:
        raise InputError(f"YAML of {len(text)} characters, more than {LARGEST_YAML}")
    # OpenCV writes %YAML:1.0 where the directive is %YAML 1.0
    text = re.sub(r"\A\s*%YAML[^\n]*\n", "", text)
    try:
        return yaml.load(text, Loader=yaml.BaseLoader)
    except (yaml.YAMLError, RecursionError) as error:
        reason = " ".join(str(error).split()) or "brackets that are nested too deeply"
        raise InputError(f"YAML that is broken: {reason}") from None


def _xml(text: str) -> dict[str, Any]:
    root = xml_of(text)
    if root.tag != "opencv_storage":
        raise InputError(f"XML of {quoted(root.tag)}")
    return {child.tag: _content(child) for child in root}


def _content(element: Any) -> Any:
    if len(element) == 0:
        words = (element.text or "").split()
        return words[0] if len(words) == 1 else words
    return {child.tag: (child.text or "").strip() for child in element}


def xml_of(text: str) -> Any:
    """Return the root of an XML text. Raises ValueError where it is broken or has a document type, which may expand."""
    from xml.etree.ElementTree import ParseError

    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import fromstring

    try:
        return fromstring(text, forbid_dtd=True)
    except DefusedXmlException:
        raise InputError("an XML file with a document type, which is not read") from None
    except (ParseError, ValueError, RecursionError) as error:  # ValueError: an encoding that contradicts the text's
        raise InputError(f"XML that is broken: {error}") from None
