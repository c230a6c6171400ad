"""Cameras by numbers worked by hand, and by law."""

import json
from pathlib import Path

import numpy as np
import pytest

from posefit.geometry.body import PROPORTIONS, Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import BONES, JOINTS
from posefit.motion.library import average_skeleton


def test_a_point_is_projected_by_hand() -> None:
    camera = Camera(100, 80, [50.0, 60.0], [50.0, 40.0], np.eye(3), np.zeros(3))
    pixels, depths = camera.project(np.array([1.0, -0.5, 2.0]))
    assert pixels.tolist() == [50.0 * 1.0 / 2.0 + 50.0, 60.0 * -0.5 / 2.0 + 40.0]
    assert depths == 2.0


def test_the_target_is_in_the_middle_and_up_is_up() -> None:
    target = np.array([0.3, 1.0, -2.0])
    camera = Camera.around(target, 0.6, 4.0, (320, 240))
    pixels, depths = camera.project(np.array([target, target + [0.0, 0.5, 0.0]]))
    np.testing.assert_allclose(pixels[0], [160.0, 120.0])
    assert depths[0] == pytest.approx(4.0)
    assert pixels[1, 1] < 120.0
    assert pixels[1, 0] == pytest.approx(160.0)


def test_azimuth_0_stands_at_plus_z_and_90_degrees_at_plus_x() -> None:
    np.testing.assert_allclose(Camera.around(np.zeros(3), 0.0, 4.0, (8, 8)).position, [0.0, 0.0, 4.0], atol=1e-12)
    np.testing.assert_allclose(Camera.around(np.zeros(3), np.pi / 2, 4.0, (8, 8)).position, [4.0, 0.0, 0.0], atol=1e-12)


def test_from_the_front_the_left_hand_is_on_the_images_right() -> None:
    skeleton = average_skeleton()
    pixels, _ = Camera.around(np.zeros(3), 0.0, 4.0, (320, 240)).project(skeleton.joints(np.zeros(66)))
    assert pixels[JOINTS.index("lhand"), 0] > 160.0 > pixels[JOINTS.index("rhand"), 0]


@pytest.mark.parametrize("azimuth", [0.0, 0.8, 2.5, -1.6])
def test_framing_shows_every_ball_with_a_margin(azimuth: float) -> None:
    rng = np.random.default_rng(0)
    points, radii = rng.normal(size=(60, 3)), rng.uniform(0.0, 0.3, 60)
    camera = Camera.framing(points, radii, azimuth, (200, 150))
    pixels, depths = camera.project(points)
    reach = camera.focal[0] * radii / depths
    assert depths.min() > 0.0
    assert (pixels - reach[:, None]).min() > 0.0
    assert (pixels + reach[:, None] - [200, 150]).max() < 0.0


def test_a_camera_survives_its_file(tmp_path: Path) -> None:
    camera = Camera.around(np.array([1.0, 2.0, 3.0]), 0.4, 5.0, (321, 123))
    (tmp_path / "camera.json").write_text(camera.to_json())
    again = Camera.from_json(tmp_path / "camera.json")
    assert (again.width, again.height) == (321, 123)
    for name in ("focal", "centre", "rotation", "translation"):
        np.testing.assert_array_equal(getattr(again, name), getattr(camera, name))


@pytest.mark.parametrize(
    "change",
    [
        {"width": 0},
        {"width": 2.5},
        {"focal": [0.0, 1.0]},
        {"focal": "far"},
        {"centre": [float("nan"), 1.0]},
        {"camera_from_world": np.zeros((4, 4)).tolist()},
        {"camera_from_world": [[1, 2], [3, 4]]},
        {"camera_from_world": None},
        {"more": 1},
    ],
)
def test_a_bad_camera_file_is_named_in_one_line(tmp_path: Path, change: dict[str, object]) -> None:
    path = tmp_path / "camera.json"
    values = json.loads(Camera.around(np.zeros(3), 0.4, 5.0, (32, 24)).to_json())
    path.write_text(json.dumps({**values, **change}))
    with pytest.raises(ValueError, match="must|expected") as caught:
        Camera.from_json(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "[]", "{", "{}", "\x00"])
def test_a_file_that_is_no_camera_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "camera.json").write_text(text)
    with pytest.raises(ValueError, match="expected a JSON object"):
        Camera.from_json(tmp_path / "camera.json")


def test_radii_are_in_proportion_to_the_bones() -> None:
    skeleton = average_skeleton()
    body = Body.of(skeleton, girth=1.5)
    bone = BONES.index("lfemur")
    np.testing.assert_allclose(body.radii[bone], 1.5 * skeleton.lengths[bone] * np.array(PROPORTIONS["femur"]))
    np.testing.assert_allclose(
        body.joint_radii()[JOINTS.index("lfemur")], max(body.radii[bone, 1], body.radii[bone + 1, 0])
    )
