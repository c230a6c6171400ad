"""Numbers and cameras as a page's scripts read them: what goes in comes out."""

import base64

import numpy as np
import pytest

from posefit.geometry.camera import Camera
from posefit.output.page.bodies import camera_from_origin, in_16_bits
from posefit.page.document import assembled


def unpacked(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<i2")


def test_metres_are_whole_millimetres_and_what_is_not_known_has_a_number_of_its_own():
    assert unpacked(in_16_bits(np.array([0.0, 0.0014, -0.0016, 1.25]))).tolist() == [0, 1, -2, 1250]
    assert unpacked(in_16_bits(np.array([40.0, -40.0, np.inf, np.nan]))).tolist() == [32767, -32767, 32767, -32768]
    assert unpacked(in_16_bits(np.radians([[90.0, -0.1]]), np.radians(0.1))).tolist() == [900, -1]
    assert in_16_bits(np.array([])) == ""


def test_a_camera_sees_points_from_the_origin_as_it_sees_them_in_the_world():
    camera = Camera.around(np.array([1.0, 1.0, -2.0]), 0.7, 4.0, (320, 240))
    origin, point = np.array([0.8, 0.9, -1.9]), np.array([1.1, 1.4, -2.2])
    told = camera_from_origin(camera, origin)
    place = np.array(told["rotation"]) @ (point - origin) + told["translation"]
    pixel = place[:2] / place[2] * told["focal"] + told["centre"]
    np.testing.assert_allclose(pixel, camera.project(point[None])[0][0], atol=0.01)
    assert told["size"] == [320, 240]


def test_markup_without_its_three_places_is_no_page():
    with pytest.raises(ValueError, match="unpack"):
        assembled("", "<p><!--part--></p>", "", {}, "")
