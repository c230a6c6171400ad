"""Which library poses fit a frame, their clusters and spreads, with poses whose twins are known; and `posefit ambiguity`."""

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from posefit.ambiguity.estimate import (
    RIGHT_ANGLE,
    YAWS,
    States,
    ambiguity_of,
    body_of,
    camera_about,
    clusters_of,
    library_of,
    problem_of,
    spaced_frames,
    spreads_mm,
    states_within,
    turned_to,
)
from posefit.arrays import Array
from posefit.fitting.problem import PoseProblem
from posefit.fitting.shape import NAMES
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES, JOINTS, angle_index
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit.uncertainty.modes import Posterior, poses_apart
from tests.cases import each
from tests.commands import error_of, printed, run

SKELETON = built_in.average_skeleton()  # whose sides are equal
WALK = built_in.motion("walk")
BODY = Body.of(WALK.skeleton)
PLACE = np.array([0.3, 0.9, -0.2])
FAR = 300.0  # metres: from there depth does not show
STRIDE = np.zeros(ANGLES)  # faces z: the left leg in front, the right one behind, the left arm lowered
for _name, _axis, _angle in (("lfemur", 0, -0.5), ("rfemur", 0, 0.5), ("lhumerus", 2, 1.0)):
    STRIDE[angle_index(JOINTS.index(_name)) + _axis] = _angle
TWINS = np.array([STRIDE, mirrored_poses(SKELETON, STRIDE[None])[0]])
STRIDES = Motion("stride", SKELETON, np.array([STRIDE, np.zeros(ANGLES)]), np.zeros((2, 3)), 30.0)
LIBRARY = library_of([STRIDES], SKELETON)[0]


def moment(pose: Array, *azimuths: float, known: bool = True, side: int = 96) -> PoseProblem:
    """Return what cameras four metres away show of a pose."""
    cameras = [Camera.around(PLACE, azimuth, 4.0, (side, side)) for azimuth in azimuths or (0.7,)]
    silhouettes = [Silhouette.of(project(BODY, camera, pose, PLACE)) for camera in cameras]
    return problem_of(BODY, cameras, silhouettes, PLACE if known else PLACE + [0.2, 0.1, 0.3], known)


def stride_from(*azimuths: float) -> PoseProblem:
    """Return what cameras far away show of the stride."""
    cameras = [Camera.around(PLACE, azimuth, FAR, (120, 120), 2.2 / FAR) for azimuth in azimuths]
    body = Body.of(SKELETON)
    silhouettes = [Silhouette.of(project(body, camera, STRIDE, PLACE)) for camera in cameras]
    return problem_of(body, cameras, silhouettes, PLACE, True)


def all_within(problem: PoseProblem, poses: Array, within: float) -> set[tuple[int, int]]:
    """Return the rows and yaws that cost at most `within` more than the least, all compared at full size."""
    turned = [turned_to(poses, np.full(len(poses), yaw)) for yaw in range(YAWS)]
    costs = np.array([problem.cost(some, problem.placed(some)) for some in turned])
    return {(int(row), int(yaw)) for yaw, row in np.argwhere(costs <= costs.min() + within)}


@each("known", [True, False])
@each("azimuths", [(0.7,), (0.0, 1.2)])
def test_no_pose_that_fits_is_missed(known: bool, azimuths: tuple[float, ...]) -> None:
    library, _ = library_of([built_in.motion("march"), built_in.motion("run")], WALK.skeleton)
    frame = moment(WALK.poses[17], *azimuths, known=known, side=240)
    for within in (0.0, 1.0, 5.0):
        states = states_within(frame, library, within, 2.0)
        yaws = np.rint(np.mod(states.posterior.poses[:, 0], 2.0 * np.pi) * YAWS / (2.0 * np.pi)).astype(int) % YAWS
        assert set(zip(states.rows.tolist(), yaws.tolist(), strict=True)) == all_within(frame, library, within)


