"""`posefit bench`: what it tells, and what is timed."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from posefit import Silhouette, SilhouetteCost, project
from posefit.cli import main
from posefit_reproduce.bench import kernel, loop
from posefit_reproduce.bench.kernel import bench_cost, opencv_costs
from tests.cases import each


@each("stretch", [1.0, 0.6, 1.2])
def test_opencv_finds_the_same_costs_at_any_focal_length(stretch: float) -> None:
    usual = bench_cost()
    camera = replace(usual.cameras[0], focal=stretch * usual.cameras[0].focal)
    proposals = np.random.default_rng(0).uniform(
        -0.3, 0.3, (50, usual.space.dimensions)
    )
    poses, translations = usual.decode(proposals[:1])
    seen = Silhouette.of(project(usual.body, camera, poses[0], translations[0]))
    cost = SilhouetteCost(usual.body, [camera], [seen], usual.space)
    ours = cost(proposals)
    theirs = opencv_costs(cost, proposals)
    # OpenCV also sets the pixels that a border merely touches, a ring of half a pixel around limbs 10 pixels wide
    assert ours[0] == 0.0
    assert theirs[0] < 4.0
    assert np.abs(ours - theirs).mean() < 1.0


@pytest.mark.slow
def test_its_json_holds_every_figure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel, "ROUNDS", 1)
    monkeypatch.setattr(kernel, "TURN", 1e-6)
    monkeypatch.setattr(loop, "SEARCHES", 1)
    result = CliRunner().invoke(main, ["bench", "--threads", "1", "--json"])
    assert result.exit_code == 0, result.output
    figures = json.loads(result.stdout)
    optimisers = figures["ask_and_tell_us_per_proposal"]
    assert {"sapso", "pso", "random", "cma", "particle", "scipy"} <= optimisers.keys()
    assert min(optimisers.values()) > 0.0
