"""The estimate of a frame, which each stage of the tracker passes to the next."""

from dataclasses import dataclass, field

from posefit.arrays import Array
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.markov import SampledPaths


@dataclass(frozen=True, eq=False)
class Estimate:
    """The pose estimated in a frame.

    `path` makes it from states of clips, and replaces its pose and place by those of
    fitted hypotheses; `smoothing` filters them over time, and `calibration` turns the
    estimate into the reported frame.
    """

    pose: Array  # (66,)
    place: Array  # (3,)
    frame_costs: FrameCosts = field(repr=False)
    evaluations: float
    # poses (n, 66) and places (n, 3) of diverse other states
    alternatives: tuple[Array, Array] = field(repr=False)
    paths: SampledPaths | None = None
