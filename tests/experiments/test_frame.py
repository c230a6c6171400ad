"""Where the time of a frame goes: its parts do again what the track did, and add up."""

import numpy as np
import pytest

from posefit_experiments.bench import frame
from posefit_experiments.bench.kernel import bench_problem


@pytest.mark.parametrize("name", frame.METHODS)
def test_the_parts_of_a_frame_do_again_what_the_track_did(name: str) -> None:
    walk = frame.Walk(bench_problem(), *frame.METHODS[name])
    assert [sum(len(costs) for _, costs in search.told) for search in walk.searches] == [2440] * frame.FRAMES
    for found, search in zip(walk.frames, walk.searches, strict=True):
        assert found.cost == min(costs.min() for _, costs in search.told)
    np.testing.assert_array_equal(walk.swarm(), walk.searches[-1].told[-1][0])


def test_a_profile_of_a_frame_adds_up() -> None:
    # 4 frames in 40 ms, of which 20 are drawn, 4 decoded and 8 the optimiser's: 8 are left
    profile = frame.profile(0.040, {"kernel": 0.020, "prior": 0.004, "swarm": 0.008})
    assert profile == pytest.approx({
        "ms": 10.0, "kernel_ms": 5.0, "prior_ms": 1.0, "swarm_ms": 2.0, "driver_ms": 2.0,
        "kernel_share": 0.5, "prior_share": 0.1, "swarm_share": 0.2, "driver_share": 0.2, "overhead": 40 / 24,
    })  # fmt: skip
