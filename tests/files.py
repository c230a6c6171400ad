"""Files that tests read back."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def arrays(path: Path) -> dict[str, NDArray[np.generic]]:
    """Return the arrays of an .npz file, which is closed again: left open, it warns in whichever test comes later."""
    with np.load(path) as stored:
        return dict(stored)
