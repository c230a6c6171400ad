"""Calibrations of each program: axes, units and lenses by hand, and what a program is not known to write."""

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.geometry.calibration import DIALECTS, Calibration, read_calibrations
from posefit.geometry.calibration.lens import OPENGL
from posefit.geometry.calibration.read import dialect_of
from posefit.geometry.calibration.values import stored
from posefit.geometry.calibration.world import misreading
from posefit.geometry.camera import Camera
from tests.cases import each
from tests.geometry import programs
from tests.geometry.calibrations import QUALISYS, ROS
from tests.geometry.programs import SAMPLES

# that do not say where a camera stands
UNPLACED = ("ROS", "RealSense")
# that do not say how large its pictures are
UNSIZED = ("VoxelPose",)
# that always write one unit
OF_ONE_UNIT = ("Vicon", "OpenCap", "Kalibr", "CMU Panoptic", "VoxelPose")
SIZE = (640, 480)


def one_of(tmp_path: Path, text: str, suffix: str = ".json") -> Calibration:
    path = tmp_path / f"left{suffix}"
    path.write_text(text)
    (one,) = read_calibrations(path)
    return one


def refused(tmp_path: Path, text: str, suffix: str = ".json") -> str:
    with pytest.raises(ValueError, match="left") as caught:
        one_of(tmp_path, text, suffix)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_every_dialect_has_a_sample_here_or_in_the_other_tests(tmp_path: Path) -> None:
    others = {"posefit", "Qualisys"}
    assert {dialect.program for dialect in DIALECTS} == {*SAMPLES} | others
    own = Camera.around(np.zeros(3), 0.3, 4.0, SIZE).to_json()
    texts = {"posefit": (own, ".json"), "Qualisys": (QUALISYS, ".xml")}
    for program, (write, suffix, _) in SAMPLES.items():
        texts[program] = write(), suffix
    for program, (text, suffix) in texts.items():
        file = stored(tmp_path / f"a{suffix}", text)
        assert dialect_of(file).program == program
        # no other one but OpenCV's users, who come last, takes it for its own
        claims = [each.program for each in DIALECTS if each.recognises(file)]
        assert set(claims) <= {program, "OpenCV"}


@each("program", list(SAMPLES))
def test_a_known_point_has_the_position_worked_out_by_hand(
    tmp_path: Path, program: str
) -> None:
    write, suffix, metres = SAMPLES[program]
    one = one_of(tmp_path, write(), suffix)
    assert one.name == "left"
    assert one.size == (None if program in UNSIZED else SIZE)
    assert (one.rotation is None) == (program in UNPLACED)
    assert not one.distorted
    assert (one.scale == "metres") == (program in OF_ONE_UNIT)
    camera = one.in_metres(metres).camera(SIZE, np.eye(3))
    np.testing.assert_allclose(camera.focal, 500.0)
    np.testing.assert_allclose(camera.centre, [310.0, 250.0])
    if program in UNPLACED:
        return
    np.testing.assert_allclose(camera.position, [0.0, -4.0, 1.0], atol=1e-6)
    # half a metre to its right, a metre above it, 4 m before it: 500 / 4 pixels a metre
    pixels, depths = camera.project(np.array([[0.5, 0.0, 2.0]]))
    np.testing.assert_allclose(pixels, [[310.0 + 62.5, 250.0 - 125.0]], atol=1e-4)
    np.testing.assert_allclose(depths, 4.0, rtol=1e-6)


