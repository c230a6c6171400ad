"""Simulation-based calibration: a truth drawn from the prior is one more draw of the sampler.

S. Talts, M. Betancourt, D. Simpson, A. Vehtari, A. Gelman, Validating Bayesian inference algorithms with
simulation-based calibration, 2018.
"""

import numpy as np
from scipy.stats import chisquare

from posefit.arrays import Array
from posefit.fitting.optimiser import populations
from posefit.registry import registry
from posefit.testing.toy import Toy
from posefit.tracking.modes import gathered
from posefit.uncertainty.landscape import Landscape
from posefit.uncertainty.searches import weighed
from tests.cases import each

NOISE, DRAWS, TRUTHS = 0.2, 9, 400


def observed(proposals: Array) -> Array:
    """Return observations (n, d) of proposals (n, d): the first coordinate without its sign, sums of the others."""
    return np.concatenate([np.abs(proposals[:, :1]), proposals[:, 1:] @ MIXED], axis=1)


MIXED = np.array([[1.0, 0.4, 0.0], [0.0, 1.0, 0.4], [0.4, 0.0, 1.0]])


@each("evaluations", [490, 4000])
def test_a_truth_is_one_more_draw(evaluations: int) -> None:
    space, make, rng = Toy(4), registry().optimiser("sapso"), np.random.default_rng(0)
    ranks = []
    for _ in range(TRUTHS):
        truth = rng.uniform(-1.0, 1.0, (1, 4))
        observation = observed(truth) + NOISE * rng.standard_normal((1, 4))

        def cost(proposals: Array, observation: Array = observation) -> Array:
            return np.asarray(0.5 * ((observed(proposals) - observation) ** 2).sum(axis=1) / NOISE**2)

        landscape = Landscape(space, cost)
        first = gathered([(one.copy(), costs) for one, costs in populations(make(space, rng), cost, 2440)])
        other = first[0][[first[1].argmin()]] * [-1.0, 1.0, 1.0, 1.0]  # its twin, as a tracker knows those of poses
        sample = weighed(landscape, [first, (other, cost(other))], 1.0, rng, evaluations=evaluations)
        assert landscape.evaluations <= 1.1 * evaluations
        rows = rng.choice(len(sample.weights), DRAWS, p=sample.weights)
        ranks.append((sample.proposals[rows] < truth).sum(axis=0))
    for column in np.transpose(ranks):
        counts = np.bincount(column, minlength=DRAWS + 1)
        assert chisquare(counts).pvalue > 0.01, counts
