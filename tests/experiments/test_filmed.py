"""The track of a real walk, whose truth nobody knows."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.silhouette.mask import Mask
from posefit_experiments.filmed import experiment
from posefit_experiments.filmed.experiment import filmed_figures
from posefit_experiments.filmed.gait import frequency
from posefit_experiments.filmed.reference import reference, references


@pytest.mark.slow
def test_a_real_walk_is_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    video = Path(__file__).parents[3] / "shared" / "data" / "video" / "sports2d_walk" / "demo.mp4"
    if not video.is_file():
        pytest.skip(f"no video at {video}")
    made: list[Mask] = []

    def made_once(*asked: Any) -> list[Mask]:
        made.extend(references(*asked) if not made else [])
        return made

    monkeypatch.setattr(experiment, "references", made_once)  # they are those of the video, whatever the seed
    tracks = [filmed_figures(video, (0, 420, 1520, 532), (55, 166), seed) for seed in range(5)]
    # over seeds: one alone may begin with a pose that costs 2 % of the overlap
    assert np.median([found["iou_masks"] for found in tracks]) >= 0.80
    for found in tracks:
        assert found["usable"] >= 105
        assert found["lowest_iou_masks"] > 0.6  # nowhere lost
        assert found["travel_seen"] == found["travel_fitted"] == "left"
        assert found["facing_its_way"] > 0.8
        assert found["steps_a_second_fitted"] == pytest.approx(found["steps_a_second_seen"], rel=0.1)


def test_the_frequency_of_a_wave_is_found() -> None:
    seconds = np.arange(90) / 30.0
    assert frequency(3.0 + seconds + np.sin(2.0 * np.pi * 1.8 * seconds), 30.0) == pytest.approx(1.8, abs=0.03)


def test_a_reference_is_the_largest_piece_with_its_holes_filled() -> None:
    background = np.full((120, 160, 3), 100, dtype=np.uint8)
    image = background.copy()
    image[30:90, 50:80] = 180
    image[50:70, 60:70] = 100  # a hole
    image[10:20, 100:140] = 180  # a smaller piece, far away
    image[100:110, 10:20] = 255  # outside the region
    mask = reference(image, background, (30, 0, 130, 120))
    expected = np.zeros((120, 160), dtype=bool)
    expected[30:90, 50:80] = True
    np.testing.assert_array_equal(mask, expected)
