"""The data of a track's page: pictures within their room, all of a long track's marks, and no links."""

import base64
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from posefit.fitting.tracker import Observation
from posefit.measuring.angles import clinical_angles
from posefit.output.page import stills
from posefit.output.page.bodies import in_16_bits
from posefit.output.page.stills import Stills, Strip
from posefit.page.document import embedded
from posefit.silhouette.mask import Silhouette
from tests.tracking.scenes import MAXWELL, SIZE, exact_frames, uncertain_frames, viewed, walk


def data_of(page: Path) -> dict[str, Any]:
    """Return the data of a page."""
    (text,) = re.findall(r'<script type="application/json" id="data">(.*?)</script>', page.read_text("utf-8"))
    return dict(json.loads(text))


def numbers(text: str) -> Any:
    return np.frombuffer(base64.b64decode(text), "<i2").astype(float)


def image(uri: str) -> Any:
    return cv2.imdecode(np.frombuffer(base64.b64decode(uri.partition(",")[2]), np.uint8), cv2.IMREAD_UNCHANGED)


def test_a_strip_keeps_what_it_has_room_for_evenly() -> None:
    for count, room, every in ((7, 70, 1), (8, 70, 2), (14, 70, 2), (15, 70, 4), (100, 10, 128), (3, 0, 4)):
        strip = Strip(room, 1)
        for k in range(count):
            strip.add((k, 0, 1, 1), lambda k=k: [f"{k:06d}", "more"])  # type: ignore[misc]
        assert strip.every == every
        assert strip.pictures == [((k, 0, 1, 1), f"{k:06d}", "more") for k in range(0, count, every)]


def test_pictures_of_a_long_track_are_of_frames_that_the_page_has(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stills, "MAX_FRAMES", 10)
    scene = replace(walk(2), count=41)
    pictures, (frame, _) = Stills(scene), exact_frames(walk(2))
    assert pictures.step == 8
    for k in range(41):
        mask = np.ones(SIZE[::-1], bool)  # so large that the picture has all of it
        mask[100, : k + 1] = False
        pictures.add(frame, Observation([Silhouette.of(mask)]), None)
    (masks,) = pictures.as_dict()["masks"]
    assert masks["every"] == 8
    assert [box for box, _ in masks["pictures"]] == [(0, 0, *SIZE)] * 6
    assert [int((image(uri) == 0).sum()) for _, uri in masks["pictures"]] == [1, 9, 17, 25, 33, 41]


def test_a_picture_is_of_the_part_that_mask_and_body_are_in() -> None:
    scene = walk(1)
    (frame,), mask = exact_frames(scene), scene.observations[0].silhouettes[0].mask
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))

    def about(shown: Any) -> Any:
        pictures = Stills(scene)
        pictures.add(frame, Observation([Silhouette.of(shown)]), None)
        ((box, uri),) = pictures.as_dict()["masks"][0]["pictures"]
        left, top, width, high = box
        np.testing.assert_array_equal(image(uri) > 0, shown[top : top + high, left : left + width])
        return box

    left, top, width, high = about(mask)
    assert (top, high) == (0, SIZE[1])  # the person fills the picture's height
    space = 0.25 * (rows[-1] + 1 - rows[0])
    assert left == pytest.approx(columns[0] - space, abs=3.0)
    assert left + width == pytest.approx(columns[-1] + 1 + space, abs=3.0)
    far = np.zeros_like(mask)
    far[:20, :20] = True  # something else is in the mask, and the body stays in the picture
    assert about(far)[:2] == (0, 0)
    assert sum(about(far)[::2]) == pytest.approx(left + width, abs=40.0)
    assert about(np.zeros_like(mask))[1] == 0


