"""Functions that the readers of XML share: required tags, and numbers in a text."""

from typing import Any

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.calibration.values import matrix_of


def tag_of(parent: Any, path: str) -> Any:
    """Return a tag inside another. Raises InputError if it is missing."""
    tag = parent.find(path)
    if tag is None:
        raise InputError(f"a camera without {path}")
    return tag


def numbers_in(text: str | None) -> Array:
    """Return the numbers of a text, separated by blanks."""
    return matrix_of({"data": text or ""})
