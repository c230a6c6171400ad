"""K-means, against scikit-learn's: the same seed means the same clusters."""

import numpy as np
import pytest
from sklearn.cluster import KMeans

from posefit.arrays import Array
from posefit.motion import built_in
from posefit_priors.clusters import clustered


def agrees(points: Array, clusters: int, seed: int) -> None:
    centres, labels = clustered(points, clusters, seed)
    other = KMeans(clusters, n_init=10, random_state=seed).fit(points)
    np.testing.assert_allclose(centres, other.cluster_centers_, atol=1e-11)
    np.testing.assert_array_equal(labels, other.labels_)


def test_poses_and_noise_have_the_clusters_of_scikit_learn() -> None:
    for name in ("walk", "squat"):
        for clusters in (1, 2, 5, 12):
            for seed in range(2):
                agrees(built_in.motion(name, frames=90).poses[:, 3:], clusters, seed)
    for points, dimensions, clusters in ((300, 3, 5), (12, 1, 5), (10, 2, 10)):
        for seed in range(5):
            agrees(np.random.default_rng(seed).normal(size=(points, dimensions)), clusters, seed)


@pytest.mark.filterwarnings("ignore:Number of distinct clusters")  # of scikit-learn's
def test_fewer_different_points_than_clusters_are_centres_each() -> None:
    points = np.repeat([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]], 4, axis=0)
    agrees(points, 5, 0)
    assert {tuple(one) for one in clustered(points, 5, 0)[0].round(12) + 0.0} == {(0.0, 0.0), (1.0, 0.0), (0.0, 2.0)}
