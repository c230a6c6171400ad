"""Films in the layouts of KTH's actions, HumanEva-I and CMU's database, made here; HumanEva's truth and its error."""

import contextlib
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from footage_figures import SINGLE, TALL, Choice, filmed_scene, footage_report, main
from footage_sets import POINTS, errors_mm, films_in, read_c3d, recording_of, virtual_points
from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.measuring.c3d import write_c3d
from posefit.measuring.centres import PLACES
from posefit.motion import built_in
from posefit.motion.asf import write_asf
from posefit.motion.motion import Motion
from posefit.tracking.drawing import draw_body
from posefit_reproduce.sapso.paper import PAPER
from tests.cases import each

SIZE = (160, 120)
Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # HumanEva's world from ours
STANDS = (  # of each segment, where its origin stands: left is +x, the front +y, up +z, in millimetres
    *(("PEL", (0, 0, 1000)), ("TRX", (0, 0, 1400)), ("HED", (0, 0, 1500))),
    *(("LCL", (200, 0, 1400)), ("LHU", (200, 0, 1100)), ("LRA", (200, 0, 850))),
    *(("RCL", (-200, 0, 1400)), ("RHU", (-200, 0, 1100)), ("RRA", (-200, 0, 850))),
    *(("LFE", (100, 0, 500)), ("LTI", (100, 0, 100)), ("RFE", (-100, 0, 500)), ("RTI", (-100, 0, 100))),
)


def walk(frames: int) -> Motion:
    return built_in.motion("walk", frames=frames, fps=25.0)


def side(motion: Motion, size: tuple[int, int] = SIZE) -> Camera:
    middle = motion.joints.reshape(-1, 3).mean(axis=0)
    return Camera.around(middle, float(motion.poses[0, 0]) + 1.4, 4.0, size)


def write_film(path: Path, motion: Motion, size: tuple[int, int] = SIZE, before: int = 0) -> None:
    """Write a person before a still background, after so many frames without them."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rng, camera, body = np.random.default_rng(0), side(motion, size), Body.of(motion.skeleton)
    plain = cv2.GaussianBlur(rng.uniform(0, 255, (size[1], size[0], 3)).astype(np.uint8), (0, 0), 3)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), motion.fps, size)
    for k in range(-before, len(motion)):
        image = plain.copy()
        if k >= 0:
            draw_body(image, body, camera, motion.poses[k], motion.translations[k])
        writer.write(image)
    writer.release()


def c3d(points: dict[str, Array], scale: float = -1.0, dec: bool = False, prefix: str = "S1:") -> bytes:
    """Return a .c3d file of points (T, 3): its labels alone as parameters, then reals, or integers times a scale."""
    labels = b"".join(f"{prefix}{name}".encode().ljust(8) for name in points)
    body = struct.pack("<bBBB", -1, 2, 8, len(points)) + labels + b"\0"
    records = struct.pack("<bb", 5, -1) + b"POINT" + struct.pack("<hB", 3, 0)
    records += struct.pack("<bb", 6, 1) + b"LABELS" + struct.pack("<h", 2 + len(body)) + body
    blocks = -(-(4 + len(records)) // 512)
    parameters = (struct.pack("<BBBB", 1, 80, blocks, 85 if dec else 84) + records).ljust(512 * blocks, b"\0")
    places = np.stack(list(points.values()), axis=1)
    lost = np.isnan(places).any(axis=2, keepdims=True)
    rows = np.concatenate([np.where(lost, 0.0, places / abs(scale)), np.where(lost, -1.0, 0.0)], axis=2)

    def reals(values: Any) -> bytes:
        stored = np.asarray(values, dtype="<f4") * (4.0 if dec else 1.0)
        words = stored.astype("<f4").view("<u2").reshape(-1, 2)
        return bytes((words[:, ::-1] if dec else words).tobytes())

    header = struct.pack("<BBHHHHH", 2, 80, len(points), 0, 1, len(places), 10) + reals([scale])
    data = reals(rows.ravel()) if scale < 0.0 else rows.round().astype("<i2").tobytes()
    return (header + struct.pack("<HH", 2 + blocks, 0)).ljust(512, b"\0") + parameters + data


def segments(places: dict[str, Array]) -> dict[str, Array]:
    """Return the points of segments at places (T, 3) that all stand upright and face along +y, and two shoulders'."""
    ends = {"O": (0, 0, 0), "P": (0, 0, 100), "A": (0, 100, 0), "L": (-100, 0, 0)}
    points = {segment + end: place + np.array(away) for segment, place in places.items() for end, away in ends.items()}
    for name in "LR":
        points[f"{name}FEP"] = places[f"{name}FE"] + (0.0, 0.0, 450.0)
        points[f"{name}SHO"] = places[f"{name}CL"] + (407.0 if name == "L" else -407.0, 0.0, 0.0)
    return points


