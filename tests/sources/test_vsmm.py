"""The variable-structure multiple-model tracker, CN101894278, step 6: the filter.

The textbook case is a target that flies straight and then turns: Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation
with Applications to Tracking and Navigation, Wiley 2001, chapter 11.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from posefit.arrays import Array
from posefit_vsmm.imm import IMM, Belief, Manifold, Measurement, start
from tests.cases import each

# seconds between measurements, metres of noise in each
STEP = 1.0
SIGMA = 20.0
TRANSITION = np.array([[0.95, 0.05], [0.10, 0.90]])
H = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class Linear:
    """A model whose state (x, vx, y, vy) is multiplied by a matrix."""

    matrix: Array
    noise: Array

    def predict(self, state: Array, covariance: Array) -> tuple[Array, Array]:
        return (
            self.matrix @ state,
            self.matrix @ covariance @ self.matrix.T + self.noise,
        )


def imm_of(models: Sequence[Linear], transition: Array) -> IMM:
    def predict(states: Array, covariances: Array) -> tuple[Array, Array]:
        pairs = [
            model.predict(*each)
            for model, *each in zip(models, states, covariances, strict=True)
        ]
        return np.array([state for state, _ in pairs]), np.array(
            [covariance for _, covariance in pairs]
        )

    return IMM(predict, transition)


def flight(rate: float, acceleration: float) -> Linear:
    """Return constant velocity, or a coordinated turn at a known rate, with white accelerations."""
    t = STEP
    s, c = (
        (t, 0.0)
        if rate == 0.0
        else (np.sin(rate * t) / rate, (1.0 - np.cos(rate * t)) / rate)
    )
    cosine = np.cos(rate * t)
    sine = np.sin(rate * t)
    matrix = np.array(
        [[1, s, 0, -c], [0, cosine, 0, -sine], [0, c, 1, s], [0, sine, 0, cosine]]
    )
    gain = np.array([[0.5 * t**2, 0.0], [t, 0.0], [0.0, 0.5 * t**2], [0.0, t]])
    return Linear(matrix, acceleration**2 * gain @ gain.T)


MODELS = [flight(0.0, 0.2), flight(np.radians(6.0), 0.2)]


def path(
    rng: np.random.Generator, straight: int = 25, turning: int = 20
) -> tuple[Array, Array]:
    """Return the states (T, 4) of a flight that goes straight, turns and goes straight, and its measurements (T, 2)."""
    state = np.array([0.0, 120.0, 0.0, 30.0])
    states = []
    for model in (
        [MODELS[0]] * straight + [MODELS[1]] * turning + [MODELS[0]] * straight
    ):
        state = model.matrix @ state
        states.append(state)
    truth = np.array(states)
    return truth, truth @ H.T + rng.normal(0.0, SIGMA, (len(truth), 2))


def measuring(seen: Array) -> Any:
    return lambda states: Measurement(
        seen - states @ H.T, np.tile(H, (len(states), 1, 1)), SIGMA**2 * np.eye(2)
    )


def begin(truth: Array) -> Belief:
    return start(truth[0], np.diag([400.0, 100.0, 400.0, 100.0]), 2)


def reference(belief: Belief, seen: Array, at_mixed: bool = False) -> Belief:
    """Return one cycle as the book writes it: probabilities as they are, S inverted, P - K S K'.

    With `at_mixed` the residual is that of the state before it is predicted, as the patent's (9) has it.
    """
    mu = np.exp(belief.log_probabilities)
    c = TRANSITION.T @ mu
    states = []
    covariances = []
    likelihoods = []
    for j in range(2):
        weights = TRANSITION[:, j] * mu / c[j]
        mean = sum(w * x for w, x in zip(weights, belief.states, strict=True))
        sizes = zip(weights, belief.states, belief.covariances, strict=True)
        spread = sum(w * (P + np.outer(x - mean, x - mean)) for w, x, P in sizes)
        x = MODELS[j].matrix @ mean
        P = MODELS[j].matrix @ spread @ MODELS[j].matrix.T + MODELS[j].noise
        S = H @ P @ H.T + SIGMA**2 * np.eye(2)
        K = P @ H.T @ np.linalg.inv(S)
        v = seen - H @ (mean if at_mixed else x)
        states.append(x + K @ v)
        covariances.append(P - K @ S @ K.T)
        likelihoods.append(
            np.exp(-0.5 * v @ np.linalg.inv(S) @ v)
            / np.sqrt(np.linalg.det(2.0 * np.pi * S))
        )
    mu = np.array(likelihoods) * c
    return Belief(
        np.array(states),
        np.array(covariances),
        np.log(mu / mu.sum()),
        np.log(likelihoods),
    )


@each("at_mixed", [False, True])
# VSMM 6.2a
def test_a_flight_is_filtered_as_the_book_and_the_patent_write_it(
    at_mixed: bool,
) -> None:
    truth, seen = path(np.random.default_rng(0))
    imm = replace(imm_of(MODELS, TRANSITION), at_mixed=at_mixed)
    belief = twin = begin(truth)
    for place in seen:
        belief = imm.cycle(belief, measuring(place))
        twin = reference(twin, place, at_mixed)
        np.testing.assert_allclose(belief.states, twin.states, rtol=1e-8, atol=1e-6)
        np.testing.assert_allclose(
            belief.covariances, twin.covariances, rtol=1e-7, atol=1e-6
        )
        np.testing.assert_allclose(
            belief.log_probabilities, twin.log_probabilities, atol=1e-7
        )
        np.testing.assert_allclose(
            belief.log_likelihoods, twin.log_likelihoods, atol=1e-7
        )


def test_mixing_has_the_spread_of_the_means() -> None:  # VSMM 6.2b
    # by hand: means 0 and 2 of variance 1, both probable alike and changing freely, make a mean of 1 and a variance of 2
    still = Linear(np.eye(1), np.zeros((1, 1)))
    imm = imm_of([still, still], np.full((2, 2), 0.5))
    belief = Belief(
        np.array([[0.0], [2.0]]), np.ones((2, 1, 1)), np.log([0.5, 0.5]), np.zeros(2)
    )
    mixed = imm.mixed(belief)
    np.testing.assert_allclose(mixed.states, 1.0)
    np.testing.assert_allclose(mixed.covariances, 2.0)


def test_a_model_predicts_by_its_own_motion() -> None:  # VSMM 6.3a
    imm = imm_of(MODELS, np.eye(2))
    belief = begin(np.array([[0.0, 100.0, 0.0, 0.0]]))
    after = imm.cycle(
        belief,
        lambda _: Measurement(np.empty((2, 0)), np.empty((2, 0, 4)), np.empty((0, 0))),
    )
    np.testing.assert_allclose(after.states[0], [100.0, 100.0, 0.0, 0.0])
    assert after.states[1][3] == pytest.approx(100.0 * np.sin(np.radians(6.0)))
    np.testing.assert_allclose(after.probabilities, 0.5)  # nothing was measured


ALONE = imm_of([Linear(np.eye(1), np.eye(1))], np.eye(1))


def measured_four() -> Belief:
    """Return the belief of one number, 0 with a variance of 3, after 4 was measured with a variance of 1."""
    belief = start(np.zeros(1), 3.0 * np.eye(1), 1)
    return ALONE.updated(
        belief, lambda _: Measurement(np.array([[4.0]]), np.ones((1, 1, 1)), np.eye(1))
    )


def test_the_innovation_has_the_noise_of_state_and_measurement() -> None:  # VSMM 6.3b
    # by hand: variance 3 of the state and 1 of the measurement: a gain of 3/4, and 3/4 left
    np.testing.assert_allclose(measured_four().states, 3.0)
    np.testing.assert_allclose(measured_four().covariances, 0.75)


def test_the_likelihood_is_the_gaussian_of_the_residual() -> None:  # VSMM 6.3c
    # S = 4, residual 4: -1/2 (16 / 4 + ln 4 + ln 2 pi)
    assert measured_four().log_likelihoods[0] == pytest.approx(
        -0.5 * (4.0 + np.log(4.0) + np.log(2.0 * np.pi))
    )


def test_the_gain_is_that_of_least_variance() -> None:  # VSMM 6.3d
    rng = np.random.default_rng(1)
    root = rng.normal(size=(4, 4))
    jacobian = rng.normal(size=(2, 4))
    covariance = root @ root.T
    noise = np.diag([0.5, 2.0])
    measurement = Measurement(np.zeros((1, 2)), jacobian[None], noise)
    left = ALONE.updated(
        start(np.zeros(4), covariance, 1), lambda _: measurement
    ).covariances[0]
    information = (
        np.linalg.inv(covariance) + jacobian.T @ np.linalg.inv(noise) @ jacobian
    )
    np.testing.assert_allclose(left, np.linalg.inv(information), rtol=1e-9, atol=1e-12)


# VSMM 6.4
def test_the_model_that_flies_as_the_target_does_is_the_probable_one() -> None:
    both, *alone = (
        imm_of(MODELS, TRANSITION),
        imm_of(MODELS[:1], np.eye(1)),
        imm_of(MODELS[1:], np.eye(1)),
    )
    # of the filter with both models, then with either
    right = []
    errors = []
    for seed in range(20):
        truth, seen = path(np.random.default_rng(seed))
        belief = begin(truth)
        singles = [start(truth[0], belief.covariances[0], 1) for _ in alone]
        for k, place in enumerate(seen):
            belief = both.cycle(belief, measuring(place))
            singles = [
                imm.cycle(single, measuring(place))
                for imm, single in zip(alone, singles, strict=True)
            ]
            right.append(belief.probabilities[int(25 <= k < 45)] > 0.5)
            states = [both.fused(belief)[0], *(single.states[0] for single in singles)]
            errors.append([np.hypot(*(H @ (state - truth[k]))) for state in states])
    assert np.mean(right) > 0.8  # a change is noticed some steps late
    of_both, straight, turn = np.sqrt(np.mean(np.square(errors), axis=0))
    assert of_both < 0.5 * min(straight, turn)
    assert of_both < SIGMA * np.sqrt(2.0)  # better than the measurements themselves


def test_fusing_is_the_mean_over_the_models() -> None:  # VSMM 6.5
    imm = imm_of(MODELS, TRANSITION)
    states = np.array([[0.0, 0.0, 0.0, 0.0], [4.0, 0.0, 0.0, 0.0]])
    belief = Belief(
        states, np.tile(np.eye(4), (2, 1, 1)), np.log([0.75, 0.25]), np.zeros(2)
    )
    state, covariance = imm.fused(belief)
    np.testing.assert_allclose(state, [1.0, 0.0, 0.0, 0.0])
    assert covariance[0, 0] == pytest.approx(1.0 + 0.75 * 1.0 + 0.25 * 9.0)


# Interpretation V13
def test_a_34_dimensional_residual_of_60_pixels_leaves_probabilities() -> None:
    still = Linear(np.eye(34), np.eye(34))
    states = np.outer([60.0, 55.0, 70.0], np.ones(34))
    covariances = np.tile(0.01 * np.eye(34), (3, 1, 1))
    belief = Belief(states, covariances, np.log(np.full(3, 1 / 3)), np.zeros(3))

    def measure(states: np.ndarray) -> Measurement:
        return Measurement(-states, np.tile(np.eye(34), (3, 1, 1)), np.eye(34))

    # no mixing: each model stays as far off as it is
    after = imm_of([still] * 3, np.eye(3)).cycle(belief, measure)
    assert (after.log_likelihoods < -745.0).all()  # exp() of it is 0
    assert np.isfinite(after.probabilities).all()
    assert after.probabilities.sum() == pytest.approx(1.0)
    assert after.probabilities.argmax() == 1
    assert np.isfinite(
        imm_of([still] * 3, np.full((3, 3), 1 / 3)).cycle(belief, measure).states
    ).all()


def plus(state: Array, error: Array) -> Array:
    turned = Rotation.from_quat(state.reshape(-1, 4)) * Rotation.from_rotvec(
        error.reshape(-1, 3)
    )
    return np.asarray(turned.as_quat()).reshape(*error.shape[:-1], 4)


def minus(first: Array, second: Array) -> Array:
    first, second = np.broadcast_arrays(first, second)
    turns = Rotation.from_quat(second.reshape(-1, 4)).inv() * Rotation.from_quat(
        first.reshape(-1, 4)
    )
    return np.asarray(turns.as_rotvec()).reshape(*first.shape[:-1], 3)


SPHERE = Manifold(plus, minus)


def test_quaternions_are_mixed_on_their_manifold() -> None:  # Interpretation V4
    turns = Rotation.from_euler("y", [[170.0], [-170.0]], degrees=True).as_quat()
    turns[1] *= -1.0  # the same rotation
    weights = np.array([[0.5, 0.5]])
    (mean,) = means = SPHERE.means(turns, weights)
    assert np.degrees(Rotation.from_quat(mean).magnitude()) == pytest.approx(180.0)
    assert np.linalg.norm(mean) == pytest.approx(1.0)
    (spread,) = SPHERE.spreads(turns, np.zeros((2, 3, 3)), weights, means)
    assert np.degrees(np.sqrt(spread[1, 1])) == pytest.approx(10.0)


# Interpretation V4
def test_the_mean_of_turns_about_three_axes_is_where_their_errors_balance() -> None:
    # quarter turns about x, y and z, alike in every way: the mean turns about (1, 1, 1), by an angle t at which
    # nothing is left along (1, 1, 1). One step from the first of them comes near it, but not there.
    turns = Rotation.from_rotvec(0.5 * np.pi * np.eye(3))
    (mean,) = SPHERE.means(turns.as_quat(), np.full((1, 3), 1.0 / 3.0))
    diagonal = np.full(3, 1.0 / np.sqrt(3.0))

    def left(t: float) -> float:
        return float(
            (Rotation.from_rotvec(t * diagonal).inv() * turns).as_rotvec().sum()
        )

    t = brentq(left, 0.1, 2.0, xtol=1e-14)
    np.testing.assert_allclose(
        Rotation.from_quat(mean).as_rotvec(), t * diagonal, atol=1e-9
    )


def test_a_single_model_is_a_kalman_filter_and_a_model_that_nothing_leads_to_stays_itself() -> (
    None
):
    truth, seen = path(np.random.default_rng(0))
    imm = imm_of(MODELS[:1], np.eye(1))
    belief = start(truth[0], np.eye(4), 1)
    assert imm.cycle(belief, measuring(seen[0])).probabilities == pytest.approx([1.0])
    one_way = imm_of(MODELS, np.array([[1.0, 0.0], [1.0, 0.0]]))
    after = one_way.cycle(begin(truth), measuring(seen[0]))
    np.testing.assert_allclose(after.probabilities, [1.0, 0.0])
    assert np.isfinite(after.states).all()


@each(
    ("transition", "message"),
    [
        (
            np.full((2, 2), 0.4),
            "transition must contain probabilities whose rows sum to 1",
        ),
        (np.array([[1.5, -0.5], [0.0, 1.0]]), "transition must contain probabilities"),
    ],
)
def test_a_transition_that_is_none_is_named(transition: Array, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        imm_of(MODELS, transition)