def test_the_true_pose_costs_nothing_and_stands_in_its_place() -> None:
    pose = turned_to(WALK.poses[17:18], np.array([13]))[0]
    states = states_within(moment(pose), WALK.poses, 0.0, 2.0)
    assert (states.rows.tolist(), states.costs.tolist()) == ([17], [0.0])
    np.testing.assert_allclose(states.posterior.poses[0], pose)
    np.testing.assert_allclose(states.posterior.translations[0], PLACE)


def test_library_poses_are_two_centimetres_apart_whatever_their_yaw_and_then_mirrored() -> None:
    still = np.zeros((4, ANGLES))
    still[:, 0] = [0.0, 1.0, 2.0, 3.0]
    assert spaced_frames(WALK.skeleton, still).tolist() == [0]
    rows = spaced_frames(WALK.skeleton, WALK.poses)
    joints = WALK.skeleton.joints(turned_to(WALK.poses, np.zeros(len(WALK.poses), dtype=int)))
    steps = np.sqrt(((joints[rows[1:]] - joints[rows[:-1]]) ** 2).sum(axis=2).mean(axis=1))
    assert rows[0] == 0
    assert steps.min() > 0.02
    other = Motion("other", WALK.skeleton, WALK.poses[:1], WALK.translations[:1], 30.0)
    poses, origins = library_of([WALK, other], WALK.skeleton)
    half = len(poses) // 2
    np.testing.assert_array_equal(poses[half:], mirrored_poses(WALK.skeleton, poses[:half]))
    assert origins[half - 1 : half + 1] == [("other", 0, False), ("walk", 0, True)]


def test_a_stride_and_its_mirrored_twin_have_equal_weights_in_a_side_view() -> None:
    frame = stride_from(0.5 * np.pi)
    states = states_within(frame, LIBRARY, 1.0, 2.0)
    clusters = clusters_of(frame, states)
    assert [cluster.weight for cluster in clusters] == pytest.approx([0.5, 0.5], abs=0.02)
    assert [cluster.image for cluster in clusters] == ["", "mirrored"]
    apart = 1e3 * poses_apart(SKELETON, TWINS[:1], TWINS[1:])[0, 0]
    assert [cluster.away_mm for cluster in clusters] == pytest.approx([0.0, apart], abs=1.0)
    assert {int(states.rows[cluster.best]) for cluster in clusters} == {0, 2}


def test_half_way_between_front_and_side_the_twin_is_the_reflected_one() -> None:
    frame = stride_from(0.25 * np.pi)
    states = states_within(frame, LIBRARY, 1.0, 2.0)
    clusters = clusters_of(frame, states)
    assert [cluster.image for cluster in clusters] == ["", "reflected"]
    # the one faces z, 45 degrees to the camera's left, the other 2 (45) + 180 - 0 = 270 degrees
    yaws = sorted(round(float(np.degrees(states.posterior.poses[cluster.best, 0]))) for cluster in clusters)
    assert yaws == [-90, 0]


def test_a_second_camera_at_right_angles_distinguishes_twins() -> None:
    spreads = []
    for frame in (stride_from(0.5 * np.pi), stride_from(0.5 * np.pi, np.pi)):
        states = states_within(frame, LIBRARY, 1.0, 2.0)
        spreads.append(spreads_mm(SKELETON, states.posterior.poses, states.posterior.weights)[1])
    assert spreads[0] > 100.0
    assert spreads[1] < 20.0


def test_the_spread_is_the_root_mean_square_distance_from_the_weighted_mean() -> None:
    apart = 1e3 * np.linalg.norm(np.subtract(*SKELETON.joints(TWINS)), axis=1)
    # at equal weights both are a half from the mean; at 1 to 3 they are 3/4 and 1/4: 1/4 (9/16) + 3/4 (1/16) = 3/16
    for weights, share in (([0.5, 0.5], 0.5), ([1.0, 3.0], np.sqrt(3.0) / 4.0)):
        spreads, of_body = spreads_mm(SKELETON, TWINS, np.array(weights))
        np.testing.assert_allclose(spreads, share * apart, atol=1e-9)
        assert of_body == pytest.approx(share * np.sqrt((apart**2).mean()))