@each(
    ("program", "more", "key"),
    [
        ("NeRF's programs", {"from_na": True, "shear": 0.1}, "shear"),
        ("NeRF's programs", {"world_scale": [2.0, 2.0, 2.0]}, "world_scale"),
        ("NeRF's programs", {"k4": 0.1}, "k4"),
        ("NeRF's programs", {"camera_model": "EQUIRECTANGULAR"}, "EQUIRECTANGULAR"),
        ("openMVG", {"disto_k1": [0.1]}, "disto_k1"),
        ("openMVG", {"model": "spherical"}, "spherical"),
        ("OpenCap", {"k7": 0.1}, "k7"),
        ("Kalibr", {"T_imu_cam": programs.FROM_WORLD}, "T_imu_cam"),
        ("Kalibr", {"camera_model": "omni"}, "omni"),
        ("Kalibr", {"camera_model": "ds", "intrinsics": [0.5, 0.6, 500.0, 500.0, 309.5, 249.5]}, "ds"),
        ("Kalibr", {"distortion_model": "fov"}, "fov"),
        ("ROS", {"crop": 3}, "crop"),
        ("ROS", {"distortion_model": "fov"}, "fov"),
        ("EasyMocap", {"k_left": [0.1, 0.2]}, "k_left"),
        ("CMU Panoptic", {"scale": 0.5}, "scale"),
        ("VoxelPose", {"s": 0.5}, "s"),
        ("RealSense", {"model": "inverse_brown_conrady", "coeffs": [0.1, 0, 0, 0, 0]}, "inverse_brown_conrady"),
        ("RealSense", {"skew": 3.0}, "skew"),
        ("Anipose", {"crop": [3, 4]}, "crop"),
        ("Anipose", {"p3": 0.1}, "p3"),
        ("OpenCV", {"zoom": 2.0}, "zoom"),
        # the other half of a pose is the mistake, and not that it is missing
        ("OpenCV", {"rvec": None, "quaternion": [1.0, 0.0, 0.0, 0.0]}, "quaternion"),
        ("OpenCV", {"rvec": None, "euler": [90.0, 0.0, 0.0]}, "euler"),
        ("OpenCV", {"tvec": None, "camera_position": [0.0, -4.0, 1.0]}, "camera_position"),
        ("OpenCV", {"tvec": None, "C": [0.0, -4.0, 1.0]}, "C"),
        ("OpenCV", {"camera_matrix": None, "k": [0.1, 0.2, 0.0]}, "k"),
        ("OpenCV", {"axis_convention": "opengl"}, "axis_convention"),
        ("OpenCV", {"pitch_deg": 8.0, "rvec": None, "tvec": None}, "pitch_deg"),
    ],
)  # fmt: skip
def test_a_key_that_a_program_does_not_write_is_refused_by_name(
    tmp_path: Path, program: str, more: dict[str, Any], key: str
) -> None:
    write, suffix, _ = SAMPLES[program]
    if program == "OpenCV":
        values = {**json.loads(write()), **more}
        text = json.dumps({k: v for k, v in values.items() if v is not None})
    else:
        text = write(**more)
    message = refused(tmp_path, text, suffix)
    assert f"expected a calibration of {program}, got " in message
    assert repr(key) in message


@each("program", ["Kalibr", "CMU Panoptic", "RealSense", "Anipose", "OpenCV"])
@each("key", ["T_world_rig", "camera_to_world", "extrinsics"])
def test_a_place_beside_the_cameras_is_refused_by_name(
    tmp_path: Path, program: str, key: str
) -> None:
    write, suffix, _ = SAMPLES[program]
    place = np.eye(4).tolist()
    if suffix == ".toml":
        text = f"{key} = {place}\n{write()}"
    else:
        values = json.loads(write())
        if program in ("RealSense", "OpenCV"):
            values = {"left": values}
        text = json.dumps({**values, key: place})
    assert repr(key) in refused(tmp_path, text, suffix)


@each(
    ("more", "words"),
    [
        ({"rvec": [1.0, 0.0, 0.0, 0.0]}, "a quaternion [1.0, 0.0, 0.0, 0.0]"),
        ({"camera_matrix": np.transpose(programs.K).tolist()}, "transpose it"),
        ({"camera_matrix": [500.0, 500.0, 309.5, 249.5]}, "4 numbers under the key"),
        ({"camera_matrix": {"mu": 500.0, "mv": 500.0}}, "a table under the key"),
        ({"camera_matrix": None, "f": 500.0}, "but no camera matrix, and no fx, fy"),
    ],
)
def test_a_value_of_another_form_is_refused_with_what_it_is(
    tmp_path: Path, more: dict[str, Any], words: str
) -> None:
    values = {**json.loads(programs.opencv()), **more}
    text = json.dumps({k: v for k, v in values.items() if v is not None})
    assert words in refused(tmp_path, text)


