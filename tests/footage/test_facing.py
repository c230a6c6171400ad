"""Which way a person faces, where the segmenter reports it."""

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from posefit.footage.cameras import yaws_of
from posefit.footage.segmentation import Extraction, facings_on_the_spot
from posefit.footage.source import scene_of
from posefit.geometry.camera import Camera
from posefit.silhouette.foreground import Image

MIDDLE = np.array([0.0, 1.0, 0.0])
# one that looks along -z, which a person with yaw 0 faces, and one that looks along -x, at the person's left side
FRONT, LEFT = (Camera.around(MIDDLE, azimuth, 5.0, (160, 120)) for azimuth in (0.0, np.pi / 2))
FPS = 4.0  # two frames to either side count


def degrees(facings: list[float], camera: Camera = FRONT) -> list[float]:
    return [round(float(yaw), 6) for yaw in np.degrees(yaws_of(np.radians(facings), camera, FPS))]


def test_a_facing_is_turned_by_where_the_camera_stands() -> None:
    assert degrees([10.0] * 3) == [10.0] * 3
    assert degrees([10.0] * 3, LEFT) == [100.0] * 3


def test_a_wrong_picture_does_not_count_and_a_turn_past_180_degrees_goes_on() -> None:
    assert degrees([20.0] * 4 + [-160.0] + [20.0] * 4) == [20.0] * 9
    assert degrees([170.0, -170.0, 170.0, -170.0])[0] == pytest.approx(176.6, abs=0.1)


def test_no_report_or_contradicting_ones_give_no_yaw() -> None:
    assert degrees([]) == []
    nothing = degrees([np.nan] * 6 + [0.0])
    assert np.isnan(nothing[:4]).all()
    assert nothing[4:] == [0.0] * 3
    assert np.isnan(degrees([0.0, 180.0] * 4)).all()


def test_facings_of_a_person_who_goes_along_are_dropped() -> None:
    still, going = [50.0] * 5, [50.0 + 20.0 * k for k in range(5)]
    sides = [100.0] * 5
    np.testing.assert_array_equal(facings_on_the_spot([0.5] * 5, still, sides, FPS), [0.5] * 5)
    # two seconds to either side count, so all five frames: 80 pixels, where 35 are too far
    assert np.isnan(facings_on_the_spot([0.5] * 5, going, sides, FPS)).all()
    np.testing.assert_array_equal(facings_on_the_spot([0.5] * 5, going, [250.0] * 5, FPS), [0.5] * 5)  # 87.5 are not
    # a person who sets out with frame 21 is 40 pixels away in frame 22, which is two seconds after frame 14
    later = facings_on_the_spot([0.5] * 25, [50.0] * 20 + going, [100.0] * 25, FPS)
    assert np.flatnonzero(np.isnan(later)).tolist() == list(range(14, 25))
    np.testing.assert_array_equal(facings_on_the_spot([0.5] * 2, [np.nan] * 2, [0.0] * 2, FPS), [0.5] * 2)


class Knowing:
    """Finds the same figure in every picture, and knows how it faces but in the first one."""

    def __init__(self, _film: Any) -> None:
        self.facing = np.nan
        self._first = True

    def segment(self, image: Image) -> Any:
        self.facing = np.nan if self._first else 0.5
        self._first = False
        mask = np.zeros(image.shape[:2], dtype=bool)
        mask[20:80, 60:85] = True
        return mask, np.zeros_like(mask)


def test_a_scene_has_the_yaws_that_a_segmenter_reports(
    filmed: tuple[Path, list[Any]], segmenter: Callable[..., None]
) -> None:
    segmenter("half", Knowing)
    camera = Camera.around(MIDDLE, 0.25, 5.0, (160, 120))
    scene = scene_of([filmed[0]], camera=(camera,), frames=(0, 6), extraction=Extraction("half"))
    assert [observation.yaw for observation in scene.observations] == pytest.approx([0.75] * 6)
    assert scene.yaw == pytest.approx(0.75)
    assert scene_of([filmed[0]], camera=(camera,)).yaw is None


@pytest.mark.skipif(find_spec("mediapipe") is None, reason="without mediapipe")
def test_mediapipe_reports_the_facing_of_shoulders_and_hips() -> None:
    from posefit_mediapipe import LEFT as LEFTS
    from posefit_mediapipe import RIGHT as RIGHTS
    from posefit_mediapipe import _facing

    def landmarks(x: float, z: float) -> Any:
        left, right = SimpleNamespace(x=x, z=z), SimpleNamespace(x=-x, z=-z)
        return SimpleNamespace(landmark={**dict.fromkeys(LEFTS, left), **dict.fromkeys(RIGHTS, right)})

    # the left of a person who faces the camera is on the picture's right; of one who turns to its right, farther away
    assert _facing(landmarks(0.2, 0.0)) == 0.0
    assert _facing(landmarks(0.0, 0.2)) == pytest.approx(np.pi / 2)
    assert abs(_facing(landmarks(-0.2, 0.0))) == pytest.approx(np.pi)
    assert np.isnan(_facing(None))
