#!/bin/sh
# kalbee 1.0.0: InteractingMultipleModel gives other probabilities with four of its filters, for the same models.
#
# Between steps it sets the `state` and `covariance` of each filter, and takes the likelihood from `last_y` and
# `last_S`. InformationFilter and EnsembleKalmanFilter have a state of their own, which stays as it was, and no
# `last_y`: the likelihood of the first comes from the residual after the update, and that of the second is 1, so that
# no measurement ever counts. CholeskyKalmanFilter and SquareRootUKF keep their own factors of the covariance. Of two
# models of constant velocity, the one with much noise has 6 % at the end of a straight stretch with KalmanFilter, 4 %
# with CholeskyKalmanFilter, 96 % with InformationFilter, and 50 % with the ensemble. Alone, these filters agree. Use
# KalmanFilter, SquareRootKalmanFilter or UnscentedKalmanFilter.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet kalbee==1.0.0 numpy==2.4.6 scipy==1.17.1
cd "$folder"
venv/bin/python -W ignore - <<'PYTHON'
from importlib.metadata import version

import kalbee
import numpy as np

print("kalbee", version("kalbee"))
STEP = np.array([[1.0, 1.0], [0.0, 1.0]])
SEEN = np.array([[1.0, 0.0]])
NOISE = np.array([[1.0]])
wobble = [0.6, -0.9, 0.3, 1.1, -0.4, -0.7, 0.8, -0.2]
places = np.cumsum([1.0] * 20 + [-3.0] * 20)
measured = [place + wobble[k % 8] for k, place in enumerate(places)]


def linear(name, size):
    return getattr(kalbee, name)(
        state=np.zeros((2, 1)),
        covariance=10.0 * np.eye(2),
        transition_matrix=STEP,
        transition_covariance=size * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]),
        measurement_matrix=SEEN,
        measurement_covariance=NOISE,
    )


def by_functions(name, size):
    more = {"ensemble_size": 500, "rng": 1} if name == "EnsembleKalmanFilter" else {}
    return getattr(kalbee, name)(
        state=np.zeros((2, 1)),
        covariance=10.0 * np.eye(2),
        transition_covariance=size * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]),
        measurement_covariance=NOISE,
        transition_function=lambda x, dt: STEP @ x,
        measurement_function=lambda x: SEEN @ x,
        **more,
    )


def alone(make, name):
    one = make(name, 0.5)
    for number in measured:
        one.predict()
        one.update(np.array([[number]]))
    return float(one.state[0, 0])


def probability(make, name):
    """Return the probability of the model with much noise after the last measurement."""
    both = kalbee.InteractingMultipleModel(
        [make(name, 0.001), make(name, 4.0)],
        np.array([[0.95, 0.05], [0.05, 0.95]]),
        np.array([0.5, 0.5]),
    )
    for number in measured:
        both.predict()
        both.update(np.array([[number]]))
    return float(both.model_probabilities[1])


expected = {
    "KalmanFilter": (linear, 0.064),
    "SquareRootKalmanFilter": (linear, 0.064),
    "UnscentedKalmanFilter": (by_functions, 0.064),
    "CholeskyKalmanFilter": (linear, 0.041),
    "SquareRootUKF": (by_functions, 0.041),
    "InformationFilter": (linear, 0.960),
    "EnsembleKalmanFilter": (by_functions, 0.5),
}
unchanged = True
for name, (make, wanted) in expected.items():
    seen, single = probability(make, name), alone(make, name)
    print(f"{name}: {seen:.3f}; alone, the last place {single:.2f}")
    unchanged = unchanged and np.isclose(seen, wanted, atol=0.002)
    unchanged = unchanged and abs(single - alone(linear, "KalmanFilter")) < 0.3
raise SystemExit(not unchanged)
PYTHON