def test_a_message_that_ends_with_the_next_ones_beginning_is_read(
    tmp_path: Path,
) -> None:
    assert one_of(tmp_path, f"{ROS}---\n", ".yaml").size == SIZE


def test_a_tag_of_metashapes_without_a_number_is_passed_over(tmp_path: Path) -> None:
    text = programs.metashape("<covariance><params>f</params></covariance>")
    assert one_of(tmp_path, text, ".xml").size == SIZE


def test_rotation_vectors_of_easymocap_suffice(tmp_path: Path) -> None:
    (tmp_path / "intri.yml").write_text(programs.easymocap())
    values = json.loads(programs.easymocap())
    for key in ("K_left", "dist_left", "Rot_left", "H_left", "W_left"):
        del values[key]
    path = tmp_path / "extri.yml"
    path.write_text(json.dumps(values))
    (one,) = read_calibrations(path)
    np.testing.assert_allclose(one.position, [0.0, -4.0, 1.0], atol=1e-6)


@each("angle", [40.0, 0.0, -0.5, 3.2])
def test_an_angle_of_view_is_less_than_half_a_turn(
    tmp_path: Path, angle: float
) -> None:
    values = json.loads(programs.nerf(camera_angle_x=angle))
    del values["fl_x"], values["fl_y"]
    assert f"a camera_angle_x of {angle:g}" in refused(tmp_path, json.dumps(values))


@each("order", [1, -1])
def test_metashapes_initial_calibration_is_not_the_adjusted_one(
    tmp_path: Path, order: int
) -> None:
    text = programs.metashape()
    start, end = text.index("<calibration"), text.index("</calibration>")
    adjusted = text[start:end] + "</calibration>"
    initial = adjusted.replace("adjusted", "initial").replace("500", "900")
    both = "".join([initial, adjusted][::order])
    one = one_of(tmp_path, text.replace(adjusted, both), ".xml")
    np.testing.assert_allclose(np.diag(one.matrix), [500.0, 500.0, 1.0])
    turned = text.replace("</transform>", "</transform><orientation>6</orientation>", 1)
    assert "'orientation' of 'left'" in refused(tmp_path, turned, ".xml")


@each("key", ["ORIENTATION", "POSITION", "PRINCIPAL_POINT", "FOCAL_LENGTH"])
def test_what_a_vicon_camera_lacks_is_named(tmp_path: Path, key: str) -> None:
    text = programs.vicon().replace(f" {key}=", f" {key}_ID=")
    assert f"the camera 'left' without {key}" in refused(tmp_path, text, ".xcp")


# a program by whose files no text is taken for a model of the lens
@each("program", sorted({*SAMPLES} - {"Vicon", "Metashape"}))
@each("model", ["fisheye", "SIMPLE_RADIAL_FISHEYE", "Fisheye624", "omni"])
def test_a_lens_model_under_an_unknown_key_is_read_or_refused(
    tmp_path: Path, program: str, model: str
) -> None:
    write, suffix, _ = SAMPLES[program]
    for key in ("lens", "type", "lens_kind"):
        more = {f"{key}_left" if program == "EasyMocap" else key: model}
        if program == "CMU Panoptic" and key == "type":
            continue  # it states the kind of its cameras so
        if program == "OpenCV" and model == "fisheye" and key != "lens_kind":
            assert one_of(tmp_path, write(**more), suffix).fisheye
            continue
        message = refused(tmp_path, write(**more), suffix)
        assert key in message or repr(model) in message


@each("key", ["P", "projection_matrix"])
@each("as_opencv", [False, True])
def test_a_projection_is_passed_over_unless_it_alone_places_the_camera(
    tmp_path: Path, key: str, as_opencv: bool
) -> None:
    matrix = np.array(programs.K) @ np.array(programs.FROM_WORLD)[:3]
    value: Any = matrix.tolist()
    if as_opencv:
        value = {"rows": 3, "cols": 4, "dt": "d", "data": matrix.ravel().tolist()}
    one = one_of(tmp_path, programs.opencv(**{key: value}))
    np.testing.assert_allclose(one.position, [0.0, -4.0, 1.0], atol=1e-6)
    values = json.loads(programs.opencv(**{key: value}))
    del values["rvec"], values["tvec"]
    assert f"the key {key!r}" in refused(tmp_path, json.dumps(values))
    # of a rectified picture
    values[key] = np.hstack([programs.K, [[-60.0], [0.0], [0.0]]]).tolist()
    assert one_of(tmp_path, json.dumps(values)).rotation is None


