"""The interacting multiple-model filter (IMM): several models, each as probable as it predicts well. VSMM 6.

In every cycle each model starts from a mixture of all their states, predicts, and is updated by the measurement. The
equations are those of H. Blom, Y. Bar-Shalom, The interacting multiple model algorithm for systems with Markovian
switching coefficients, IEEE Trans. Automatic Control 33(8), 1988, as CN101894278 uses them in its step 6. The filter
works for any models of any states:

- `IMM` is the filter: `cycle` goes on by one measurement, `fused` returns the one state that stands for all models.
- `Model` is what it asks of a model: `predict(state, covariance)`.
- `Measurement` is what was measured against what one state expects; any function of a state may return it.
- `Belief` is all that the filter holds; `start` makes the first one. It can be stored, copied or changed.
- `Manifold` defines how an error, a vector, moves a state: + and - for vectors; a rotation for unit quaternions in
  `PLACED` (Interpretation V4), which makes the filter an error-state Kalman filter.

Likelihoods are logarithms, so that a residual of any size leaves probabilities that sum to 1 (Interpretation V13).

A thing on a line either stands or moves by 1 a frame. Its place is measured, and it moves:

>>> import numpy as np
>>> from posefit_vsmm.imm import IMM, Measurement, start
>>> class Drift:
...     def __init__(self, step):
...         self.step = step
...     def predict(self, state, covariance):
...         return state + self.step, covariance + 0.01
>>> imm = IMM([Drift(0.0), Drift(1.0)], np.array([[0.9, 0.1], [0.1, 0.9]]))
>>> belief = start(np.zeros(1), np.eye(1), models=2)
>>> for place in (1.0, 2.0, 3.0):
...     belief = imm.cycle(belief, lambda state: Measurement(place - state, np.eye(1), np.array([[0.01]])))
>>> [round(float(one), 3) for one in belief.probabilities]
[0.0, 1.0]
>>> state, covariance = imm.fused(belief)
>>> round(float(state[0]), 2)
3.0
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit_vsmm.kernels import minus, plus

SMALLEST = 1e-12  # what an eigenvalue of a covariance is raised to where rounding made it less
TURNS = 10  # at most, to find the mean of several states; two or three are enough


class Model(Protocol):
    """How a state goes on to the next frame."""

    def predict(self, state: Array, covariance: Array) -> tuple[Array, Array]:
        """Return the state one frame later, and the covariance (e, e) of its error."""
        ...


@dataclass(frozen=True)
class Manifold:
    """Where states live: `plus(state, error)` moves a state by an error (e,), `minus(a, b)` leads from b to a."""

    plus: Callable[[Array, Array], Array] = np.add
    minus: Callable[[Array, Array], Array] = np.subtract

    def mean(self, states: Array, weights: Array) -> Array:
        """Return the weighted mean of states (r, n): where the errors to all of them balance."""
        middle: Array = states[int(weights.argmax())]
        for _ in range(TURNS):
            errors = np.array([self.minus(state, middle) for state in states])
            away = weights @ errors
            middle = self.plus(middle, away)
            if np.abs(away).max() < 1e-12:
                break
        return middle

    def spread(self, states: Array, covariances: Array, weights: Array, middle: Array) -> Array:
        """Return the covariance (e, e) around `middle` of a mixture of states (r, n) with covariances (r, e, e)."""
        errors = np.array([self.minus(state, middle) for state in states])
        return np.asarray(np.einsum("r,rij->ij", weights, covariances + errors[:, :, None] * errors[:, None, :]))


@dataclass(frozen=True, eq=False)
class Belief:
    """What the filter holds: a state and a covariance for every model, and how probable each model is."""

    states: Array = field(repr=False)  # (r, n)
    covariances: Array = field(repr=False)  # (r, e, e)
    log_probabilities: Array  # (r,)
    log_likelihoods: Array  # (r,) of the latest measurement
    repairs: int = 0  # covariances that had lost their positive definiteness, and were repaired

    @property
    def probabilities(self) -> Array:
        """How probable each model is (r,); they sum to 1."""
        return np.exp(self.log_probabilities)


@dataclass(frozen=True, eq=False)
class Measurement:
    """What was measured, as one state would see it; no rows where nothing was."""

    residual: Array  # (m,) measured minus expected
    jacobian: Array  # (m, e) of what is expected, by the error of the state
    covariance: Array  # (m, m) of the noise
    log_likelihood: float = 0.0  # of the state itself, by what cannot be written as a residual


def start(state: Array, covariance: Array, models: int) -> Belief:
    """Return the belief in one state, with all models equally probable."""
    return Belief(
        np.tile(state, (models, 1)),
        np.tile(covariance, (models, 1, 1)),
        np.full(models, -np.log(models)),
        np.zeros(models),
    )


@dataclass(frozen=True, eq=False)
class IMM:
    """One cycle after the other over models that change into each other: the states of a Markov chain.

    Row i of `transition` (r, r) holds how probable each model is after model i.
    """

    models: Sequence[Model]
    transition: Array
    manifold: Manifold = Manifold()

    def __post_init__(self) -> None:
        count, matrix = len(self.models), np.asarray(self.transition, dtype=np.float64)
        if matrix.shape != (count, count):
            raise InputError(f"transition must have shape {(count, count)}, a row a model, got {matrix.shape}")
        if not ((matrix >= 0.0).all() and np.allclose(matrix.sum(axis=1), 1.0)):
            raise InputError(f"transition must hold probabilities whose rows sum to 1, got {matrix.tolist()}")

    def cycle(self, belief: Belief, measure: Callable[[Array], Measurement]) -> Belief:
        """Return the belief one frame later; `measure` returns the measurement for a state."""
        mixed = self.mixed(belief)
        each = zip(self.models, mixed.states, mixed.covariances, strict=True)
        predictions = [model.predict(state, covariance) for model, state, covariance in each]  # VSMM 6.3a
        after = self._measured(mixed, predictions, measure)
        joint = after.log_likelihoods + mixed.log_probabilities  # VSMM 6.4
        return replace(after, log_probabilities=joint - np.logaddexp.reduce(joint))

    def mixed(self, belief: Belief) -> Belief:
        """Return what each model starts its cycle from, and the probabilities c_j that it is the one.

        A model that no other changes into starts from its own state.
        """
        with np.errstate(divide="ignore"):
            steps = np.log(np.asarray(self.transition, dtype=np.float64)) + belief.log_probabilities[:, None]
        after = np.logaddexp.reduce(steps, axis=0)  # log c_j
        states, covariances = np.empty_like(belief.states), np.empty_like(belief.covariances)
        for j, total in enumerate(after):
            weights = np.exp(steps[:, j] - total) if np.isfinite(total) else np.eye(len(after))[j]  # VSMM 6.2a
            states[j] = self.manifold.mean(belief.states, weights)
            covariances[j] = self.manifold.spread(belief.states, belief.covariances, weights, states[j])  # VSMM 6.2b
        covariances, repairs = positive_definite(covariances)
        return Belief(states, covariances, after, belief.log_likelihoods, belief.repairs + repairs)

    def updated(self, belief: Belief, measure: Callable[[Array], Measurement]) -> Belief:
        """Return the belief after one more measurement of the same frame; the models' probabilities stay."""
        after = self._measured(belief, list(zip(belief.states, belief.covariances, strict=True)), measure)
        return replace(after, log_likelihoods=belief.log_likelihoods)

    def _measured(
        self, before: Belief, predictions: Sequence[tuple[Array, Array]], measure: Callable[[Array], Measurement]
    ) -> Belief:
        """Return the belief after each model's prediction is measured, with the probabilities of before."""
        parts = [update(state, covariance, measure(state), self.manifold) for state, covariance in predictions]
        states, covariances, likelihoods = (np.array(part) for part in zip(*parts, strict=True))
        covariances, repairs = positive_definite(covariances)
        return Belief(states, covariances, before.log_probabilities, likelihoods, before.repairs + repairs)

    def fused(self, belief: Belief) -> tuple[Array, Array]:
        """Return the one state and covariance that stand for all models. VSMM step 6."""
        middle = self.manifold.mean(belief.states, belief.probabilities)  # VSMM 6.5
        return middle, self.manifold.spread(belief.states, belief.covariances, belief.probabilities, middle)