def test_of_very_many_poses_a_sample_finds_the_clusters() -> None:
    posterior = Posterior(np.tile(TWINS, (2500, 1)), np.tile(PLACE, (5000, 1)), np.ones(5000))
    first, second = clusters_of(stride_from(0.5 * np.pi), States(np.arange(5000), posterior, np.zeros(5000)))
    assert (len(first.members), len(second.members)) == (2500, 2500)
    assert first.weight == pytest.approx(0.5)
    assert first.spread_mm == pytest.approx(0.0, abs=1e-6)


def test_a_turned_camera_shows_the_same_place_from_the_side() -> None:
    camera, place = Camera.around(np.array([0.2, 1.1, 0.4]), 0.4, 5.0, (100, 80)), np.array([0.5, 0.8, 0.1])
    turned = camera_about(camera, place, RIGHT_ANGLE)
    for before, after in zip(camera.project(place), turned.project(place), strict=True):
        np.testing.assert_allclose(before, after)
    origin, position = camera.position - place, turned.position - place
    assert origin[[0, 2]] @ position[[0, 2]] == pytest.approx(0.0, abs=1e-12)
    assert position[1] == pytest.approx(origin[1])


def refused(tmp_path: Path, *words: object) -> str:
    """Return the line that is printed for a mistake, after which nothing is written."""
    line = error_of("ambiguity", *words, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    return line


QUICK = ("--train", "walk-a", "--size", "120x90")


def masks(folder: Path, azimuth: float) -> Camera:
    """Write a mask of a walk to a folder; return the camera."""
    motion = built_in.motion("walk")
    camera = Camera.around(motion.translations[3], azimuth, 4.0, (120, 90))
    mask = project(Body.of(motion.skeleton), camera, motion.poses[3], motion.translations[3])
    folder.mkdir()
    cv2.imwrite(str(folder / "0.png"), mask.astype(np.uint8) * 255)
    return camera


@each(
    ("words", "message"),
    [
        (["walk", "--frame", 60, *QUICK], "frame must lie in 0 to 59 of walk, got 60"),
        (["walk", "--frame", -1, *QUICK], "frame must be 0 or more, got -1"),
        (["walk", "--within", -0.5, *QUICK], "within must be at least 0, got -0.5"),
        (["walk", "--within", "nan", *QUICK], "within must be a finite number, got nan"),
        (
            ["walk", "--within", 1e6, "--train", "library:16", "--size", "64x48"],
            "within must be so little that at most 20,000 poses and yaws are left, got 1e+06, which ",
        ),
        (["walk", "--temperature", 0, *QUICK], "temperature must be above 0, got 0"),
        (["walk", "--translation", "searched", *QUICK], "translation must be one of known, aligned, got 'searched'"),
        (["walk", "--height", 1.8, *QUICK], "height must be given for footage only, got 1.8 for a motion"),
        (["walk", "--build", "x", *QUICK], "build must be given for footage only, got 'x' for a motion"),
    ],
)
def test_a_mistake_is_one_line_and_leaves_nothing(words: list[object], message: str, tmp_path: Path) -> None:
    assert refused(tmp_path, *words).startswith(f"posefit: {message}")
    assert list(tmp_path.iterdir()) == []


def test_a_frame_without_the_person_is_a_mistake() -> None:
    walk = built_in.motion("walk")
    places = np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    away_and_back = Motion("hopping", walk.skeleton, walk.poses[:3], places, 30.0)
    settings: dict[str, Any] = {"train": ["walk-a"], "camera": [Camera.around(np.zeros(3), 0.0, 4.0, (64, 48))]}
    with pytest.raises(ValueError, match=r"^frame must show the person, got an empty mask in frame 1 of hopping$"):
        ambiguity_of(away_and_back, frame=1, **settings)
    assert ambiguity_of(away_and_back, frame=2, **settings).clusters


def test_a_folder_is_written_and_a_table_printed(tmp_path: Path) -> None:
    result = run("ambiguity", "walk", "--frame", 5, "--within", 3, "--out", tmp_path / "out", *QUICK)
    assert result.exit_code == 0, result.stderr
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"ambiguity.json", "ambiguity.png"}
    assert "weight spread mm from first mm from truth mm yaw deg      view deg  image      example" in result.stdout
    assert "walk-a frame " in result.stdout
    assert "by two cameras, the second at right angles: " in result.stdout
    picture = cv2.imread(str(tmp_path / "out" / "ambiguity.png"))
    assert picture.shape[0] > 700
    assert picture.shape[1] % 260 == 0
    summary = json.loads((tmp_path / "out" / "ambiguity.json").read_text("utf-8"))
    assert (summary["source"], summary["frame"], summary["within"]) == ("walk", 5, 3.0)
    modes, floor = summary["modes"], summary["floor"]
    assert sum(mode["weight"] for mode in modes) == pytest.approx(1.0)
    assert sum(mode["poses"] for mode in modes) == summary["similar"] == floor[0]["similar"]
    assert (modes[0]["away_mm"], modes[0]["clip"]) == (0.0, "walk-a")
    assert [views["views"] for views in floor] == ["one camera", "two cameras, the second at right angles"]
    assert list(floor[0]["joints_mm"]) == list(JOINTS)


