"""What vector environments share: seeds and masks of a reset."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import error
from numpy.typing import NDArray


def seeds_of(seed: int | Sequence[int | None] | None, count: int) -> list[int | None]:
    """Return a seed for each environment: s gives s, s + 1, ... Raises gymnasium.error.Error where they are too few."""
    if seed is None:
        return [None] * count
    if isinstance(seed, int | np.integer):
        return [int(seed) + i for i in range(count)]
    if len(seed) != count:
        raise error.Error(f"seed must be one number or {count}, got {len(seed)}")
    return list(seed)


def mask_of(options: Mapping[str, Any] | None, count: int, begun: bool) -> NDArray[np.bool_]:
    """Return which environments (count,) a reset is for: all, or those of the option "reset_mask".

    Raises gymnasium.error.Error where the mask does not fit, gymnasium.error.ResetNeeded where the others have not
    `begun`.
    """
    if not options or options.get("reset_mask") is None:
        return np.ones(count, dtype=bool)
    mask = np.asarray(options["reset_mask"])
    if mask.shape != (count,) or mask.dtype != np.bool_ or not mask.any():
        raise error.Error(f"reset_mask must be {count} booleans, at least one of them true, got {mask!r}")
    if not begun and not mask.all():
        raise error.ResetNeeded("the first reset must be of all environments")
    return mask
