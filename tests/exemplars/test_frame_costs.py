"""What a frame says of itself, of several cameras."""

from dataclasses import replace

import numpy as np

from posefit.motion import built_in
from posefit.silhouette.mask import Silhouette
from posefit_exemplars.frame_costs import FrameCosts
from tests.exemplars.conftest import walk_of


def test_a_camera_that_sees_alone_cannot_tell_the_depth_however_many_there_are() -> None:
    walk = walk_of(built_in.motion("walk", frames=3), (0.0, 90.0))
    first, second = walk.task.cameras
    one = walk.seen[0]
    nothing = Silhouette.of(np.zeros((120, 160), dtype=bool), np.zeros((120, 160), dtype=bool))
    assert FrameCosts(walk.task, one).eye is None
    alone = FrameCosts(walk.task, replace(one, silhouettes=[nothing, one.silhouettes[1]])).eye
    assert alone is not None
    np.testing.assert_array_equal(alone, second.position)
    only = FrameCosts(walk.told(cameras=[first]), replace(one, silhouettes=one.silhouettes[:1])).eye
    assert only is not None
    np.testing.assert_array_equal(only, first.position)
    assert FrameCosts(walk.task, replace(one, silhouettes=[nothing, nothing])).eye is None