def test_masks_have_no_truth_and_several_cameras_are_compared_with_each(tmp_path: Path) -> None:
    words: list[object] = []
    for k, azimuth in enumerate((0.3, 1.9)):
        camera = masks(tmp_path / f"{k}", azimuth)
        (tmp_path / f"{k}.json").write_text(camera.to_json(), "utf-8")
        words += [tmp_path / f"{k}", "--camera", tmp_path / f"{k}.json"]
    one = printed("ambiguity", tmp_path / "0", "--train", "walk-a")
    assert one["translation"] == "aligned"
    assert "truth_mm" not in one["modes"][0]
    assert [views["views"] for views in one["floor"]] == ["one camera"]
    two = printed("ambiguity", *words, "--train", "walk-a", "--within", 3)
    assert two["views"] == 2
    assert [views["views"] for views in two["floor"]] == ["both cameras", "camera 1", "camera 2"]
    assert min(views["least_cost"] for views in two["floor"]) < 10.0


AVERAGE = Body.of(built_in.average_skeleton())
FACTORS = dict.fromkeys(NAMES, 1.0)


def build(stature: object = 1.8, **factors: Any) -> str:
    """Return the summary of a track with a fitted build."""
    return json.dumps({"body": {"stature": stature, "factors": FACTORS | factors}})


def test_a_build_has_its_stature_and_girths(tmp_path: Path) -> None:
    for girth in (1.0, 2.0):
        summary = build(**{name: girth for name in NAMES if name.endswith("girth")})
        (tmp_path / "summary.json").write_text(summary, encoding="utf-8")
        body = body_of(tmp_path, AVERAGE)
        assert body.stature == pytest.approx(1.8)
        ratio = body.skeleton.lengths / AVERAGE.skeleton.lengths
        assert np.ptp(ratio) == pytest.approx(0.0)
        assert girth > 1.0 or ratio[0] == pytest.approx(1.8 / AVERAGE.stature)
        np.testing.assert_allclose(body.radii / AVERAGE.radii, girth * ratio[0])


@each(
    ("text", "message"),
    [
        ('{"body": null}', "expected the build of a person, got none: it was not fitted"),
        ("[]", "expected a JSON object, got "),
        ("{}", "expected body in it, got none"),
        ('{"body": {"stature": 1.8, "factors": {}}}', "expected scale in it, got none"),
        ("{", "expected a JSON object, got "),
        (build(stature=18.0), "stature must lie in 0.3 to 2.8, got 18"),
        (build(stature="tall"), "stature must be a finite number, got 'tall'"),
        (build(scale=0.0), "scale must lie in 0.1 to 10, got 0"),
    ],
)
def test_a_summary_without_a_possible_build_is_refused(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"expected the folder of a track with its summary.json, got none$"):
        body_of(tmp_path, AVERAGE)
    (tmp_path / "summary.json").write_text(text, encoding="utf-8")
    with pytest.raises(ValueError) as refusal:
        body_of(tmp_path, AVERAGE)
    assert str(refusal.value).startswith(f"{tmp_path / 'summary.json'}: {message}")