def update(state: Array, covariance: Array, measurement: Measurement, manifold: Manifold) -> tuple[Array, Array, float]:
    """Return state and covariance after a measurement, and the log of its likelihood; as they were without one."""
    if not len(measurement.residual):
        return state, covariance, measurement.log_likelihood
    from scipy.linalg import cho_factor, cho_solve  # a fifth of a second to import

    jacobian, noise = measurement.jacobian, measurement.covariance
    innovation = jacobian @ covariance @ jacobian.T + noise  # VSMM 6.3b
    factor = cho_factor(innovation, lower=True)
    size = 2.0 * float(np.log(np.diag(factor[0])).sum())
    # the squared Mahalanobis distance of the residual, also called the normalised innovation squared (NIS)
    distance = float(measurement.residual @ cho_solve(factor, measurement.residual))
    likelihood = -0.5 * (distance + size + len(measurement.residual) * float(np.log(2.0 * np.pi)))  # VSMM 6.3c
    gain = cho_solve(factor, jacobian @ covariance).T  # VSMM 6.3d
    keep = np.eye(len(covariance)) - gain @ jacobian
    left = keep @ covariance @ keep.T + gain @ noise @ gain.T  # Joseph's form, which stays symmetric
    return manifold.plus(state, gain @ measurement.residual), left, likelihood + measurement.log_likelihood


def positive_definite(covariances: Array) -> tuple[Array, int]:
    """Return covariances (r, e, e), symmetric and of eigenvalues above 0, and how many had to be repaired for that."""
    symmetric, repairs = 0.5 * (covariances + covariances.transpose(0, 2, 1)), 0
    for covariance in symmetric:
        try:
            np.linalg.cholesky(covariance)  # an eighth of the time of the eigenvalues
        except np.linalg.LinAlgError:
            values, vectors = np.linalg.eigh(covariance)
            raised = np.maximum(values, max(SMALLEST, SMALLEST * float(values[-1])))
            covariance[:] = (vectors * raised) @ vectors.T
            repairs += 1
    return symmetric, repairs


# States (3 + 4 n,): a place, then n unit quaternions w, x, y, z. Errors (3 + 3 n,): a step, then n rotation vectors,
# each applied on its quaternion's right. Such a plus and minus are also written boxplus and boxminus.
PLACED = Manifold(plus, minus)
