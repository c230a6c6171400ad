"""Real motion capture, train on one clip, test on another of the same person: the accuracy that the README quotes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit


def summaries(cmu: Path, view: float, seeds: range) -> list[dict[str, Any]]:
    return [
        posefit.track(
            cmu / "16/16_17.amc",
            train=[cmu / "16/16_15.amc"],
            view_degrees=view,
            frames=(0, 60),
            seed=seed,
            method="sapso",
        ).summary
        for seed in seeds
    ]


@pytest.mark.parametrize("view", [pytest.param(0.0, marks=pytest.mark.slow), 45.0])
def test_walking_is_followed_within_1_9_degrees(cmu: Path, view: float) -> None:
    found = summaries(cmu, view, range(5))
    errors = [summary["error_degrees"]["mean"] for summary in found]
    assert np.median(errors) <= 1.9
    assert max(errors) <= 2.5
    for summary in found:
        assert summary["prior_floor_degrees"] < summary["error_degrees"]["mean"]
        assert summary["skill"]["mean_pose"] > 0.0
        assert summary["lost_rate"] == 0.0


@pytest.mark.slow
def test_a_side_view_is_followed_or_its_loss_is_reported(cmu: Path) -> None:  # Interpretation S15
    for summary in summaries(cmu, 90.0, range(5)):
        good = summary["error_degrees"]["mean"] <= 1.9
        assert good or summary["swap_rate"] + summary["lost_rate"] > 0.0
