"""How joints accelerate and feet slide: motions whose figures are known."""

import numpy as np
import pytest

from posefit.geometry.skeleton import JOINTS
from posefit.motion.steadiness import acceleration, slides, standing
from tests.cases import each

LEFT, RIGHT = JOINTS.index("lfoot"), JOINTS.index("rfoot")


def still(frames: int) -> np.ndarray:
    """Return joints (T, 27, 3) of a person whose joints all stay 1 m above the ground, but for the feet, on it."""
    joints = np.ones((frames, len(JOINTS), 3))
    joints[:, [LEFT, RIGHT], 1] = 0.0
    return joints


@each(("fps", "left_out"), [(30.0, 1), (120.0, 4), (25.0, 1)])
def test_what_falls_accelerates_as_it_does_at_any_rate(fps: float, left_out: int) -> None:
    times = np.arange(40) / fps
    joints = still(40)
    joints[..., 1] -= 0.5 * 9.81 * times[:, None] ** 2
    accelerations = acceleration(joints, fps)
    np.testing.assert_allclose(accelerations[left_out:-left_out], 9.81)
    assert np.isnan(accelerations[:left_out]).all()
    assert np.isnan(accelerations[-left_out:]).all()


def test_a_foot_that_is_lifted_or_goes_fast_does_not_stand() -> None:
    joints = still(60)
    joints[20:40, LEFT, 1] = 0.2
    joints[:, RIGHT, 0] += np.arange(60) / 30.0  # a metre a second
    stands = standing(joints, 30.0)
    assert stands[:19, 0].all()
    assert not stands[20:40, 0].any()
    assert not stands[:, 1].any()


def test_a_step_is_as_long_as_a_foot_creeps_along_the_ground() -> None:
    joints = still(60)
    joints[20:40, LEFT, 1] = 0.2  # two steps of the left foot, one of the right
    joints[40:, LEFT] += np.arange(20)[:, None] * [0.003, 0.0, 0.004]  # 5 mm a frame, 15 cm a second
    stands = standing(joints, 30.0)
    lengths = slides(joints, stands)
    assert len(lengths) == 3
    assert lengths[0] == lengths[2] == 0.0
    assert lengths[1] == pytest.approx(0.005 * (stands[40:, 0].sum() - 1))


def test_the_lowest_place_of_the_feet_is_the_ground_wherever_that_is() -> None:
    rising = still(300)
    rising[..., 1] += 0.03 * np.arange(300)[:, None] / 30.0  # 30 cm in ten seconds: a track that drifts
    assert standing(rising, 30.0).all()
