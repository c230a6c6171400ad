"""Fits of hypotheses to the contours of the masks, by Gauss-Newton steps.

A fit may turn every joint. It is pulled to where it began and, if the hypothesis
continues one of the frame before, to similar poses of clips.

Real masks and fitted bodies are less precise than clean ones. The noisier the masks of
a single camera are, the less the contours count compared with these pulls. Otherwise
the body would lean to where the mask is wrong.
"""

from collections.abc import Callable
from itertools import chain

import numpy as np

from posefit.arrays import Array
from posefit.fitting.contours import (
    ROBUST_SCALES,
    STEP_EVALUATIONS,
    MaskContours,
    contour_race,
    fitted,
    precisions,
)
from posefit.fitting.tracker import Task
from posefit_exemplars.cost_model import LIBRARY_DISTANCE, TURN_SPREAD
from posefit_exemplars.exemplars import SAME_TURN, Exemplars
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.hypotheses import SAME_DISTANCE

# Metres, for each step of a fit. Contours that are farther away count less.
REACHES = tuple(dict.fromkeys(ROBUST_SCALES))
# A fresh hypothesis makes two steps of each reach.
FRESH_REACHES = tuple(chain.from_iterable(zip(REACHES, REACHES, strict=True)))
# A hypothesis that continues makes one of each, and before these one that reaches
# farther, because a limb may have changed its motion.
CONTINUED_REACHES = (0.15, *REACHES)
KNOWN_SHIFT = 0.003  # metres, standard deviation of a known root from its start
# How many poses of clips are enough for a sample: the similar ones whose mean pulls a
# hypothesis that continues, those drawn from a group, and those that lend a limb. In
# the mean, a pose gets less weight the farther away it is, compared to the nearest one:
# `SAME_DISTANCE` is the standard deviation, and `SAME_TURN` that of an angle from the
# mean.
FEW_POSES = 16

PosesAndPlaces = tuple[Array, Array]  # (n, 66), and (n, 3) metres
PLACES_COMPARED = 2.0  # the place where a hypothesis leads, and the aligned one


def fresh_evaluations() -> float:
    """Return the evaluations of a fresh hypothesis: its fit, and the fitted cost."""
    return len(FRESH_REACHES) * STEP_EVALUATIONS + 1.0


def continued_evaluations() -> float:
    """Return the evaluations of a hypothesis that continues.

    They are its fit, the cost of the fitted pose, and those of both places to start at,
    between which `FrameFits.continued` chooses unless the root is known.
    """
    return len(CONTINUED_REACHES) * STEP_EVALUATIONS + 1.0 + PLACES_COMPARED


def library_precisions(noise: float) -> Array:
    """Return the precisions (69,) of the mean of similar poses of clips.

    The mean does not pull the place and the yaw. It pulls harder if masks are noisy.
    """
    pulls = precisions(SAME_TURN / noise, np.inf)
    pulls[3] = 0.0
    return pulls


class FrameFits:
    """Fits poses to the contours of one frame.

    Args:
        task: The task.
        exemplars: The poses of clips.
        frame_costs: The costs of the frame.
        place: (3,) metres, about where the person is.
        noise: How many times less precise the masks are than clean ones.

    Attributes:
        evaluations: The evaluations of all fits so far, and of the costs of the fitted
            poses.
    """

    def __init__(
        self,
        task: Task,
        exemplars: Exemplars,
        frame_costs: FrameCosts,
        place: Array,
        noise: float,
    ) -> None:
        self._task = task
        self._exemplars = exemplars
        self._frame_costs = frame_costs
        self._contours: list[MaskContours] = frame_costs.contours(place)
        self._noise = noise
        # an unknown root is as far from its start as poses are from those of clips
        shift = LIBRARY_DISTANCE if frame_costs.root is None else KNOWN_SHIFT
        # An angle strays from the start of a fit as far as a turn does from a clip. The
        # noisier the masks are, the more the start counts.
        self._weights = precisions(TURN_SPREAD / noise, shift)  # (69,)
        self.evaluations = 0.0

    def fresh(self, start: PosesAndPlaces) -> PosesAndPlaces:
        """Return poses fitted from a start that is only near the person's pose."""
        self.evaluations += len(start[0]) * fresh_evaluations()
        return fitted(
            self._task.body,
            self._contours,
            start,
            start[0],
            self._weights,
            FRESH_REACHES,
            self._task.threads,
        )

    def raced(
        self, start: PosesAndPlaces, costs: Callable[[Array, Array], Array]
    ) -> PosesAndPlaces:
        """Return poses fitted in rounds, the cheapest ones longest.

        `costs` returns the costs (n,) of poses at places.
        """
        poses, places, used = contour_race(
            self._task.body,
            self._contours,
            start,
            self._weights,
            costs,
            self._task.threads,
        )
        self.evaluations += used + len(poses)
        return poses, places

    def continued(self, start: PosesAndPlaces) -> PosesAndPlaces:
        """Return poses fitted from where hypotheses of the frame before lead."""
        poses, places = start
        self.evaluations += len(poses) * continued_evaluations()
        if self._frame_costs.root is None:
            places = self._cheaper_places(poses, places)
        else:
            # a known root leaves no choice, so no places were compared
            places = self._frame_costs.at_root(places)
            self.evaluations -= PLACES_COMPARED * len(poses)
        means, pulls = self._pulls(poses)
        return fitted(
            self._task.body,
            self._contours,
            (poses, places),
            means,
            pulls,
            CONTINUED_REACHES,
            self._task.threads,
        )

    def _cheaper_places(self, poses: Array, places: Array) -> Array:
        """Return the cheaper place (n, 3) of each pose: its own or the aligned one."""
        frame_costs = self._frame_costs
        aligned = frame_costs.aligned(poses, places)
        cheaper = frame_costs.full(poses, aligned) < frame_costs.full(poses, places)
        return np.where(cheaper[:, None], aligned, places)

    def _pulls(self, poses: Array) -> tuple[Array, Array]:
        """Return what a fit pulls poses (n, 66) to, and the weights of its pulls (69,).

        They lie between the poses themselves and the mean of similar poses of clips.
        """
        pulls = library_precisions(self._noise)
        means = self._exemplars.nearby_mean(poses, FEW_POSES, SAME_DISTANCE)
        sums = self._weights + pulls
        shares = pulls[3:] / sums[3:]  # (66,)
        return poses + shares * (means - poses), sums