def write_humaneva(root: Path, motion: Motion, size: tuple[int, int] = SIZE) -> Path:
    """Write a subject of HumanEva-I, whose motion capture runs at twice the film's rate, and return its folder."""
    subject, camera = root / "S1", side(motion, size)
    write_film(subject / "Image_Data" / "Walking_1_(C1).avi", motion, size)
    joints = 1e3 * motion.joints @ Z_UP.T
    names = "PEL pelvis TRX neck_base HED head_base LCL left_shoulder LHU left_elbow LRA left_wrist RCL right_shoulder "
    names += "RHU right_elbow RRA right_wrist LFE left_knee LTI left_ankle RFE right_knee RTI right_ankle"
    pairs = names.split()
    doubled = np.repeat(joints, 2, axis=0)
    doubled[1:-1:2] = 0.5 * (joints[:-1] + joints[1:])
    places = {s: doubled[:, PLACES.index(place)] for s, place in zip(pairs[::2], pairs[1::2], strict=True)}
    rotation = camera.rotation @ Z_UP.T
    numbers = [*camera.focal, *(camera.centre - 0.5), 0.0, *np.zeros(5), *rotation.ravel(), *(1e3 * camera.translation)]
    files: dict[str, bytes] = {
        "Mocap_Data/Walking_1.c3d": c3d(segments(places)),
        "Mocap_Data/S1.mp": b"$Bodymass = 70\n$LShoulderOffset = 40\n$RShoulderOffset = 40\n",
        "Sync_Data/Walking_1_(C1).ofs": b"3\n5\n2\n",
        "Calibration_Data/C1.cal": "\n".join(f"{value:.9f}" for value in numbers).encode(),
    }
    for name, content in files.items():
        (subject / name).parent.mkdir(exist_ok=True)
        (subject / name).write_bytes(content)
    return subject


def write_kth(root: Path, motion: Motion) -> Path:
    write_film(root / "walking" / "person01_walking_d1_uncomp.avi", motion, before=30)
    (root / "00sequences.txt").write_text(
        f"training: person 11\nperson01_walking_d1\tframes\t31-{30 + len(motion)}, 900-910\n"
    )
    return root


def write_cmu(root: Path, motion: Motion) -> Path:
    write_film(root / "16" / "16_15.avi", motion)
    write_asf(root / "16" / "16.asf", motion.skeleton)
    return root


def stands() -> dict[str, Array]:
    return segments({name: np.tile(np.array(place, dtype=float), (4, 1)) for name, place in STANDS})


def fails(*words: object) -> str:
    result = CliRunner(env={"POSEFIT_CMU": ""}).invoke(main, [*map(str, words)])
    assert (result.exit_code, result.stdout) == (2, ""), result.output
    (line,) = [line for line in result.stderr.splitlines() if "film/s" not in line]
    return line


@each(
    ("write", "name", "activity", "frames"),
    [
        (write_kth, "person01_walking_d1", "walk", (30, 34)),
        (write_humaneva, "S1_Walking_1_C1", "walk", (5, None)),
        (write_cmu, "16_15", None, (None, None)),
    ],
)
def test_the_films_of_each_layout(
    write: Callable[[Path, Motion], Path], name: str, activity: str | None, frames: Any, tmp_path: Path
) -> None:
    write(tmp_path, walk(4))
    (tmp_path / "notes.avi").write_text("no film of these")
    ((film, does),) = films_in(tmp_path).items()
    found = recording_of(film)
    assert (found.name, does, found.frames) == (name, activity, frames)
    assert (found.truth is not None) == (write is write_humaneva)
    assert (found.skeleton is not None) == (write is write_cmu)


