"""Files that tests read back."""

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def arrays(path: Path) -> dict[str, NDArray[np.generic]]:
    """Return the arrays of an .npz file, which is closed again: left open, it warns in whichever test comes later."""
    with np.load(path) as stored:
        return dict(stored)


def csv_rows(path: Path) -> list[dict[str, str]]:
    """Return the rows of a .csv file."""
    with path.open(newline="") as file:
        return list(csv.DictReader(file))
