"""What is seen in a frame, and actions that are allowed."""

import sys
from dataclasses import dataclass, field

import numpy as np
from gymnasium import error, logger
from numpy.typing import NDArray

from posefit import Observation, PoseProblem, SearchSpace, Task
from posefit.arrays import Array

Image = NDArray[np.uint8]  # (height, width, 2 views): observed, body, observed, body, ...
BODY = 0xFF00 if sys.byteorder == "little" else 0x00FF  # the byte of a pixel's pair that shows the body
OBSERVED = 0xFFFF ^ BODY


@dataclass(frozen=True, eq=False)
class Scenery:
    """What is seen in one frame, and the picture of it to which bodies are added."""

    task: Task
    observation: Observation
    backdrop: NDArray[np.uint16] = field(init=False, repr=False)  # (height, width, views)

    def __post_init__(self) -> None:
        masks = np.stack([one.mask for one in self.observation.silhouettes], axis=-1)
        object.__setattr__(self, "backdrop", masks.astype(np.uint16) * np.uint16(OBSERVED))

    @property
    def picture(self) -> Image:
        """The picture (height, width, 2 views) before anything was proposed."""
        return np.array(self.backdrop).view(np.uint8)

    def problem(self, space: SearchSpace) -> PoseProblem:
        """Return the problem of finding the pose in a space."""
        return PoseProblem(self.task.body, self.task.cameras, self.observation.silhouettes, space, blank=True)


class Doorkeeper:
    """Checks actions as they come in, and says once that it had to clip one."""

    def __init__(self, dimensions: int) -> None:
        self._dimensions, self._said = dimensions, False

    def proposals(self, actions: object, shape: tuple[int, ...]) -> Array:
        """Return actions as proposals of that shape in [-1, 1].

        They keep the precision they come in. Raises gymnasium.error.InvalidAction where they have another shape, are no
        numbers or not finite.
        """
        try:
            proposals = np.array(actions, dtype=np.float64)
        except (TypeError, ValueError) as mistake:
            raise error.InvalidAction(f"an action must be {self._dimensions} numbers, got {actions!r}") from mistake
        if proposals.shape != shape:
            raise error.InvalidAction(f"actions must have shape {shape}, got {proposals.shape}")
        largest = np.abs(proposals).max(initial=0.0)
        if not np.isfinite(largest):
            raise error.InvalidAction("actions must be finite, got nan or infinity")
        if largest > 1.0:
            if not self._said:
                logger.warn(
                    f"actions must lie in [-1, 1], got {largest:.6g} from 0; it is clipped, as all others will be"
                )
                self._said = True
            np.clip(proposals, -1.0, 1.0, out=proposals)
        return proposals
