"""Calibration files: what each format says, which way is up, and lenses that bend."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from posefit.geometry.calibration import (
    Calibration,
    guessed_up,
    read_calibrations,
    upright,
)
from posefit.geometry.camera import Camera
from tests.cases import each
from tests.geometry.calibrations import (
    KINDS,
    LENS,
    POSE,
    QUALISYS,
    TOML,
    YAML_24,
    K,
    kind_written,
    matrices,
    opencv,
)
from tests.geometry.turns import about


def written(tmp_path: Path, name: str) -> Path:
    path = tmp_path / name
    if path.suffix not in (".toml", ".xml"):
        return opencv(path)
    path.write_text(TOML if path.suffix == ".toml" else QUALISYS)
    return path


@each("name", ["a.toml", "a.yml", "a.json", "a.xml"])
def test_every_format_gives_the_same_camera(tmp_path: Path, name: str) -> None:
    (one,) = read_calibrations(written(tmp_path, name))
    assert (one.size, one.distorted) == ((640, 480), True)
    camera = one.camera((320, 240), upright([one]))
    np.testing.assert_allclose(camera.focal, [250.0, 255.0])
    # OpenCV's 319.5 is the middle of 640 pixels
    np.testing.assert_allclose(camera.centre, [160.0, 120.0])
    # z was up: the camera stands 4 m before the origin, 1 m up, and sees up as up
    np.testing.assert_allclose(camera.position, [0.0, 1.0, 4.0], atol=1e-9)
    pixels, depths = camera.project(
        np.array([[0.0, 1.0, 0.0], [0.0, 2.0, 0.0], [1.0, 1.0, 0.0]])
    )
    np.testing.assert_allclose(depths, 4.0)
    np.testing.assert_allclose(
        pixels, [[160.0, 120.0], [160.0, 120.0 - 255.0 / 4.0], [160.0 + 62.5, 120.0]]
    )


def test_our_own_cameras_come_back_however_they_are_held(tmp_path: Path) -> None:
    # looks straight down: its up is -z
    down = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    for camera in (
        Camera.around(np.array([0.1, 0.9, 0.3]), 0.7, 3.0, (320, 240)),
        Camera(
            320,
            240,
            np.full(2, 300.0),
            np.array([160.0, 120.0]),
            down,
            np.array([0.0, 0.0, 4.0]),
        ),
    ):
        (tmp_path / "camera.json").write_text(camera.to_json())
        (one,) = read_calibrations(tmp_path / "camera.json")
        again = one.camera((320, 240), upright([one]))
        for name in ("focal", "centre", "rotation", "translation"):
            np.testing.assert_allclose(
                getattr(again, name), getattr(camera, name), atol=1e-12
            )


def test_a_camera_that_is_not_placed_looks_level_from_the_origin(
    tmp_path: Path,
) -> None:
    (one,) = read_calibrations(opencv(tmp_path / "a.yml", placed=False))
    camera = one.camera((640, 480), upright([one]))
    np.testing.assert_allclose(camera.position, 0.0, atol=1e-12)
    np.testing.assert_allclose(
        camera.project(np.array([[0.0, 0.0, -2.0]]))[0], [[320.0, 240.0]]
    )


def test_qualisys_third_radial_number_is_opencvs_fifth(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(
        QUALISYS.replace('radialDistortion3="0"', 'radialDistortion3="0.3"')
    )
    (one,) = read_calibrations(tmp_path / "a.xml")
    across, down = one.maps((640, 480))
    # Brown's model, as OpenCV's manual writes it: x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2), and
    # y (...) + p1 (r^2 + 2 y^2) + 2 p2 x y
    u = 600
    v = 40
    x = (u - 319.5) / 500.0
    y = (v - 239.5) / 510.0
    r2 = x * x + y * y
    bent = 1.0 - 0.05 * r2 + 0.1 * r2**2 + 0.3 * r2**3
    p1 = 0.001
    p2 = 0.002
    assert across[v, u] == pytest.approx(
        319.5 + 500.0 * (x * bent + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)), abs=1e-3
    )
    assert down[v, u] == pytest.approx(
        239.5 + 510.0 * (y * bent + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y), abs=1e-3
    )


@each(
    ("name", "text", "message"),
    [
        (
            "a.toml",
            "[metadata]\nadjusted = false\n",
            "expected a calibration with a camera, got none",
        ),
        (
            "a.toml",
            TOML.replace("[ 640, 480]", "[ 640.5, 480]"),
            "an image size of 640.5 x 480",
        ),
        ("a.toml", TOML.replace("500.0", "nan"), "finite numbers"),
        (
            "a.toml",
            TOML.replace("[ 0.1, 0.0, 0.0, 0.0]", "[ 0.1, 0.0, 0.0]"),
            "a distortion of 3 numbers",
        ),
        (
            "a.json",
            json.dumps({"K": K, "R": np.eye(3).tolist(), "C": [0.0, 1.0, 2.0]}),
            "the key 'C' of 'a', which is not known",
        ),
        (
            "a.json",
            json.dumps({"K": K, "R": np.eye(3).tolist()}),
            "a rotation without a translation, such as rvec and tvec",
        ),
        ("a.json", json.dumps({"Camera.fx": 500.0}), "got none among 'Camera.fx'"),
        ("a.json", "// a note\n{}", "broken JSON: "),
        ("a.conf", "[LEFT_CAM_HD]\nfx=500\n", "another file, .conf; YAML, XML, JSON"),
        ("cameras.txt", "1 2 640 480 500", "another file, .txt; YAML, XML"),
        ("cameras.txt", "1 PINHOLE 640 480 500 500 320 240", "COLMAP's text, which"),
        ("a.yml", "# Image list with two lines of data per image:", "COLMAP's text"),
        ("a.json", json.dumps({"K": K, "time_offset": 0.1}), "the key 'time_offset'"),
        ("a.xml", "<calibration>", "broken XML"),
        ("a.xml", "<!DOCTYPE a [<!ENTITY b 'c'>]><calibration/>", "document type"),
        ("a.xml", QUALISYS.replace("intrinsic", "lens"), "a camera without intrinsic"),
        (
            "a.xml",
            QUALISYS.replace("tangentalD", "tangentialD"),
            "the lens key 'tangentialDistortion1'",
        ),
        (
            "a.xml",
            QUALISYS.replace('r11="1"', 'r11="3"'),
            "a matrix that is not a rotation",
        ),
        (
            "a.yml",
            "%YAML:1.0\n---\nimage_width: 3\n",
            "the keys 'image_width' of 'a', but no camera matrix, and no fx, fy, cx and cy",
        ),
    ],
)
def test_a_file_that_is_no_calibration_is_named(
    tmp_path: Path, name: str, text: str, message: str
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        read_calibrations(tmp_path / name)
    assert str(tmp_path / name) in str(caught.value)
    assert "\n" not in str(caught.value).strip()


OPENCV = """%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 319.5, 0., 510., 239.5, 0., 0., 1. ]
"""
HIDDEN = "".join(f"a{k}: &a{k} {{<<: [*a{k - 1}, *a{k - 1}]}}\n" for k in range(1, 60))


@each(
    ("before", "after", "message"),
    [
        # sizes and types that contradict the numbers
        ("   cols: 3", "   cols: 3x", "'3x' where a number should be"),
        ("   cols: 3", "   cols: -3", "a matrix of 3 x -3 with 9 numbers"),
        ("   rows: 3", "   rows: 4", "a matrix of 4 x 3 with 9 numbers"),
        ("   dt: d", "   dt: 99d", "a matrix of the type '99d'"),
        ("data: [", "data: [ [[[1]]],", "where a number should be"),
        ("---", "--- !!python/object/apply:os.system ['true']", "broken YAML"),
        # merges are not expanded
        ("image_width", "a0: &a0 {b: 1}\n" + HIDDEN + "image_width", None),
        ("image_width", "a: " + "[" * 9000 + "\nimage_width", "broken YAML"),
        (
            "image_width",
            "# " + "a" * 500_000 + "\nimage_width",
            "expected at most 0.5 MB",
        ),
    ],
)
def test_a_hostile_yaml_is_read_as_far_as_it_goes_or_refused(
    tmp_path, monkeypatch, before, after, message
) -> None:
    # posefit has a reader of its own: OpenCV's never gets a damaged file
    monkeypatch.setattr(cv2, "FileStorage", None)
    assert before in OPENCV
    (tmp_path / "a.yml").write_text(OPENCV.replace(before, after, 1))
    if message is None:
        assert read_calibrations(tmp_path / "a.yml")[0].size == (640, 480)
        return
    with pytest.raises(ValueError, match=message) as caught:
        read_calibrations(tmp_path / "a.yml")
    assert "\n" not in str(caught.value)


@each(
    ("made_for", "came", "fits"),
    [
        ((1080, 1920), (1088, 1920), True),
        # calibrated with the padding, filmed without
        ((1920, 1088), (1920, 1080), True),
        ((1920, 1080), (1080, 1920), False),
        ((1080, 1920), (1082, 1920), False),
    ],
)
def test_a_picture_that_a_codec_filled_up_has_the_camera_that_it_had(
    made_for, came, fits
) -> None:
    matrix = np.array([[1500.0, 0.0, 531.0], [0.0, 1510.0, 970.0], [0.0, 0.0, 1.0]])
    one = Calibration("a", made_for, matrix, np.zeros(4), None, None)
    padded = one.padded(came)
    assert (padded is not None) == fits
    if padded is not None:
        before = one.camera(made_for, np.eye(3))
        after = padded.camera(came, np.eye(3))
        np.testing.assert_array_equal(
            [after.focal, after.centre], [before.focal, before.centre]
        )
        assert (after.width, after.height) == came


@each("name", list(KINDS))
def test_cameras_of_every_program_project_as_opencv_does(
    tmp_path: Path, name: str
) -> None:
    read = read_calibrations(kind_written(tmp_path, name))
    one = read[0]
    assert len(read) == (2 if name == "intri.yml" else 1)
    assert one.size == (None if name in ("tutorial.json", "intri.yml") else (640, 480))
    placed = not name.startswith("ros")
    assert (one.rotation is not None) == placed
    points = np.random.default_rng(0).uniform(-0.8, 0.8, (40, 3))
    turn, place = (
        POSE if placed else (np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 3.0]))
    )
    bent = (
        cv2.projectPoints(points, turn, place, np.array(K), np.array(LENS))[0].reshape(
            -1, 2
        )
        + 0.5
    )
    pixels = one.camera((640, 480), np.eye(3)).project(
        points if placed else points + [0.0, 0.0, -3.0]
    )[0]
    straight = one.straightened(
        np.concatenate([bent, np.ones((40, 1))], axis=1), (640, 480)
    )[:, :2]
    np.testing.assert_allclose(straight, pixels, atol=2e-2)


@each(
    ("name", "value"),
    [("fisheye_model", "1"), ("distortion_model", "equidistant"), ("fisheye", "true")],
)
def test_a_fisheye_is_one(tmp_path: Path, name: str, value: str) -> None:
    text = f"%YAML:1.0\n---\nimage_width: 1280\nimage_height: 800\n{name}: {value}\n"
    k = np.array([[600.0, 0.0, 639.5], [0.0, 600.0, 399.5], [0.0, 0.0, 1.0]])
    for lens in ([0.1, -0.02, 0.003, 0.0], [0.0] * 4):  # without numbers, too
        (tmp_path / "a.yml").write_text(
            text + matrices(camera_matrix=k, distortion_coefficients=lens)
        )
        (one,) = read_calibrations(tmp_path / "a.yml")
        assert one.distorted
        rays = np.array([[1.0, 0.55, 1.0], [-0.4, 0.2, 1.0]])
        bent = cv2.fisheye.projectPoints(
            rays[:, None], np.zeros(3), np.zeros(3), k, np.array(lens)
        )[0].reshape(-1, 2)
        straight = one.straightened(
            np.concatenate([bent + 0.5, np.ones((2, 1))], axis=1), (1280, 800)
        )
        # 640 + 600 x, 400 + 600 y
        np.testing.assert_allclose(straight[0, :2], [1240.0, 730.0], atol=0.01)
        across, down = one.maps((1280, 800))
        np.testing.assert_allclose(
            [across[729, 1239], down[729, 1239]], bent[0], atol=0.8
        )


FINE = (
    "image_size: [640, 480]\nlens: Canon 50 mm\nlens_focal_mm: 4.2\nmodel: HERO9\ndistance: 3.0\n"
    + matrices(K=K)
)


@each(
    ("text", "message"),
    [
        (
            f"{FINE}dist_foo: [0.1, 0.2, 0, 0]",
            "the lens key 'dist_foo' of 'a', which is not known",
        ),
        (
            f"{FINE}lens_coefs: [0.1, 0, 0, 0]",
            "the lens key 'lens_coefs' of 'a', which is not known",
        ),
        (f"{FINE}xi: 1.2", "the lens key 'xi' of 'a', which is not known"),
        (f"{FINE}kappa: 0.1", "the lens key 'kappa' of 'a', which is not known"),
        (f"{FINE}k4: 0.2\nk1: 0.1", "the lens key 'k4' of 'a', which is not known"),
        (
            FINE.replace("K:", "camera_matrix:") + "k: [0.1, 0, 0, 0]",
            "the lens key 'k' of 'a', which is not known",
        ),
        (
            f"{FINE}distortion_model: double_sphere",
            "the lens model 'double_sphere', which is not known",
        ),
        (
            f"{FINE}model: omnidirectional",
            "the lens model 'omnidirectional', which is not known",
        ),
        (
            f"{FINE}fisheye: true\ndist: [0.1, 0.1, 0.1, 0.1, 0.1]",
            "a distortion of 5 numbers of a fisheye",
        ),
    ],
)
def test_a_lens_that_is_not_known_is_named(
    tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "a.yml"
    path.write_text(FINE)
    assert not read_calibrations(path)[0].distorted
    path.write_text(f"{text}\n")
    with pytest.raises(ValueError, match=message):
        read_calibrations(path)


@each(
    ("matrix", "message"),
    [
        (
            np.diag([1e8, 1e8, 1]).tolist(),
            "focal must be in pixels: 32 to 64000 for pictures of this size, got 1e",
        ),
        # millimetres
        ([[4.2, 0, 319.5], [0, 4.2, 239.5], [0, 0, 1]], "focal must be in pixels"),
        # as MATLAB has it
        (np.transpose(K).tolist(), "a camera matrix that is not of the form fx 0 cx"),
    ],
)
def test_a_camera_that_cannot_be_is_refused_before(
    tmp_path: Path, matrix: object, message: str
) -> None:
    (tmp_path / "a.json").write_text(
        json.dumps({"K": matrix, "image_size": [640, 480]})
    )
    with pytest.raises(ValueError, match=message):
        read_calibrations(tmp_path / "a.json")


def test_a_camera_is_chosen_by_its_name(tmp_path: Path) -> None:
    path = kind_written(tmp_path, "intri.yml")
    (one,) = read_calibrations(f"{path}:right")
    assert (one.name, one.distorted) == ("right", False)
    with pytest.raises(
        ValueError,
        match="intri.yml: expected the name of a camera, left, right, got 'middle'",
    ):
        read_calibrations(f"{path}:middle")
    (tmp_path / "a:b.yml").write_text(YAML_24)  # a name of a file may have a colon
    assert read_calibrations(tmp_path / "a:b.yml")[0].distorted


def test_up_that_is_named_holds_for_our_own_cameras_and_a_guess_is_reported(
    tmp_path: Path,
) -> None:
    level = Camera.around(np.zeros(3), 0.4, 3.0, (320, 240))
    lying = replace(
        level,
        rotation=level.rotation
        @ upright([], None)
        @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    )
    (tmp_path / "a.json").write_text(lying.to_json())
    (one,) = read_calibrations(tmp_path / "a.json")
    why = "as in posefit's own files, although z is up in their images"
    assert guessed_up([one]) == f"+y is up in the cameras' world, {why}"
    np.testing.assert_allclose(
        one.camera((320, 240), upright([one], "z")).rotation, level.rotation, atol=1e-9
    )
    # of which the cosines are 0.57 and 0.42
    for degrees, doubted in ((55.0, False), (65.0, True)):
        down = replace(level, rotation=about(0, np.radians(degrees)) @ level.rotation)
        (tmp_path / "a.json").write_text(down.to_json())
        for count in (1, 3):
            assert (
                bool(guessed_up(count * read_calibrations(tmp_path / "a.json")))
                == doubted
            )
    (tmp_path / "a.json").write_text(level.to_json())
    assert guessed_up(read_calibrations(tmp_path / "a.json")) == ""
    assert (
        guessed_up(read_calibrations(written(tmp_path, "a.toml")))
        == "+z is up in the cameras' world"
    )
    with pytest.raises(ValueError, match="up must be one of x, y, z, got 'w'"):
        upright([one], "w")  # type: ignore[arg-type]


@each("key", ["p3", "s1", "s4", "b1", "b2", "tau_x", "skew", "thin_prism", "alpha_c"])
def test_every_number_of_a_lens_that_is_not_read_is_named(
    tmp_path: Path, key: str
) -> None:
    path = tmp_path / "a.yml"
    path.write_text(f"{FINE}k1: 0.1\n{key}: 0.0\n")
    assert read_calibrations(path)[0].distorted
    path.write_text(f"{FINE}k1: 0.1\n{key}: 0.02\n")
    with pytest.raises(ValueError, match=f"the lens key '{key}' of 'a'"):
        read_calibrations(path)
    path.write_text(json.dumps({"K": K, "dist": {"k1": 0.1, key: 0.02}}))
    with pytest.raises(ValueError, match=f"the lens key '{key}' of 'a'"):
        read_calibrations(path)


# row, column: K must be fx 0 cx, 0 fy cy, 0 0 1, and a skew beside fx has a message of its own
@each(("row", "column"), [(1, 0), (2, 0), (2, 1), (2, 2)])
def test_a_matrix_of_another_form_is_refused(
    tmp_path: Path, row: int, column: int
) -> None:
    matrix = np.array(K)
    matrix[row, column] += 0.5
    path = tmp_path / "a.json"
    path.write_text(json.dumps({"K": matrix.tolist(), "image_size": [640, 480]}))
    with pytest.raises(ValueError, match="a camera matrix that is not of the form"):
        read_calibrations(path)


def test_a_skewed_matrix_is_refused(tmp_path: Path) -> None:
    for skew, refused in ((0.1, False), (5.0, True)):
        matrix = [[500.0, skew, 319.5], *K[1:]]
        path = tmp_path / "a.json"
        path.write_text(json.dumps({"K": matrix, "image_size": [640, 480]}))
        if refused:
            with pytest.raises(ValueError, match="a skew of 5 pixels"):
                read_calibrations(path)
        else:
            assert len(read_calibrations(path)) == 1


# sizes of common films of which one is made smaller for the other, and the centres of a good lens
@each(
    ("size", "centre", "fits"),
    [
        ((640, 480), (319.5, 239.5), True),
        ((640, 480), (300.0, 260.0), True),
        ((1920, 1080), (990.0, 500.0), True),
        # of 1920x1080, 1280x720, 2704x1520
        ((640, 480), (959.5, 539.5), False),
        ((1280, 720), (950.0, 535.0), False),
        ((1920, 1080), (639.5, 359.5), False),
        ((1920, 1080), (1351.5, 759.5), False),
        ((320, 240), (319.5, 239.5), False),
    ],
)
def test_a_size_that_contradicts_the_centre_is_refused(
    tmp_path: Path, size: tuple[int, int], centre: tuple[float, float], fits: bool
) -> None:
    focal = 0.9 * size[0]
    matrix = [[focal, 0.0, centre[0]], [0.0, focal, centre[1]], [0.0, 0.0, 1.0]]
    for name, text in (
        ("a.json", json.dumps({"K": matrix, "image_size": size})),
        ("a.toml", f"[a]\nmatrix = {matrix}\nsize = {list(size)}\n"),
        ("a.yml", f"w: {size[0]}\nh: {size[1]}\nK: {matrix}\n"),
    ):
        (tmp_path / name).write_text(text)
        if fits:
            assert read_calibrations(tmp_path / name)[0].size == size
            continue
        message = f"a centre of {centre[0]:g} and {centre[1]:g} in pictures of {size[0]}x{size[1]}: "
        with pytest.raises(ValueError, match=message):
            read_calibrations(tmp_path / name)
    # without a size it is the pictures' own that has to fit
    (tmp_path / "b.json").write_text(json.dumps({"K": matrix}))
    (one,) = read_calibrations(tmp_path / "b.json")
    assert (one.padded(size) is not None) == fits


REGION = "roi: {x_offset: 100, y_offset: 60, height: 240, width: 320}\n"


@each(
    ("more", "size", "focal", "centre"),
    [
        ("", (640, 480), (500.0, 510.0), (320.0, 240.0)),
        ("binning_x: 0\nbinning_y: 0\n", (640, 480), (500.0, 510.0), (320.0, 240.0)),
        ("binning_x: 2\nbinning_y: 2\n", (320, 240), (250.0, 255.0), (160.0, 120.0)),
        (REGION, (320, 240), (500.0, 510.0), (220.0, 180.0)),
        (
            f"{REGION}binning_x: 2\nbinning_y: 4\n",
            (160, 60),
            (250.0, 127.5),
            (110.0, 45.0),
        ),
        (
            "roi: {x_offset: 0, y_offset: 0, height: 0, width: 0}\n",
            (640, 480),
            (500.0, 510.0),
            (320.0, 240.0),
        ),
    ],
)
def test_a_part_of_ros_sensor_has_the_camera_of_that_part(
    tmp_path: Path, more: str, size: object, focal: object, centre: object
) -> None:
    # sensor_msgs/CameraInfo: K and the size are those of the whole sensor; of the part, the offset is taken off, and
    # the pixels of a bin are one
    path = tmp_path / "a.yaml"
    path.write_text(
        f"width: 640\nheight: 480\ndistortion_model: plumb_bob\nD: [0, 0, 0, 0, 0]\n"
        f"K: {np.ravel(K).tolist()}\nP: {np.ravel(np.eye(3, 4)).tolist()}\n{more}"
    )
    (one,) = read_calibrations(path)
    assert one.size == size
    camera = one.camera(one.size, np.eye(3))
    np.testing.assert_allclose(camera.focal, focal)
    np.testing.assert_allclose(camera.centre, centre)


@each(
    ("rotation", "fits"),
    [
        ([0.0, 0.0, 0.0], True),
        ([3.6, 0.0, 0.0], True),
        ([6.2, 0.5, 0.0], True),
        ([180.0, 0.0, 0.0], False),
        ([0.0, 45.0, 90.0], False),
        ([6.3, 0.0, 0.0], False),
    ],
)
def test_a_rotation_beyond_a_full_turn_is_refused(
    tmp_path: Path, rotation: list[float], fits: bool
) -> None:
    path = tmp_path / "a.json"
    path.write_text(json.dumps({"K": K, "rvec": rotation, "tvec": [0, 1, 4]}))
    if fits:
        turn = cv2.Rodrigues(np.array(rotation))[0]
        np.testing.assert_allclose(read_calibrations(path)[0].rotation, turn)
        return
    with pytest.raises(ValueError, match="more than a full turn: are .* degrees"):
        read_calibrations(path)


PLACE = np.vstack(
    [np.column_stack([np.eye(3), [0.1, 0.2, 3.0]]), [0, 0, 0, 1]]
).tolist()


@each(
    "key",
    [
        *("camera_to_world", "cam2world", "c2w", "world_to_camera", "w2c", "T_wc"),
        *("extrinsics", "extrinsic", "extrinsicMatrix", "transform_matrix", "pose"),
        *("camera_pose", "RT", "qvec", "position", "matrix_world"),
    ],
)
def test_a_place_under_a_name_that_is_not_read_is_refused_by_it(
    tmp_path: Path, key: str
) -> None:
    path = tmp_path / "a.json"
    table = {"R": np.eye(3).tolist(), "t": [0, 0, 3]}
    # what users call extrinsics, from the world to the camera, is read from a table
    for value in (PLACE, *([] if "extrinsic" in key else [table])):
        path.write_text(json.dumps({"cameras": {"b": {"K": K, key: value}}}))
        with pytest.raises(ValueError, match=f"the key '{key}' of 'b'"):
            read_calibrations(path)
    # beside a place that is read, it does no harm
    placed = {"R": np.eye(3).tolist(), "t": [0.1, 0.2, 3.0]}
    path.write_text(json.dumps({"K": K, key: PLACE, **placed}))
    np.testing.assert_allclose(read_calibrations(path)[0].translation, [0.1, 0.2, 3.0])


def test_the_pose_of_one_board_places_the_camera_and_many_do_not(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.json"
    one = {"rvecs": [[0.1], [0.2], [-0.3]], "tvecs": [[[1.0], [2.0], [5.0]]]}
    path.write_text(json.dumps({"mtx": K, **one}))
    (camera,) = read_calibrations(path)
    np.testing.assert_allclose(camera.translation, [1.0, 2.0, 5.0])
    turn = cv2.Rodrigues(np.array([0.1, 0.2, -0.3]))[0]
    np.testing.assert_allclose(camera.rotation, turn)
    boards = {"rvecs": np.ones((9, 3)).tolist(), "tvecs": np.ones((9, 3)).tolist()}
    path.write_text(json.dumps({"mtx": K, **boards}))
    assert read_calibrations(path)[0].rotation is None


def test_kalibrs_chain_places_each_camera_from_the_one_before(tmp_path: Path) -> None:
    quarter = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    steps = [
        np.vstack([np.column_stack([quarter, place]), [0, 0, 0, 1]])
        for place in ([-4.0, 0.0, 4.0], [1.0, 0.5, 0.0])
    ]
    intrinsics = "  intrinsics: [500, 510, 319.5, 239.5]\n  resolution: [640, 480]\n"
    text = f"cam0:\n{intrinsics}"
    for number, step in enumerate(steps, 1):
        text += f"cam{number}:\n  T_cn_cnm1: {step.tolist()}\n{intrinsics}"
    (tmp_path / "camchain.yaml").write_text(text)
    first, second, third = read_calibrations(tmp_path / "camchain.yaml")
    point = np.array([0.3, 0.2, 2.0, 1.0])
    for camera, matrix in (
        (first, np.eye(4)),
        (second, steps[0]),
        (third, steps[1] @ steps[0]),
    ):
        seen = camera.rotation @ point[:3] + camera.translation
        np.testing.assert_allclose(seen, (matrix @ point)[:3], atol=1e-12)


@each("names", ["ABCD", "KMRD", "TWHK", "rtdk"])
def test_cameras_may_have_the_names_of_keys(tmp_path: Path, names: str) -> None:
    table = {"matrix": K, "size": [640, 480], "rotation": [0, 0, 0]}
    texts = {"a.toml": "", "a.json": {}}
    for number, name in enumerate(names):
        place = {**table, "translation": [0.0, 0.0, float(number)]}
        texts["a.json"][name] = place
        lines = "\n".join(f"{key} = {value}" for key, value in place.items())
        texts["a.toml"] += f"[{name}]\n{lines}\n"
    for file, text in texts.items():
        path = tmp_path / file
        path.write_text(text if isinstance(text, str) else json.dumps(text))
        read = read_calibrations(path)
        assert [one.name for one in read] == list(names)
        assert [one.translation[2] for one in read] == [0.0, 1.0, 2.0, 3.0]


def test_a_list_of_cameras_is_read(tmp_path: Path) -> None:
    table = {"name": "c01", "size": [640, 480], "matrix": K, "rotation": [0.1, 0, 0]}
    tables = [{**table, "translation": [0, 0, 4], "distCoef": LENS}]
    for name in ("a.json", "a.yml"):
        (tmp_path / name).write_text(json.dumps(tables))
        (one,) = read_calibrations(tmp_path / name)
        assert (one.name, one.distorted, one.size) == ("c01", True, (640, 480))


@each(
    ("text", "what"),
    [
        ("<document><chunk/></document>", "a camera, got none"),
        ("<Cameras><Camera/></Cameras>", "a camera, got none"),
        ("<svg/>", "XML of 'svg', which is not known"),
        ("<calibration><cameras/></calibration>", "XML of 'calibration', which"),
    ],
)
def test_xml_of_another_program_is_reported_as_such(
    tmp_path: Path, text: str, what: str
) -> None:
    for name in ("a.xml", "a.xcp"):
        (tmp_path / name).write_text(text)
        with pytest.raises(ValueError, match=what):
            read_calibrations(tmp_path / name)
