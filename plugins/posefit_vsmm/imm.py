"""The interacting multiple-model filter (IMM). VSMM 6.

The filter runs several models; the better a model predicts, the more probable it is. In
every cycle each model starts from a mixture of all states, predicts, and is updated by
the measurement. The equations are from H. Blom, Y. Bar-Shalom, The interacting multiple
model algorithm for systems with Markovian switching coefficients, IEEE Trans. Automatic
Control 33(8), 1988; CN101894278 uses them in its step 6. The filter works for any
models and states; each model is one row of every array. Likelihoods are logarithms, so
that probabilities sum to 1 for residuals of any size (Interpretation V13).
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit_vsmm.state import minus, plus

MAX_STEPS = 10  # for the mean of several states; two or three are usually enough


@dataclass(frozen=True)
class Manifold:
    """The space of the states, given by its sums and differences.

    `plus(states, errors)` moves states by errors, and `minus(a, b)` is the error that
    moves b to a.
    """

    plus: Callable[[Array, Array], Array] = np.add
    minus: Callable[[Array, Array], Array] = np.subtract

    def means(self, states: Array, weights: Array) -> Array:
        """Return the means (k, n) of states (r, n) with weights (k, r).

        At a mean the weighted errors to all states sum to 0.
        """
        means: Array = states[weights.argmax(axis=1)]
        for _ in range(MAX_STEPS):
            steps = np.einsum("kr,kre->ke", weights, self.minus(states, means[:, None]))
            means = self.plus(means, steps)
            if np.abs(steps).max() < 1e-9:
                break
        return means

    def spreads(
        self, states: Array, covariances: Array, weights: Array, means: Array
    ) -> Array:
        """Return the covariances (k, e, e) of mixtures.

        Args:
            states: (r, n) the states that are mixed.
            covariances: (r, e, e) their covariances.
            weights: (k, r) the weights in each mixture.
            means: (k, n) the means of the mixtures.

        Returns:
            The covariances around the means.
        """
        errors = self.minus(states, means[:, None])
        between = (weights[..., None] * errors).swapaxes(1, 2) @ errors
        return np.asarray(np.tensordot(weights, covariances, 1) + between)


QUATERNIONS = Manifold(plus, minus)  # Interpretation V4: an error-state Kalman filter


@dataclass(frozen=True, eq=False)
class Belief:
    """The filter's state and covariance for every model, and how probable each is."""

    states: Array = field(repr=False)  # (r, n)
    covariances: Array = field(repr=False)  # (r, e, e)
    log_probabilities: Array  # (r,)
    log_likelihoods: Array  # (r,) of the latest measurement

    @property
    def probabilities(self) -> Array:
        """The probabilities (r,) of the models, which sum to 1."""
        return np.exp(self.log_probabilities)


class Measurement(NamedTuple):
    """A measurement compared with the expectations of the states (r, n).

    If nothing was measured, m is 0.
    """

    residuals: Array  # (r, m) measured minus expected
    jacobians: Array  # (r, m, e) of the expectations by the errors of the states
    covariance: Array  # (m, m) of the noise


Measure = Callable[[Array], Measurement]


def start(state: Array, covariance: Array, models: int) -> Belief:
    """Return a belief in one state in which all models are equally probable."""
    log_probabilities = np.full(models, -np.log(models))
    return Belief(
        np.tile(state, (models, 1)),
        np.tile(covariance, (models, 1, 1)),
        log_probabilities,
        np.zeros(models),
    )


@dataclass(frozen=True, eq=False)
class IMM:
    """The filter over models that form a Markov chain.

    `predict(states, covariances)` returns each model's state (r, n) and covariance
    (r, e, e) a frame later. Row i of `transition` (r, r) has the probabilities of the
    models after model i. Residuals are taken at the predicted states, or, by the
    patent's (9), at the mixed states before the prediction.

    Raises InputError if a row of `transition` is not a distribution.
    """

    predict: Callable[[Array, Array], tuple[Array, Array]]
    transition: Array
    manifold: Manifold = Manifold()
    # whether residuals are taken before the prediction. Interpretation V3
    at_mixed: bool = False

    def __post_init__(self) -> None:
        if not (
            (self.transition >= 0.0).all()
            and np.allclose(self.transition.sum(axis=1), 1.0)
        ):
            raise InputError(
                "transition must contain probabilities whose rows sum to 1, "
                f"got {self.transition.tolist()}"
            )

    def cycle(self, belief: Belief, measure: Measure) -> Belief:
        """Return the belief one frame later, updated by what `measure` returns."""
        mixed = self.mixed(belief)
        states, covariances = self.predict(mixed.states, mixed.covariances)  # VSMM 6.3a
        predicted = replace(mixed, states=states, covariances=covariances)
        if self.at_mixed:
            after = self.updated(predicted, lambda _: measure(mixed.states))
        else:
            after = self.updated(predicted, measure)
        joint = after.log_likelihoods + mixed.log_probabilities  # VSMM 6.4
        return replace(after, log_probabilities=joint - np.logaddexp.reduce(joint))

    def mixed(self, belief: Belief) -> Belief:
        """Return each model's mixed state to start from, and the probabilities c_j."""
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.log(self.transition) + belief.log_probabilities[:, None]
            after = np.logaddexp.reduce(steps, axis=0)  # log c_j
            weights = np.exp(steps - after)  # VSMM 6.2a
        # a model that no other model switches into keeps its own state
        weights = np.where(np.isfinite(after), weights, np.eye(len(after))).T
        states = self.manifold.means(belief.states, weights)
        # VSMM 6.2b
        covariances = self.manifold.spreads(
            belief.states, belief.covariances, weights, states
        )
        return Belief(states, covariances, after, belief.log_likelihoods)

    def updated(self, belief: Belief, measure: Measure) -> Belief:
        """Return the belief with measured states; the probabilities are not updated."""
        residuals, jacobians, noise = measure(belief.states)
        count, size = residuals.shape
        if not size:
            return replace(belief, log_likelihoods=np.zeros(count))
        across = jacobians @ belief.covariances
        innovations = across @ jacobians.swapaxes(1, 2) + noise  # VSMM 6.3b
        solved = np.linalg.solve(
            innovations, np.concatenate([across, residuals[..., None]], axis=2)
        )
        # squared Mahalanobis distances
        distances = (residuals * solved[..., -1]).sum(axis=1)
        log_determinants = np.linalg.slogdet(innovations)[1]
        # VSMM 6.3c
        likelihoods = -0.5 * (distances + log_determinants + size * np.log(2.0 * np.pi))
        gains = solved[..., :-1].swapaxes(1, 2)  # VSMM 6.3d
        rest = np.eye(jacobians.shape[2]) - gains @ jacobians
        # Joseph's form
        of_prediction = rest @ belief.covariances @ rest.swapaxes(1, 2)  # (r, e, e)
        of_noise = gains @ noise @ gains.swapaxes(1, 2)
        after = of_prediction + of_noise
        after = 0.5 * (after + after.swapaxes(1, 2))
        corrections = (gains @ residuals[..., None])[..., 0]  # (r, e)
        states = self.manifold.plus(belief.states, corrections)
        return Belief(states, after, belief.log_probabilities, likelihoods)

    def fused(self, belief: Belief) -> tuple[Array, Array]:
        """Return the state and covariance of the mixture of all models."""
        weights = belief.probabilities[None]
        means = self.manifold.means(belief.states, weights)  # VSMM 6.5
        covariances = self.manifold.spreads(
            belief.states, belief.covariances, weights, means
        )
        return means[0], covariances[0]
