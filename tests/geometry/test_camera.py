"""Cameras by numbers worked by hand, and by law."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.geometry.camera import MARGIN, Camera
from posefit.geometry.skeleton import JOINTS
from posefit.motion.built_in import average_skeleton
from tests.cases import each


def test_from_the_front_the_left_hand_is_on_the_images_right() -> None:
    skeleton = average_skeleton()
    pixels, _ = Camera.around(np.zeros(3), 0.0, 4.0, (320, 240)).project(
        skeleton.joints(np.zeros(66))
    )
    assert pixels[JOINTS.index("lhand"), 0] > 160.0 > pixels[JOINTS.index("rhand"), 0]


def test_around_by_hand_from_the_side() -> None:
    # It stands at (4 + 1, 2, 3) and looks along -x; its right is -z, so who walks along +z walks to the left.
    camera = Camera.around(
        np.array([1.0, 2.0, 3.0]), np.pi / 2, 4.0, (320, 240), field_of_view=np.pi / 2
    )
    np.testing.assert_allclose(camera.position, [5.0, 2.0, 3.0], atol=1e-12)
    # 90 degrees across 320 pixels: focal 160. One metre is 40 pixels at 4 m and 80 pixels at 2 m.
    points = np.array(
        [[1.0, 2.0, 3.0], [1.0, 2.0, 4.0], [1.0, 3.0, 3.0], [3.0, 2.0, 2.0]]
    )
    pixels, depths = camera.project(points)
    np.testing.assert_allclose(
        pixels, [[160, 120], [120, 120], [160, 80], [240, 120]], atol=1e-9
    )
    np.testing.assert_allclose(depths, [4.0, 4.0, 4.0, 2.0])


@each("size", [(200, 150), (150, 200), (64, 64)])
def test_framing_is_the_nearest_camera_that_does(size: tuple[int, int]) -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(40, 3))
    radii = rng.uniform(0.0, 0.2, 40)
    camera = Camera.framing(points, radii, 0.3, size)
    pixels, depths = camera.project(points)
    reach = np.abs(pixels - camera.centre) + (camera.focal[0] * radii / depths)[:, None]
    assert (reach / (0.5 * np.array(size))).max() == pytest.approx(1.0 - MARGIN)
    np.testing.assert_allclose(
        camera.rotation, Camera.around(np.zeros(3), 0.3, 1.0, size).rotation
    )


@each(
    ("change", "message"),
    [
        ({"width": 0}, "width must be a whole number from 1 to 16384, got 0"),
        ({"focal": [50.0, -1.0]}, r"focal must be positive, got \[50.0, -1.0\]"),
        (
            {"translation": [0.0, np.nan, 0.0]},
            "translation must be finite, got 1 that are not",
        ),
        (
            {"rotation": 2.0 * np.eye(3)},
            "rotation must be orthonormal and right-handed, got",
        ),
        (
            {"rotation": np.diag([1.0, 1.0, -1.0])},
            "rotation must be orthonormal and right-handed, got",
        ),
    ],
)
def test_a_camera_that_cannot_be_is_refused(
    change: dict[str, Any], message: str
) -> None:
    values = {"width": 100, "height": 80, "focal": [50.0, 60.0], "centre": [50.0, 40.0]}
    with pytest.raises(ValueError, match=message):
        Camera(
            **{**values, "rotation": np.eye(3), "translation": np.zeros(3), **change}
        )


@each(
    ("key", "text"),
    [
        ("width", "0"),
        ("focal", '"far"'),
        ("focal", "[" * 100_000),
        ("focal", f"[{10**400}, 1]"),
        ("centre", "[NaN, 1.0]"),
        ("camera_from_world", "[[1], [1, 2]]"),
        ("more", "1"),
        ("more", " " * 1_000_001 + "1"),
    ],
)
def test_a_wrong_camera_file_is_refused_in_one_line(
    tmp_path: Path, key: str, text: str
) -> None:
    path = tmp_path / "camera.json"
    values = json.loads(Camera.around(np.zeros(3), 0.4, 5.0, (32, 24)).to_json())
    path.write_text(json.dumps({**values, key: "here"}).replace('"here"', text))
    with pytest.raises(ValueError) as caught:
        Camera.from_json(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_a_pinhole_camera_by_hand() -> None:
    # one metre to the right, half a metre up, two metres ahead
    point = np.array([[1.0, 0.5, -2.0]])
    pixels, far = Camera.pinhole(640, 480, fx=100.0).project(point)
    np.testing.assert_allclose(pixels, [[320.0 + 50.0, 240.0 - 25.0]])
    assert far.tolist() == [2.0]
    given = Camera.pinhole(640, 480, fx=100.0, fy=200.0, cx=300.0, cy=200.0)
    np.testing.assert_allclose(given.project(point)[0], [[350.0, 150.0]])


def test_a_focal_length_in_millimetres_is_refused() -> None:
    with pytest.raises(
        ValueError,
        match="fx must be in pixels: at least 64 for a width of 640, got 4.2",
    ):
        Camera.pinhole(640, 480, fx=4.2)


def test_a_camera_comes_back_from_its_text() -> None:
    text = Camera.around(np.zeros(3), 0.4, 5.0, (32, 24)).to_json()
    assert Camera.from_json(text).to_json() == text
    with pytest.raises(ValueError, match="camera: expected a JSON object with width"):
        Camera.from_json('{"width": 3}')
