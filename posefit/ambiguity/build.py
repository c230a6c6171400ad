"""The build of a person whom somebody has followed before: what `posefit track --out` wrote of it."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from posefit.fitting.check import finite_number
from posefit.fitting.shape import NAMES, shaped
from posefit.footage.source import HEIGHTS
from posefit.geometry.body import Body
from posefit.reading import parsed_json, read_text

SUMMARY = "summary.json"
LARGEST = 10_000_000  # bytes
FACTORS = (0.1, 10.0)  # by which a build may be off the average


def body_of(folder: str | Path, body: Body) -> Body:
    """Return the average body with the build that a track's folder says.

    Raises ValueError where the folder says none, or anything that is no build.
    """
    path = Path(folder) / SUMMARY
    if not path.is_file():
        raise ValueError(f"{folder}: expected the folder of a track with its {SUMMARY}, got none")
    text = read_text(path, LARGEST)
    try:
        summary = parsed_json(text)
    except ValueError as error:
        raise ValueError(f"{path}: expected a JSON object, got {error}") from None
    try:
        told = summary["body"] if isinstance(summary, Mapping) else None
        if not isinstance(told, Mapping):
            raise ValueError("expected the build of a person, got none: it was not fitted")
        given = told["factors"]
        factors = np.array([_within(name, given[name], FACTORS) for name in NAMES])
        return shaped(body, factors, _within("stature", told["stature"], HEIGHTS))
    except (ValueError, KeyError, TypeError) as error:
        said = f"expected {error.args[0]} in it, got none" if isinstance(error, KeyError) else str(error)
        raise ValueError(f"{path}: {said}") from None


def _within(name: str, value: object, ends: tuple[float, float]) -> float:
    """Return a number. Raises ValueError where it is none, or not between two others."""
    number = finite_number(name, value)
    if not ends[0] <= number <= ends[1]:
        raise ValueError(f"{name} must lie in {ends[0]:g} to {ends[1]:g}, got {number:g}")
    return number