@each(
    "more",
    [
        {"calibration_date": "2025-01-16", "rms": 0.3, "reprojection_error": 0.4},
        {"board_size": [11, 8], "square_size_mm": 10.0, "num_images": 40},
        {"serial_number": 7, "fps": 30, "camera_id": 3, "exposure": 5.0},
        {"rvecs": np.ones((4, 3)).tolist(), "tvecs": np.ones((4, 3)).tolist()},
        {"new_camera_matrix": programs.K, "fov_x_deg": 67.3, "camera_angle_x": 1.2},
        {"distance_m": 4.0, "lens_focal_mm": 4.2, "model": "HERO9", "note": "left one"},
        {"P": np.eye(3, 4).tolist(), "per_view_errors": [0.1, 0.2]},
        {"timestamp": 1.7e9, "calibration_time": 12.5, "model": "HERO9 Black"},
    ],
)
def test_numbers_that_describe_neither_lens_nor_place_are_passed_over(
    tmp_path: Path, more: dict[str, Any]
) -> None:
    plain = one_of(tmp_path, programs.opencv())
    other = one_of(tmp_path, programs.opencv(**more))
    np.testing.assert_array_equal(plain.matrix, other.matrix)
    np.testing.assert_array_equal(plain.translation, other.translation)


K1, K2, K3, P1, P2 = 0.11, -0.07, 0.02, 0.003, -0.002


def brown(x: Array, y: Array, down: float, across: float) -> tuple[Array, Array]:
    """Return where Brown's lens puts a ray: `across` is the number with x^2 in x, `down` that with y^2 in y."""
    r2 = x * x + y * y
    radial = 1.0 + K1 * r2 + K2 * r2**2 + K3 * r2**3
    return (
        x * radial + across * (r2 + 2.0 * x * x) + 2.0 * down * x * y,
        y * radial + down * (r2 + 2.0 * y * y) + 2.0 * across * x * y,
    )


# texts with this lens, and the numbers down and across by each program's own formula
LENSES: dict[str, tuple[str, str, float, float]] = {
    "OpenCV": (programs.opencv(dist_coeffs=[[K1, K2, P1, P2, K3]]), ".json", P1, P2),
    "Anipose": (programs.anipose(distortions=[K1, K2, P1, P2, K3]), ".toml", P1, P2),
    "NeRF's programs": (programs.nerf(k1=K1, k2=K2, p1=P1, p2=P2, k3=K3), ".json", P1, P2),
    "openMVG": (programs.openmvg("pinhole_brown_t2", disto_t2=[K1, K2, K3, P1, P2]), ".json", P1, P2),
    "VoxelPose": (programs.voxelpose(k=[[K1], [K2], [K3]], p=[[P1], [P2]]), ".json", P1, P2),
    "RealSense": (programs.realsense(coeffs=[K1, K2, P1, P2, K3]), ".json", P1, P2),
    "OpenCap": (programs.opencap(distortion=[[K1, K2, P1, P2, K3]]), ".json", P1, P2),
    # its manual: x (...) + P1 (r^2 + 2 x^2) + 2 P2 x y
    "Metashape": (
        programs.metashape(f"<k1>{K1}</k1><k2>{K2}</k2><k3>{K3}</k3><p1>{P1}</p1><p2>{P2}</p2>"),
        ".xml", P2, P1,
    ),
}  # fmt: skip


def straight_pixels(one: Calibration, bent: Array) -> Array:
    """Return where rays are without the lens, of columns and rows (n, 2) with it."""
    points = np.column_stack([bent, np.ones(len(bent))])
    return one.straightened(points, SIZE)[:, :2]