@each(
    ("write", "missing", "words"),
    [
        (write_kth, "00sequences.txt", "00sequences.txt: expected a file, got nothing of that name"),
        (write_humaneva, "S1/Calibration_Data/C1.cal", "C1.cal: expected a file, got nothing"),
        (write_humaneva, "S1/Sync_Data/Walking_1_(C1).ofs", "Walking_1_(C1).ofs: expected a file, got nothing"),
        (write_humaneva, "S1/Mocap_Data/S1.mp", "S1.mp: expected a file, got nothing"),
        (write_cmu, "16/16.asf", "16.asf: expected a file, got nothing"),
        (write_cmu, "16/16_15.avi", "expected films of walks or runs such as walking/person01_walking_d1_uncomp.avi"),
        (write_cmu, "", "activity must be walk or run for films that do not say, such as 16_15.avi, got none"),
    ],
)
def test_what_is_missing_is_one_line(
    write: Callable[[Path, Motion], Path], missing: str, words: str, tmp_path: Path
) -> None:
    write(tmp_path, walk(3))
    if missing:
        (tmp_path / missing).unlink()
    activity = ("--activity", "walk") if missing else ()
    assert words in fails(tmp_path, "--out", tmp_path / "out", *activity)
    assert not (tmp_path / "out").exists()


@each(
    ("name", "content", "words"),
    [
        ("Calibration_Data/C1.cal", b"500 500 80 60", "C1.cal: expected 22 numbers, got 4"),
        ("Calibration_Data/C1.cal", b"1 " * 22, "C1.cal: expected focal lengths, centre, skew, distortion"),
        ("Sync_Data/Walking_1_(C1).ofs", b"one two three", "expected 3 numbers, got 0"),
        ("Mocap_Data/S1.mp", b"$Bodymass = 70", "S1.mp: expected LShoulderOffset and RShoulderOffset, got none"),
        ("Mocap_Data/Walking_1.c3d", b"no points", "Walking_1.c3d: expected a .c3d file"),
        ("Mocap_Data/Walking_1.c3d", c3d(stands())[:-300], "expected a .c3d file of at most 500 MB, got one that ends"),
        ("Mocap_Data/Walking_1.c3d", c3d({"LASI": np.zeros((2, 3))}), "expected virtual points such as PELO, got none"),
    ],
)
def test_what_is_no_file_of_humaneva_is_one_line(name: str, content: bytes, words: str, tmp_path: Path) -> None:
    (write_humaneva(tmp_path, walk(3)) / name).write_bytes(content)
    assert words in fails(tmp_path)


@each(("scale", "dec"), [(-1.0, False), (-1.0, True), (0.1, False), (0.1, True)])
def test_a_c3d_is_read_as_reals_and_integers_of_both_byte_orders(scale: float, dec: bool, tmp_path: Path) -> None:
    points = {
        "PELO": np.array([[1.5, -20.3, 300.0], [np.nan] * 3]),
        "C7": np.array([[0.0, 1.0, 2.0], [-3.0, 4.0, 5.0]]),
    }
    (tmp_path / "points.c3d").write_bytes(c3d(points, scale, dec))
    read = read_c3d(tmp_path / "points.c3d")
    assert list(read) == ["PELO", "C7"]
    for name, places in points.items():
        np.testing.assert_allclose(read[name], places, atol=1e-5)


def test_a_c3d_that_posefit_wrote_reads_back(tmp_path: Path) -> None:
    motion = walk(5)
    write_c3d(tmp_path / "walk.c3d", motion, {2})
    read = np.stack([*read_c3d(tmp_path / "walk.c3d").values()], axis=1) / 1e3
    np.testing.assert_allclose(np.delete(read, 2, axis=0), np.delete(motion.joints, 2, axis=0), atol=1e-6)
    assert np.isnan(read[2]).all()


def test_a_damaged_c3d_is_an_input_error_or_points(tmp_path: Path) -> None:
    whole, rng = c3d(stands()), np.random.default_rng(0)
    for _ in range(150):
        content = bytearray(whole[: rng.integers(0, len(whole) + 1)])
        for at in rng.integers(0, 1200, 4):
            if at < len(content):
                content[at] = rng.integers(0, 256)
        (tmp_path / "damaged.c3d").write_bytes(bytes(content))
        with contextlib.suppress(InputError):
            read_c3d(tmp_path / "damaged.c3d")