def test_pictures_of_leaves_stay_within_a_few_megabytes() -> None:
    seed = np.random.default_rng(0).integers(0, 255, (67, 120, 3)).astype(np.uint8)  # as hard to compress as leaves
    picture = cv2.resize(seed, (960, 540), interpolation=cv2.INTER_CUBIC)
    scene = replace(walk(2), count=20, pictures=lambda: iter([picture] * 20))
    pictures, (frame, _), seen = Stills(scene), exact_frames(walk(2)), scene.observations[0]
    for _ in range(20):
        pictures.add(frame, seen, picture)
    strip = pictures.as_dict()["film"]
    assert strip["every"] == 1
    assert sum(len(near) + len(coarse) for _, near, coarse in strip["pictures"]) <= stills.MAX_FILM
    box, near, coarse = strip["pictures"][0]
    assert image(near).shape[1] / image(near).shape[0] == pytest.approx(box[2] / box[3], abs=0.02)
    assert image(coarse).shape[0] in {height for _, (height, _) in stills.FINENESS}


def test_metres_are_whole_millimetres_and_what_is_not_known_has_a_number_of_its_own() -> None:
    assert numbers(in_16_bits(np.array([0.0, 0.0014, -0.0016, 1.25]))).tolist() == [0, 1, -2, 1250]
    assert numbers(in_16_bits(np.array([40.0, -40.0, np.inf, np.nan]))).tolist() == [32767, -32767, 32767, -32768]


def test_joints_angles_and_intervals_are_those_of_the_track(tmp_path: Path) -> None:
    scene = walk(4)
    truth = scene.truth
    data = data_of(viewed(tmp_path / "out", scene, uncertain_frames(scene, [0.0, 0.3, 0.0, 0.0])))
    joints = numbers(data["estimate"]).reshape(4, 27, 3)
    true = 1e3 * truth.joints
    np.testing.assert_allclose(joints - joints[0, 0], true - true[0, 0], atol=1.01)
    assert data["truth"] == data["estimate"]
    free = truth.skeleton.free
    angles = numbers(data["angles"]["values"]).reshape(4, -1) / 10.0
    np.testing.assert_allclose(angles, np.degrees(np.unwrap(truth.poses, axis=0)[:, free]), atol=0.051)
    assert data["angles"]["names"][:4] == ["root yaw", "root pitch", "root roll", "lfemur x (bone to the left knee)"]
    clinical = numbers(data["clinical"]["values"]).reshape(4, -1) / 10.0
    knee = data["clinical"]["names"].index("left knee flexion")
    expected = clinical_angles(truth.skeleton, truth.poses)["left_knee_flexion"]
    np.testing.assert_allclose(clinical[:, knee], expected, atol=0.051)
    assert data["clinical"]["truth"] == data["clinical"]["values"]
    assert data["places"][3] == "left ankle"
    # nothing but the pose itself, blurred by 2 cm
    radii = numbers(data["intervals"]["joints"]).reshape(4, 3, 27)
    np.testing.assert_allclose(radii[0, :, 1], 20.0 * np.array([*MAXWELL.values()]), atol=1.0)
    assert data["intervals"]["levels"] == [50, 80, 95]
    assert data["others"]["at"] == [1]
    assert data["others"]["weights"] == pytest.approx([0.3])
    assert data["marks"] == {"held": [], "lost": [], "unknown": [1]}
    assert data["verdict"] == "Not determined: left and right: unknown in 1 of 4 frames."


def test_it_is_one_file_that_links_to_nothing_but_itself(tmp_path: Path) -> None:
    scene = walk(3)
    name = "</script><script>alert(1)</script>"
    page = viewed(tmp_path / "out", replace(scene, name=name), exact_frames(scene))
    text = page.read_text("utf-8")
    assert re.findall(r"""<[^>]*\s(?:src|href|action|srcset|data)=["']?([^"'\s>]*)""", text) == ["#player"]
    assert "url(" not in text
    assert "@import" not in text
    assert text.count("</script>") == 2
    assert data_of(page)["title"] == name
    assert data_of(page)["film"] is data_of(page)["intervals"] is None
    assert embedded(data_of(page)["others"]) == '{"at":[],"weights":[],"joints":""}'