@each("program", list(LENSES))
def test_a_lens_is_undone_by_its_programs_formula(tmp_path: Path, program: str) -> None:
    text, suffix, down, across = LENSES[program]
    one = one_of(tmp_path, text, suffix)
    assert one.distorted
    rays = np.random.default_rng(0).uniform(-0.45, 0.45, (30, 2))
    bent = np.column_stack(brown(*rays.T, down, across))
    np.testing.assert_allclose(
        straight_pixels(one, 500.0 * bent + [310.0, 250.0]),
        500.0 * rays + [310.0, 250.0],
        atol=2e-2,
    )


@each(
    "lens",
    [
        'VICON_RADIAL="2.7e-07 7.6e-14"',
        'VICON_RADIAL2="Vicon3Parameter 309.5 249.5 2.7e-07 7.6e-14 7.8e-20"',
        'VICON_RADIAL2="Vicon3Parameter 309.5 249.5 -2.0e-07 0 0"',
    ],
)
def test_vicons_lens_leads_from_the_picture_to_the_straight_one(
    tmp_path: Path, lens: str
) -> None:
    one = one_of(tmp_path, programs.vicon(lens), ".xcp")
    k1, k2, k3 = np.append([float(word) for word in lens.strip('"').split('"')[-1].split()[-3:] if "e" in word or word == "0"], [0.0] * 3)[:3]  # fmt: skip
    bent = np.random.default_rng(1).uniform(-0.5, 0.5, (40, 2)) * SIZE
    r2 = (bent**2).sum(axis=1, keepdims=True)
    straight = bent * (1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3)
    np.testing.assert_allclose(
        straight_pixels(one, bent + [310.0, 250.0]), straight + [310.0, 250.0], atol=0.3
    )


def test_a_lens_of_vicon_whose_centre_is_elsewhere_is_refused(tmp_path: Path) -> None:
    lens = 'VICON_RADIAL2="Vicon3Parameter 300 249.5 2.7e-07 0 0"'
    assert "VICON_RADIAL2" in refused(tmp_path, programs.vicon(lens), ".xcp")
    assert "'SKEW'" in refused(tmp_path, programs.vicon(camera='SKEW="0.1"'), ".xcp")


def test_cameras_of_vicon_that_only_see_markers_do_not_count(tmp_path: Path) -> None:
    path = tmp_path / "a.xcp"
    path.write_text(programs.vicon())
    assert [one.name for one in read_calibrations(path)] == ["left"]


def test_a_chunk_of_metashape_is_moved_to_metres(tmp_path: Path) -> None:
    free = one_of(tmp_path, programs.metashape(), ".xml")
    # in the chunk it stands at (0, -2, 0.5), and its world is twice as large, a quarter turned about z and 3 m along x
    half = "1 0 0 0 0 0 1 -2 0 -1 0 0.5 0 0 0 1"
    chunk = (
        "<transform><rotation>0 -1 0 1 0 0 0 0 1</rotation>"
        "<translation>3 0 0</translation><scale>2</scale></transform>"
    )
    one = one_of(tmp_path, programs.metashape("", chunk, half), ".xml")
    assert (free.scale, one.scale) == ("free", "metres")
    camera = one.camera(SIZE, np.eye(3))
    np.testing.assert_allclose(camera.position, [3.0 + 4.0, 0.0, 1.0], atol=1e-9)
    # it looked along y, and now looks along -x
    np.testing.assert_allclose(camera.rotation[2], [-1.0, 0.0, 0.0], atol=1e-9)
    globe = chunk.replace("3 0 0", "4000000 700000 4900000")
    assert "globe" in refused(tmp_path, programs.metashape("", globe), ".xml")
    for lens, key in (
        ("<k4>0.1</k4>", "k4"),
        ("<b2>3</b2>", "b2"),
        ("<p3>1</p3>", "p3"),
    ):
        assert repr(key) in refused(tmp_path, programs.metashape(lens), ".xml")
    wider = one_of(tmp_path, programs.metashape("<b1>5</b1>"), ".xml")
    np.testing.assert_allclose(np.diag(wider.matrix)[:2], [505.0, 500.0])