def test_virtual_points_of_a_person_who_stands() -> None:
    # By hand. The angles are those of triangles 3, 4, 5: half of the width 1214 / 2 - 7 = 600 to the torso's 400, and
    # half of the offset 450 to the upper arm's 300.
    points = virtual_points(stands(), np.array([450.0, 450.0]))[0]
    expected = {
        "pelvis": [(0, -50, 1000)],
        "neck_base": [(0, -50 - 240, 1000 + 320), (0, 0, 1400)],
        "head_top": [(0, 0, 1716.103)],
        "left_elbow": [(200, -180, 1160)] * 2,
        "left_wrist": [(200, -180 + 150, 1160 - 200)],
        "right_hip": [(-100, 0, 950)],
        "right_knee": [(-100, 0, 500)],
        "left_ankle": [(100, 0, 100)],
        "right_shoulder": [(-200, 0, 1400)],
    }
    for name, places in expected.items():
        rows = [points[k] for k, point in enumerate(POINTS) if point == name]
        np.testing.assert_allclose(rows, places, atol=1e-9, err_msg=name)


def test_frames_without_a_marker_have_no_truth() -> None:
    points = stands() | {"LTOE": np.ones((4, 3)), "other": np.zeros((4, 3))}
    points["LTOE"][2] = 0.0
    lost = np.isnan(virtual_points(points, np.array([40.0, 40.0]))).any(axis=(1, 2))
    assert lost.tolist() == [False, False, True, False]


def test_the_error_is_the_mean_distance_of_fifteen_markers() -> None:
    # Sigal, Balan and Black, IJCV 87, 2010: the mean over 15 markers of their distances
    joints = walk(3).joints
    truth = joints[:, [PLACES.index(point) for point in POINTS]]
    np.testing.assert_allclose(errors_mm(truth, joints), 0.0, atol=1e-9)
    np.testing.assert_allclose(errors_mm(truth, joints + [0.003, 0.0, 0.004]), 5.0)
    np.testing.assert_allclose(errors_mm(truth, joints + [0.003, 0.0, 0.004], relative=True), 0.0, atol=1e-9)
    moved = truth.copy()
    moved[0, POINTS.index("head_top"), 1] += 0.030  # one marker of 15
    moved[1, POINTS.index("left_elbow"), 1] += 0.030  # half of one
    moved[2, 0] = np.nan
    np.testing.assert_allclose(errors_mm(moved, joints), [2.0, 1.0, np.nan])


def test_the_truth_of_a_film_is_where_its_camera_sees_the_person(tmp_path: Path) -> None:
    motion = walk(40)
    write_humaneva(tmp_path, motion)
    found = recording_of(*films_in(tmp_path))
    scene, first = filmed_scene(found, Choice(folder=tmp_path))
    assert (first, scene.count) == (5, 35)
    assert found.truth is not None
    truth = found.truth(first, first + scene.count)
    for name in ("left_knee", "right_ankle", "left_shoulder"):
        place = motion.joints[first:, PLACES.index(name)]
        np.testing.assert_allclose(truth[:, POINTS.index(name)], place, atol=1e-6)
        pixels = side(motion).project(place)[0]
        np.testing.assert_allclose(scene.cameras[0].project(truth[:, POINTS.index(name)])[0], pixels, atol=1e-4)
    assert np.isnan(found.truth(39, 41)).any(axis=(1, 2)).tolist() == [False, True]


@pytest.mark.slow
def test_a_folder_gives_figures_8_and_10(tmp_path: Path) -> None:
    write_humaneva(tmp_path, walk(40))
    report = footage_report(Choice(folder=tmp_path, iterations=20), tmp_path / "out", lambda films, _: films)
    ((name, film),) = report["films"].items()
    assert set(film["estimates"]) == {SINGLE, *PAPER}
    assert film["frames"] == [5, 40]
    for row in film["estimates"].values():
        assert row["iou"] > 0.5
        assert row["relative_error_mm"] < row["error_mm"] < 1000.0
    for figure, rows in (("figure-8", 2), ("figure-10", 4)):
        image = cv2.imread(str(tmp_path / "out" / f"{figure}-{name}.png"))
        assert image is not None
        assert image.shape == (rows * TALL, 6 * TALL, 3)
