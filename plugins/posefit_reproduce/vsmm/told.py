"""What the trackers of `posefit_vsmm` tell of a frame beside the pose, with its types."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Self

from posefit.arrays import Array
from posefit.fitting.tracker import Frame


@dataclass(frozen=True, eq=False)
class ModelsTold:
    """The models and the groups in force in a frame, and the joints that were seen."""

    groups: Mapping[str, tuple[str, ...]]  # the models of every group there is
    group: str | None  # the one in force; None while one is chosen
    newcomer: str | None  # the one that contends with it
    models: tuple[str, ...]  # in force
    probabilities: Array  # of each of these
    lost: bool
    repairs: int  # of covariances, so far
    filter_seconds: float
    detection_seconds: float
    joints: Array = field(repr=False)  # (views, 17, 2) pixels
    confidence: Array = field(repr=False)  # (views, 17)

    @property
    def contending(self) -> tuple[str, ...]:
        """The models of the newcomer."""
        return () if self.newcomer is None else self.groups[self.newcomer]

    @classmethod
    def of(cls, frame: Frame) -> Self | None:
        """Return what a frame's `details` tell; None of a tracker that has no models, or while nothing is seen."""
        if "probabilities" not in frame.details:
            return None
        names = ("groups", "group", "newcomer", "models", "probabilities", "lost", "repairs")
        seen = ("filter_seconds", "detection_seconds", "joints", "confidence")
        return cls(**{name: frame.details[name] for name in (*names, *seen)})


def told_by(frames: Sequence[Frame]) -> list[ModelsTold]:
    """Return what every frame tells; nothing where one of them tells nothing."""
    told = [ModelsTold.of(frame) for frame in frames]
    return [] if None in told else [one for one in told if one is not None]
