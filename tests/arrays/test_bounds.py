"""Compiled functions stay within their arrays: run without the compiler, they raise IndexError if they do not.

Compiled code does not check indices, so a loop that goes one step too far reads or writes memory of somebody else, and
the numbers are usually right all the same.
"""

import os
import subprocess
import sys
from pathlib import Path

from tests.cases import each

COSTS = """
import numpy as np
from posefit.fitting.tracker import Observation
from posefit.footage.scene import synthetic
from posefit.motion import built_in
from posefit.silhouette.cost import pose_costs

motion = built_in.motion("walk", frames=60).frames(5, 7)
scene = synthetic(motion, (60.0, 150.0), (37, 41), (), (None, None))
# one pose, and more poses than the rasteriser has lanes
for count in (1, 9):
    poses = np.repeat(motion.poses[:1], count, axis=0)
    places = np.repeat(motion.translations[:1], count, axis=0)
    seen = scene.observations[0].silhouettes
    costs, _ = pose_costs(scene.body, scene.cameras, seen, poses, places)
    assert np.isfinite(costs).all()
"""

CONTOURS = """
import numpy as np
from posefit.fitting.contours import MaskContours, contour_squares, fitted, precisions
from posefit.footage.scene import synthetic
from posefit.motion import built_in
from tests.tracking.test_contours import growth

motion = built_in.motion("walk", frames=60).frames(5, 6)
scene = synthetic(motion, (60.0, 150.0), (37, 41), (), (None, None))
body = scene.body
poses = motion.poses + 0.05 * body.skeleton.free
places = motion.translations
views = [
    MaskContours.of(camera, k, scene.observations, places)
    for k, camera in enumerate(scene.cameras)
]
changes = growth(body, body.stature, motion)
sums = contour_squares(body, views, poses, places, 0.09, [changes] * 2)
assert all(np.isfinite(one).all() for one in sums)
start = poses, places
moved = fitted(body, views, start, poses, precisions(0.1, 0.01), (0.09,), 1)
assert np.isfinite(moved[0]).all()
"""


BODIES = """
import numpy as np
from posefit.fitting.bodies import HeldFrames, scaled_bodies
from posefit.fitting.shape import NAMES, _scales
from posefit.fitting.tracker import Frame
from posefit.footage.scene import synthetic
from posefit.motion import built_in

motion = built_in.motion("walk", frames=60).frames(5, 6)
scene = synthetic(motion, (60.0, 150.0), (37, 41), (), (None, None))
nothing = np.zeros((2, 3))
frame = Frame(motion.poses[0], motion.translations[0], 0.0, nothing, 1)
held = HeldFrames.of(scene.body, scene.cameras, scene.observations, [frame])
factors = np.ones((2, len(NAMES)))
for aligned in (False, True):
    bodies = scaled_bodies(scene.body, *_scales(factors), 1.7)
    assert np.isfinite(held.costs(*bodies, aligned, 0.5)).all()
"""

ENVIRONMENTS = """
import gymnasium

env = gymnasium.make_vec("posefit_envs:posefit/FitImage-v1", 2, size=(36, 36))
env.reset(seed=0)
env.step(env.action_space.sample())
"""

BEAM = """
import pytest

raise SystemExit(pytest.main(["-q", "-n", "0", "-W", "ignore", "tests/exemplars/test_beam.py"]))
"""


@each("script", [COSTS, CONTOURS, BODIES, ENVIRONMENTS, BEAM])
def test_kernels_stay_within_their_arrays(script: str) -> None:
    environment = os.environ | {
        "NUMBA_DISABLE_JIT": "1",
        # NumPy warns of square roots that compiled code discards
        "PYTHONWARNINGS": "ignore",
    }
    ran = subprocess.run(
        [sys.executable, "-c", script],
        cwd=Path(__file__).parents[2],
        env=environment,
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