@each(
    ("more", "focal"),
    [
        ({"camera_angle_x": 2.0 * np.arctan(0.64)}, (500.0, 500.0)),
        (
            {"camera_angle_x": 2.0 * np.arctan(0.64), "camera_angle_y": 2.0 * np.arctan(0.48)},
            (500.0, 500.0),
        ),
        ({"fl_x": 400.0}, (400.0, 400.0)),
    ],
)  # fmt: skip
def test_transforms_may_state_angles_and_no_centre(
    tmp_path: Path, more: dict[str, float], focal: tuple[float, float]
) -> None:
    frame = {"file_path": "a/left.png", "transform_matrix": programs.GL_TO_WORLD}
    values = {"w": 640, "h": 480, **more, "frames": [frame]}
    one = one_of(tmp_path, json.dumps(values))
    camera = one.camera(SIZE, np.eye(3))
    np.testing.assert_allclose(camera.focal, focal)
    np.testing.assert_allclose(camera.centre, [320.0, 240.0])
    assert one.scale == "free"
    nothing = json.dumps({"w": 640, "h": 480, "frames": [frame]})
    assert "without fl_x" in refused(tmp_path, nothing)
    assert "without w and h" in refused(
        tmp_path, json.dumps({"fl_x": 400.0, "frames": [frame]})
    )


def test_each_frame_may_have_its_own_lens_and_name(tmp_path: Path) -> None:
    matrix = [[450.0, 0.0, 300.0], [0.0, 450.0, 230.0], [0.0, 0.0, 1.0]]
    frames = [
        {"file_path": f"{folder}/0001.png", "transform_matrix": programs.GL_TO_WORLD}
        for folder in ("a", "b")
    ]
    frames[1] |= {"K": matrix}  # type: ignore[dict-item]
    values = {**json.loads(programs.nerf()), "frames": frames}
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(values))
    first, second = read_calibrations(path)
    assert (first.name, second.name) == ("a/0001.png", "b/0001.png")
    assert first.camera(SIZE, np.eye(3)).focal[0] == 500.0
    np.testing.assert_allclose(second.camera(SIZE, np.eye(3)).centre, [300.0, 230.0])
    fisheye = one_of(
        tmp_path, programs.nerf(camera_model="OPENCV_FISHEYE", k1=0.1, k4=0.01)
    )
    assert fisheye.fisheye
    np.testing.assert_array_equal(fisheye.distortion, [0.1, 0.0, 0.0, 0.01])


def test_a_pickle_is_refused_with_how_to_convert_it_and_never_read(
    tmp_path: Path,
) -> None:
    path = tmp_path / "cameraIntrinsicsExtrinsics.pickle"
    # it would make a file
    path.write_bytes(b"cos\nsystem\n(S'touch " + bytes(tmp_path / "made") + b"'\ntR.")
    with pytest.raises(
        ValueError, match="got a pickle, .* convert it to JSON: json.dump"
    ):
        read_calibrations(path)
    assert not (tmp_path / "made").exists()


def test_tables_of_one_camera_are_read_together(tmp_path: Path) -> None:
    lens = {"fx": 500.0, "fy": 500.0, "cx": 309.5, "cy": 249.5}
    parts = {
        "intrinsics": lens,
        "distortion": [0.0] * 5,
        "extrinsics": {"R": programs.R, "t": programs.T},
        "image_size": [640, 480],
    }
    for values in (
        parts,
        {"cameras": {"left": parts}},
        {"cameras": [{"name": "left", **parts}]},
    ):
        one = one_of(tmp_path, json.dumps(values))
        assert (one.name, one.size) == ("left", SIZE)
        np.testing.assert_allclose(one.translation, programs.T)
        np.testing.assert_allclose(one.matrix, programs.K)


def ring(count: int, height: float, *, places: bool) -> str:
    """Return cameras in a ring of 4 m around the origin of a z-up world that look at it, in millimetres."""
    tables = {}
    for k in range(count):
        angle = 2.0 * np.pi * k / count + 0.3
        place = np.array([4.0 * np.cos(angle), 4.0 * np.sin(angle), height])
        ahead = np.array([0.0, 0.0, 1.0]) - place
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        turn = np.array([right, np.cross(ahead, right), ahead])
        moved = place if places else -turn @ place
        tables[f"c{k}"] = {
            "K": programs.K,
            "R": turn.tolist(),
            "T": (1e3 * moved).tolist(),
        }
    return json.dumps(tables)


