"""Without a GPU: what is said where there is none, and what a device would get."""

import numpy as np
import pytest

from posefit.footage.scene import on_device, synthetic
from posefit.motion import built_in
from posefit.silhouette.cuda.device import check_device, moved_to
from posefit.silhouette.mask import Silhouette
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import track_scene

NEEDED = "device cuda needs an NVIDIA GPU and posefit[gpu], got no library numba-cuda"


def test_one_line_says_what_a_gpu_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("posefit.silhouette.cuda.device.find_spec", lambda name: None)
    silhouette = Silhouette.of(np.ones((4, 4)))
    scene = synthetic(
        built_in.motion("walk", frames=1), (45.0,), (64, 48), [], (None, None)
    )
    for ask in (
        lambda: check_device("cuda"),
        lambda: moved_to(silhouette, "cuda"),
        lambda: on_device(scene, "cuda"),
        lambda: track_scene(scene, [], TrackOptions(device="cuda")),
    ):
        with pytest.raises(ValueError) as error:
            ask()
        assert str(error.value) == NEEDED
    check_device("cpu")
    assert moved_to(silhouette, "cpu") is silhouette


def test_a_scene_on_a_device_has_its_silhouettes_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("posefit.silhouette.cuda.device._missing", lambda: None)
    scene = synthetic(
        built_in.motion("walk", frames=2), (45.0, 90.0), (64, 48), [], (None, None)
    )
    there = on_device(scene, "cuda")
    assert len(there.observations) == 2
    assert [
        [one.device for one in seen.silhouettes] for seen in there.observations
    ] == [["cuda", "cuda"]] * 2
    np.testing.assert_array_equal(
        there.observations[1].translation, scene.observations[1].translation
    )
    assert on_device(scene, "cpu") is scene
