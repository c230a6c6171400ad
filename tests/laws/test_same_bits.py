"""Law 8: the same search has the same bits, however many threads draw it and in whatever order its cameras come.

Resuming is in test_resume.py, and engines, shards and interrupted sweeps are in tests/sweep: each of those
compares whole rows.
"""

import pickle

import numpy as np
import pytest

import posefit
from posefit.arrays import Array
from posefit.registry import registry
from posefit.silhouette.cost import pose_costs
from posefit.silhouette.mask import Silhouette
from posefit.tracking.result import Track
from tests.laws.test_symmetry import BODY, level, people, silhouettes

EVALUATIONS = 800  # more than one population of any optimiser, and what exemplars need
OPTIMISERS = sorted(registry().offers["optimiser"])
TRACKERS = sorted(registry().offers["tracker"])


def method_of(name: str) -> str:
    return f"{name}@pca" if name in OPTIMISERS else name


def tracked(name: str, threads: int) -> Track:
    offer = registry().offer("optimiser" if name in OPTIMISERS else "tracker", name)
    if offer.missing is not None:
        pytest.skip(f"{name} needs {offer.missing}")
    return posefit.track(
        "walk",
        method=method_of(name),
        frames=(0, 2),
        size=(80, 60),
        evaluations=EVALUATIONS,
        threads=threads,
    )


@pytest.mark.parametrize("name", [*OPTIMISERS, *TRACKERS])
def test_threads_change_no_bit_and_a_track_survives_pickling(name: str) -> None:
    alone = tracked(name, threads=1)
    shared = tracked(name, threads=3)
    copy = pickle.loads(pickle.dumps(alone))
    for other in (shared, copy):
        assert np.array_equal(alone.joints, other.joints)


def test_costs_do_not_depend_on_the_order_of_three_cameras() -> None:
    cameras = [level(azimuth, (120, 160)) for azimuth in (0.1, 2.2, 4.3)]
    poses, places = people()
    pictures = silhouettes(cameras, poses[:1], places[:1])
    seen = [Silhouette.of(picture[0]) for picture in pictures]
    # one view knows less, so that the three costs differ in every digit
    known = np.ones(seen[0].mask.shape, dtype=bool)
    known[:, :40] = False
    seen[0] = Silhouette.of(seen[0].mask, known)
    expected = pose_costs(BODY, cameras, seen, poses, places)[0]
    for order in ([1, 0, 2], [2, 1, 0], [1, 2, 0]):
        costs, _ = pose_costs(
            BODY,
            [cameras[k] for k in order],
            [seen[k] for k in order],
            poses,
            places,
        )
        assert np.array_equal(costs, expected)


# whatever proposes, a search sees costs alone
@pytest.mark.parametrize("name", ["annealed", "cma", "sapso"])
def test_the_order_of_cameras_changes_no_bit_of_a_search(name: str) -> None:
    def joints(degrees: tuple[int, ...]) -> Array:
        track = posefit.track(
            "walk",
            method=method_of(name),
            frames=(0, 2),
            size=(80, 60),
            evaluations=EVALUATIONS,
            view_degrees=degrees,
        )
        return track.joints

    assert np.array_equal(joints((0, 90, 200)), joints((200, 0, 90)))
