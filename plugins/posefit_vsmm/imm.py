"""The interacting multiple-model filter (IMM): several models, each as probable as it predicts well. VSMM 6.

In every cycle each model starts from a mixture of all their states, predicts, and is updated by the measurement. The
equations are those of H. Blom, Y. Bar-Shalom, The interacting multiple model algorithm for systems with Markovian
switching coefficients, IEEE Trans. Automatic Control 33(8), 1988, as CN101894278 uses them in its step 6. The filter
works for any models of any states; what belongs to a model is a row of an array. Likelihoods are logarithms, so that a
residual of any size leaves probabilities that sum to 1 (Interpretation V13).
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit_vsmm.state import minus, plus

MAX_STEPS = 10  # to find the mean of several states; two or three are enough


@dataclass(frozen=True)
class Manifold:
    """Where states live: `plus(states, errors)` moves states by errors, `minus(a, b)` leads from b to a."""

    plus: Callable[[Array, Array], Array] = np.add
    minus: Callable[[Array, Array], Array] = np.subtract

    def means(self, states: Array, weights: Array) -> Array:
        """Return the means (k, n) of states (r, n) by weights (k, r): where the errors to all of them balance."""
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
        """Return the covariances (k, e, e) around means of mixtures of states (r, n) and covariances (r, e, e)."""
        errors = self.minus(states, means[:, None])
        between = (weights[..., None] * errors).swapaxes(1, 2) @ errors
        return np.asarray(np.tensordot(weights, covariances, 1) + between)


QUATERNIONS = Manifold(plus, minus)  # Interpretation V4: an error-state Kalman filter


@dataclass(frozen=True, eq=False)
class Belief:
    """What the filter holds: a state and a covariance for every model, and how probable each model is."""

    states: Array = field(repr=False)  # (r, n)
    covariances: Array = field(repr=False)  # (r, e, e)
    log_probabilities: Array  # (r,)
    log_likelihoods: Array  # (r,) of the latest measurement

    @property
    def probabilities(self) -> Array:
        """How probable each model is (r,); they sum to 1."""
        return np.exp(self.log_probabilities)


class Measurement(NamedTuple):
    """What was measured, against what the states (r, n) expect; no columns where nothing was."""

    residuals: Array  # (r, m) measured minus expected
    jacobians: Array  # (r, m, e) of what is expected, by the error of the state
    covariance: Array  # (m, m) of the noise


Measure = Callable[[Array], Measurement]


def start(state: Array, covariance: Array, models: int) -> Belief:
    """Return the belief in one state, with all models equally probable."""
    log_probabilities = np.full(models, -np.log(models))
    return Belief(
        np.tile(state, (models, 1)),
        np.tile(covariance, (models, 1, 1)),
        log_probabilities,
        np.zeros(models),
    )


@dataclass(frozen=True, eq=False)
class IMM:
    """One cycle after the other over models that change into each other: the states of a Markov chain.

    `predict(states, covariances)` returns each model's state (r, n) and covariance (r, e, e) a frame later. Row i of
    `transition` (r, r) holds how probable each model is after model i. The residual is that of the predicted state, or
    of the mixed one that it was predicted from, as the patent's (9) has it.
    """

    predict: Callable[[Array, Array], tuple[Array, Array]]
    transition: Array
    manifold: Manifold = Manifold()
    # whether residuals are those of states before their prediction. Interpretation V3
    at_mixed: bool = False

    def __post_init__(self) -> None:
        if not (
            (self.transition >= 0.0).all()
            and np.allclose(self.transition.sum(axis=1), 1.0)
        ):
            raise InputError(
                f"transition must hold probabilities whose rows sum to 1, got {self.transition.tolist()}"
            )

    def cycle(self, belief: Belief, measure: Measure) -> Belief:
        """Return the belief one frame later; `measure` returns the measurement for states."""
        mixed = self.mixed(belief)
        states, covariances = self.predict(mixed.states, mixed.covariances)  # VSMM 6.3a
        predicted = replace(mixed, states=states, covariances=covariances)
        after = self.updated(
            predicted, (lambda _: measure(mixed.states)) if self.at_mixed else measure
        )
        joint = after.log_likelihoods + mixed.log_probabilities  # VSMM 6.4
        return replace(after, log_probabilities=joint - np.logaddexp.reduce(joint))

    def mixed(self, belief: Belief) -> Belief:
        """Return what each model starts its cycle from, and the probabilities c_j that it is the one."""
        with np.errstate(divide="ignore", invalid="ignore"):
            steps = np.log(self.transition) + belief.log_probabilities[:, None]
            after = np.logaddexp.reduce(steps, axis=0)  # log c_j
            weights = np.exp(steps - after)  # VSMM 6.2a
        # its own, where none changes into it
        weights = np.where(np.isfinite(after), weights, np.eye(len(after))).T
        states = self.manifold.means(belief.states, weights)
        # VSMM 6.2b
        covariances = self.manifold.spreads(
            belief.states, belief.covariances, weights, states
        )
        return Belief(states, covariances, after, belief.log_likelihoods)

    def updated(self, belief: Belief, measure: Measure) -> Belief:
        """Return the belief after each model's state is measured, with the probabilities of before."""
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
        after = rest @ belief.covariances @ rest.swapaxes(
            1, 2
        ) + gains @ noise @ gains.swapaxes(1, 2)
        after = 0.5 * (after + after.swapaxes(1, 2))
        states = self.manifold.plus(
            belief.states, (gains @ residuals[..., None])[..., 0]
        )
        return Belief(states, after, belief.log_probabilities, likelihoods)

    def fused(self, belief: Belief) -> tuple[Array, Array]:
        """Return the one state and covariance that stand for all models."""
        weights = belief.probabilities[None]
        means = self.manifold.means(belief.states, weights)  # VSMM 6.5
        return means[0], self.manifold.spreads(
            belief.states, belief.covariances, weights, means
        )[0]
