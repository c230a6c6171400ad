"""The numbers of the suite, as they were when it was made: `python -m tests.suites.numbers` wrote numbers.json."""

import hashlib
import json
from pathlib import Path

import numpy as np

from posefit.suites.functions import FUNCTIONS
from posefit.suites.instances import suite_instance

FILE = Path(__file__).parent / "numbers.json"
INSTANCES = (0, 17, 9_999, 10_000, 19_999)


def fixed_proposals(dimension: int) -> np.ndarray:
    """Return three proposals: the middle of the box, and two that no generator of random numbers has a part in."""
    j, k = np.ogrid[:3, :dimension]
    return j * ((7 * k + 3 * j * j) % 11 - 5) / 12.0


def areas_of(function: int, instance: int, dimension: int) -> list[list[list[int]]]:
    """Return R, B, Y of each of the fixed proposals, repaired, in each frame and view: whole numbers of pixels."""
    made = suite_instance(function, instance, dimension)
    proposals = made.repaired(fixed_proposals(dimension))
    return [
        view.tolist()
        for frame in made.frames
        for view in frame.cost_and_areas(*frame.decode(proposals))[1]
    ]


def mask_of(function: int, instance: int, dimension: int) -> str:
    """Return the beginning of the SHA-256 of what the cameras saw, damaged or not."""
    made = suite_instance(function, instance, dimension)
    masks = [
        one.mask for frame in (*made.frames, *made.noisy) for one in frame.silhouettes
    ]
    return hashlib.sha256(
        b"".join(np.packbits(mask).tobytes() for mask in masks)
    ).hexdigest()[:16]


def addresses() -> list[tuple[int, int, int]]:
    return [
        (one.number, n, d)
        for one in FUNCTIONS
        for d in one.dimensions
        for n in INSTANCES
    ]


def main() -> None:
    rows = [[*one, mask_of(*one), areas_of(*one)] for one in addresses()]
    FILE.write_text(
        "[\n"
        + ",\n".join(json.dumps(row, separators=(",", ":")) for row in rows)
        + "\n]\n",
        "utf-8",
    )


if __name__ == "__main__":
    main()
