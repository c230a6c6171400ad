"""Is a frame lost? How likely that is where a search found a pose, by the pose's cost alone.

A logistic model of the logarithm of the cost. The spread of what a search leaves open, the weight of its second mode
and the cost of the frames before told no more of people whom the model had not seen. `docs/studies/posterior.py`
fits it.
"""

import numpy as np

from posefit.arrays import Array

EVEN = 5.2  # of the cost, from 0 to 100: here a frame is as likely lost as not
STEEPNESS = 2.5  # by how much the log-odds rise with the logarithm of the cost
LEAST_COST = 0.1  # below it the cost of a pose says nothing


def lost_at(costs: Array) -> Array:
    """Return how likely frames are lost whose poses cost so much: 0 to 1, of the same shape."""
    return np.asarray(1.0 / (1.0 + (EVEN / np.maximum(costs, LEAST_COST)) ** STEEPNESS))
