"""Instances: a number means the same motion, speed, phase and view wherever it is used."""

import numpy as np
import pytest

from posefit.footage.instance import SPEED, VIEW_DEGREES, motion_of_instance, variation
from posefit.motion import built_in


def test_instance_0_is_the_motion_as_it_is():
    assert variation(0).views([45.0, -0.0]) == [45.0, 0.0]
    walk = motion_of_instance("walk", 0, frames=7, fps=25.0)
    assert walk.poses.tobytes() == built_in.motion("walk", frames=7, fps=25.0).poses.tobytes()
    whole = built_in.motion("run", frames=20)
    assert motion_of_instance(whole, 0, frames=5, fps=30.0).poses.tobytes() == whole.poses[:5].tobytes()


def test_instances_differ_all_over_their_ranges():
    variations = [variation(number) for number in range(1, 2000)]
    assert len(set(variations)) == len(variations)
    speed, phase, turn, start = (
        np.array([getattr(varied, name) for varied in variations])
        for name in ("speed", "phase", "turn_degrees", "start")
    )
    for values, low, high in (
        (speed, 1.0 - SPEED, 1.0 + SPEED),
        (phase, 0.0, 1.0),
        (turn, -VIEW_DEGREES, VIEW_DEGREES),
        (start, 0.0, 1.0),
    ):
        assert low <= values.min() < low + 0.01 * (high - low)
        assert high - 0.01 * (high - low) < values.max() <= high
        assert values.mean() == pytest.approx(0.5 * (low + high), abs=0.03 * (high - low))


def test_the_frames_of_an_instance_of_a_file_begin_anywhere_but_never_end_beyond_it():
    whole = built_in.motion("run", frames=12)
    begins = set()
    for number in range(200):
        part = motion_of_instance(whole, number, frames=10, fps=30.0)
        (first,) = (k for k in range(3) if part.poses.tobytes() == whole.poses[k : k + 10].tobytes())
        begins.add(first)
    assert begins == {0, 1, 2}
    varied = variation(17)
    walk = built_in.motion("walk", frames=9, speed=varied.speed, phase=varied.phase)
    assert motion_of_instance("walk", 17, frames=9, fps=30.0).poses.tobytes() == walk.poses.tobytes()
    assert len(motion_of_instance(whole, 5, frames=12, fps=30.0)) == 12
    with pytest.raises(ValueError, match="frames must be at most 12, the length of run, got 13"):
        motion_of_instance(whole, 5, frames=13, fps=30.0)