@each("count", [2, 3, 5])
def test_positions_in_place_of_translations_are_recognised(
    tmp_path: Path, count: int
) -> None:
    path = tmp_path / "left.json"
    for height in (0.6, 1.2, 2.5):
        path.write_text(ring(count, height, places=False))
        assert len(read_calibrations(path)) == count
        text = ring(count, height, places=True)
        assert "seem to be the cameras' positions" in refused(tmp_path, text)


def placed(turns: Array, moved: Array) -> list[Calibration]:
    """Return calibrations of rotations (n, 3, 3) and translations (n, 3)."""
    return [
        Calibration("a", SIZE, np.array(programs.K), np.zeros(4), turn, place)
        for turn, place in zip(turns, moved, strict=True)
    ]


def turned_back(turns: Array) -> Array:
    return turns.swapaxes(1, 2)


# Poses that are not camera_from_world with y down: each is a function of rotations,
# translations and positions, words of the message, and by the number of cameras the
# least share of rigs of which it is said.
MISWRITTEN: dict[str, tuple[Callable[..., tuple[Array, Array]], str, dict[int, float]]]
MISWRITTEN = {
    "positions": (
        lambda turns, moved, places: (turns, places),
        "the cameras' positions",
        {2: 0.7, 4: 0.85},
    ),
    "inverse": (
        lambda turns, moved, places: (turned_back(turns), places),
        "invert them",
        {2: 0.3, 4: 0.6},
    ),
    "transposed": (
        lambda turns, moved, places: (turned_back(turns), moved),
        "transpose them",
        {2: 0.25, 4: 0.6},
    ),
    "along -z": (
        lambda turns, moved, places: (OPENGL @ turns, moved @ OPENGL),
        "look along -z with y up",
        {2: 0.8, 4: 0.9},
    ),
    "inverse along -z": (
        lambda turns, moved, places: (turned_back(OPENGL @ turns), places),
        "cameras that look along -z",
        {2: 0.2, 4: 0.6},
    ),
}


def test_of_random_rigs_few_are_mistaken_and_most_places_are_recognised() -> None:
    rng = np.random.default_rng(5)
    for count, most_wrong in ((2, 0.01), (4, 0.002)):
        wrong = 0
        recognised = Counter[str]()
        for _ in range(500):
            angles = rng.uniform(0.0, 2.0 * np.pi, count)
            far = rng.uniform(2.5, 6.0, count)
            tall = rng.uniform(0.4, 3.0, count)
            places = np.column_stack([far * np.cos(angles), far * np.sin(angles), tall])
            ahead = rng.normal(0.0, 0.3, (count, 3)) + [0.0, 0.0, 1.0] - places
            ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
            aside = np.cross(ahead, [0.0, 0.0, 1.0])
            aside /= np.linalg.norm(aside, axis=1, keepdims=True)
            turns = np.stack([aside, np.cross(ahead, aside), ahead], axis=1)
            moved = -np.einsum("nij,nj->ni", turns, places)
            wrong += bool(misreading(placed(turns, moved)))
            for kind, (write, words, _) in MISWRITTEN.items():
                sentence = misreading(placed(*write(turns, moved, places)))
                recognised[kind] += words in sentence
        assert wrong <= most_wrong * 500
        for kind, (_, _, shares) in MISWRITTEN.items():
            assert recognised[kind] >= shares[count] * 500, kind


def test_parallel_cameras_are_not_mistaken_for_places(tmp_path: Path) -> None:
    """Cameras of a stereo rig look in one direction, and the world may be the first of them."""
    tables = {
        name: {"K": programs.K, "R": np.eye(3).tolist(), "T": [moved, 0.0, 0.0]}
        for name, moved in (("a", 0.0), ("b", -0.4))
    }
    path = tmp_path / "stereo.json"
    path.write_text(json.dumps(tables))
    assert len(read_calibrations(path)) == 2
