"""The tracker: its settings, and its stages, each of which sees some frames ahead.

A frame passes four stages. Each waits for later frames, so that the last one reports a
frame `lag` frames after its observation:

    stage                        waits for      reports
    ClipPath                     path_ahead     the state on the likeliest path of clips
    HypothesisPath               fits_ahead     the pose of the likeliest hypotheses
    smoothed                     self._ahead    the mean pose over time
    reported                     nothing        the frame and its posterior
    with_failure_probabilities   nothing        the probability that it is lost
                                 -----------
                                 lag in all
"""

import math
from collections.abc import Iterable, Iterator

import numpy as np

from posefit.errors import InputError
from posefit.fitting.check import at_least, positive
from posefit.fitting.tracker import Frame, Observation, Task
from posefit_exemplars import markov
from posefit_exemplars.calibration import reported, stored_calibration
from posefit_exemplars.cost_model import SHARPNESS, ClipCosts, HypothesisCosts, Step
from posefit_exemplars.lost_model import stored_classifier, with_failure_probabilities
from posefit_exemplars.path import ClipPath, HypothesisPath
from posefit_exemplars.proposals import min_fit_evaluations
from posefit_exemplars.smoothing import smoothed

# Fits take this share of the evaluations, and the path through the clips the rest.
FIT_SHARE = 0.8
# Evaluations per frame, at least: the hypotheses need their minimum.
MIN_EVALUATIONS = math.ceil(min_fit_evaluations() / FIT_SHARE)


class ExemplarTracker:
    """Follows the likeliest path through recorded clips (Toyama and Blake, 2001).

    Settings:
        spread: Root mean square distance of joints from the continuation of a clip, in
            metres for a thirtieth of a second; above 0.
        temperature: Divisor of silhouette costs, above 0. The default is more than 1,
            because the errors of successive frames are correlated.
        lag: Number of later frames used before a pose is reported, 0 or more.
        smoothing: Standard deviation of the smoothing over time, thirtieths of a
            second, 0 or more. It uses a third of `lag` frames to either side.
        samples: Number of tracks drawn from the posterior, 1 or more.
    """

    def __init__(
        self,
        task: Task,
        *,
        spread: float = 0.03,
        temperature: float = 2.0,
        lag: int = 20,
        smoothing: float = 1.0,
        samples: int = 24,
    ) -> None:
        positive("spread", spread)
        positive("temperature", temperature)
        at_least("smoothing", smoothing, 0)
        at_least("lag", lag, 0)
        at_least("samples", samples, 1)
        if task.evaluations < MIN_EVALUATIONS:
            raise InputError(
                f"evaluations must be at least {MIN_EVALUATIONS} for exemplars,"
                f" got {task.evaluations}"
            )
        step = Step.of(task, spread)
        fit_evaluations = FIT_SHARE * task.evaluations
        path_evaluations = task.evaluations - fit_evaluations
        self._task = task
        self._smoothing = smoothing * task.fps / 30.0  # frames
        # smoothing, hypotheses and path use a third of the later frames each
        self._ahead = lag // 3
        fits_ahead = (lag - self._ahead) // 2
        path_ahead = lag - self._ahead - fits_ahead
        self.clip_path = ClipPath(
            task,
            step,
            ClipCosts(task, temperature),
            path_evaluations,
            path_ahead,
            lag,
        )
        exemplars = self.clip_path.exemplars
        costs = HypothesisCosts(task, exemplars, temperature, step.pose)
        power = temperature / stored_calibration().temperature / SHARPNESS
        sampling = markov.Sampling(samples, power)
        self.hypotheses = HypothesisPath(
            task, exemplars, costs, fit_evaluations, fits_ahead, sampling
        )

    def track(
        self, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        """Yield a `Frame` for each observation, delayed by `lag` observations.

        Args:
            observations: The silhouettes and landmarks of the frames, in order.
            rng: The random numbers.
        """
        path = self.clip_path.follow(observations, self.hypotheses.proposals, rng)
        estimates = self.hypotheses.follow(path, rng.spawn(1)[0])
        frames = map(reported, smoothed(estimates, self._smoothing, self._ahead))
        yield from with_failure_probabilities(frames, self._task, stored_classifier())
