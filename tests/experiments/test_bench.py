"""The yardstick of `posefit bench` is the same cost, drawn by OpenCV."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.fitting.problem import PoseProblem
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit_experiments import bench


@pytest.mark.parametrize("stretch", [(1.0, 1.0), (0.6, 1.2), (1.2, 0.6)])
def test_opencv_finds_the_same_costs_whatever_the_two_focal_lengths(stretch: tuple[float, float]) -> None:
    usual = bench.problem()
    camera = replace(usual.cameras[0], focal=usual.cameras[0].focal * stretch)
    proposals = np.random.default_rng(0).uniform(-0.3, 0.3, (50, usual.space.dimensions))
    poses, translations = usual.decode(proposals[:1])
    seen = Silhouette.of(project(usual.body, camera, poses[0], translations[0]))
    problem = PoseProblem(usual.body, [camera], [seen], usual.space)
    ours, theirs = problem.evaluate(proposals), bench.opencv_costs(problem, proposals)
    # OpenCV also sets the pixels that a border merely touches, a ring of half a pixel around limbs 10 pixels wide
    assert ours[0] == 0.0
    assert theirs[0] < 4.0
    assert np.abs(ours - theirs).mean() < 1.0
