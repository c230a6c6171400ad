"""`posefit ambiguity`: what it prints and writes, and one line for every mistake."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result

from posefit.ambiguity.estimate import ambiguity_of
from posefit.cli import main
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.silhouette.cost import project
from tests.cases import each

QUICK = ("--train", "walk-a", "--size", "120x90")


def run(*words: object) -> Result:
    return CliRunner().invoke(main, ["ambiguity", *map(str, words)])


def masks(folder: Path) -> Path:
    """Return a folder of two masks of a walk, the second of which shows nobody."""
    motion = built_in.motion("walk")
    camera = Camera.around(motion.translations[3], 0.8, 4.0, (120, 90))
    mask = project(Body.of(motion.skeleton), camera, motion.poses[3], motion.translations[3])
    folder.mkdir()
    cv2.imwrite(str(folder / "0.png"), mask.astype(np.uint8) * 255)
    cv2.imwrite(str(folder / "1.png"), np.zeros((90, 120), np.uint8))
    return folder


MISTAKES: list[tuple[list[object], str]] = [
    (["--frame", 60], "frame must lie in 0 to 59 of walk, got 60"),
    (["--frame", -1], "frame must be 0 or more, got -1"),
    (["--frame", "x"], "Invalid value for '--frame': 'x' is not a valid integer."),
    (["--within", -0.5], "within must be 0 or more, got -0.5"),
    (["--within", "nan"], "within must be a finite number, got nan"),
    (["--within", "inf"], "within must be a finite number, got inf"),
    (["--within", 1e6], "within must be so little that at most 20,000 poses and yaws are left, got 1e+06, which "),
    (["--temperature", 0], "temperature must be above 0, got 0"),
    (["--temperature", "nan"], "temperature must be a finite number, got nan"),
    (["--threads", 0], "threads must be at least 1, got 0"),
    (["--translation", "searched"], "translation must be known or aligned, got searched"),
    (["--height", 1.8], "height must be given for footage only, got 1.8 for a motion"),
    (["--roi", "1,2,3,4"], "roi must be given for video only, got (1, 2, 3, 4) for a motion"),
    (["--train", "nowhere"], "motion must be a file, a folder, a recorded one"),
    (["--train", "walk"], "train must not contain the source itself, got walk"),
    (["--without-subject", "16"], "without_subject must be given with --train library, got walk-a"),
    (["walk"], "source must be one motion, or views of one person, got 2 motions"),
    (["--view-degrees", "nan"], "view_degrees must be a finite number, got nan"),
]


def test_a_mistake_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    for words, message in MISTAKES:
        train = ("--size", "64x48") if "--train" in words else ("--train", "walk-a", "--size", "64x48")
        if words == ["--within", 1e6]:
            train = ("--train", "library:16", "--size", "64x48")
        result = run("walk", *train, *words, "--out", tmp_path / "out")
        assert (result.exit_code, result.stdout) == (2, "")
        assert len(result.stderr.splitlines()) == 1
        assert result.stderr.startswith(f"posefit: {message}")
        assert list(tmp_path.iterdir()) == []


@each(
    ("source", "train", "said"),
    [
        ("16_15", ["--train", "library:16", "--without-subject", "16"], "the library must keep at least one person"),
        ("nothing.npz", [], "nothing.npz: expected a file, got nothing of that name"),
        ("nothing.bvh", [], "nothing.bvh: expected a file, got nothing of that name"),
    ],
)
def test_a_library_of_nobody_and_a_source_that_is_not_there_are_mistakes(
    source: str, train: list[str], said: str, tmp_path: Path
) -> None:
    result = run(source, *train, "--out", tmp_path / "out")
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith(f"posefit: {said}")
    assert list(tmp_path.iterdir()) == []


@each(
    ("frame", "said"),
    [
        (1, "1.png: expected a mask with a person before a background, got an empty one"),
        (2, "frames must choose some of the 2 frames, got 2:3"),
    ],
)
def test_a_mask_that_shows_nobody_is_a_mistake(frame: int, said: str, tmp_path: Path) -> None:
    result = run(masks(tmp_path / "seen"), "--train", "walk-a", "--frame", frame, "--out", tmp_path / "out")
    assert (result.exit_code, result.stdout) == (2, "")
    assert said in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_camera_that_does_not_see_the_person_in_this_frame_is_a_mistake() -> None:
    walk = built_in.motion("walk")
    away = walk.translations[:3] * 0.0 + [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    there_and_back = Motion("hopping", walk.skeleton, walk.poses[:3], away, 30.0)
    viewing = {"camera": [Camera.around(np.zeros(3), 0.0, 4.0, (64, 48))]}
    with pytest.raises(ValueError, match=r"^frame must show the person, got an empty mask in frame 1 of hopping$"):
        ambiguity_of(there_and_back, frame=1, train=["walk-a"], **viewing)
    assert ambiguity_of(there_and_back, frame=2, train=["walk-a"], **viewing).clusters


def test_a_frame_that_shows_too_little_of_the_person_is_a_mistake(tmp_path: Path) -> None:
    mask = cv2.imread(str(masks(tmp_path / "seen") / "0.png"), cv2.IMREAD_GRAYSCALE) > 0
    np.savez(
        tmp_path / "masks.npz",
        masks=np.stack([mask, mask]),
        valid=np.ones((2, *mask.shape), bool),
        usable=np.array([True, False]),
        fps=np.array(30.0),
    )
    result = run(tmp_path / "masks.npz", "--train", "walk-a", "--frame", 1, "--out", tmp_path / "out")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "expected a frame that is usable, got none" in result.stderr
    assert not (tmp_path / "out").exists()
    assert run(tmp_path / "masks.npz", "--train", "walk-a", "--frame", 0).exit_code == 0


def test_a_folder_that_exists_is_a_mistake_before_anything_is_looked_at(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    result = run("walk", "--frame", 999, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert result.stderr.endswith("out: expected a new name to write to, got one that exists\n")


def test_a_folder_of_both_files_is_written_and_a_short_table_printed(tmp_path: Path) -> None:
    result = run("walk", "--frame", 5, "--within", 3, "--out", tmp_path / "out", *QUICK)
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


def test_json_says_everything_and_weights_sum_to_one() -> None:
    result = run("walk", "--frame", 5, "--within", 3, "--json", *QUICK)
    assert result.exit_code == 0, result.stderr
    summary = json.loads(result.stdout)
    assert sum(one["weight"] for one in summary["modes"]) == pytest.approx(1.0)
    assert sum(one["poses"] for one in summary["modes"]) == summary["similar"] == summary["floor"][0]["similar"]
    assert summary["modes"][0]["away_mm"] == 0.0
    assert summary["modes"][0]["clip"] == "walk-a"
    assert [one["views"] for one in summary["floor"]] == ["one camera", "two cameras, the second at right angles"]
    joints = summary["floor"][0]["joints_mm"]
    assert list(joints) == list(JOINTS)
    assert joints["root"] == pytest.approx(0.0)  # all roots are at one point
    mean = np.sqrt(np.mean(np.square(list(joints.values()))))
    assert summary["floor"][0]["spread_mm"] == pytest.approx(mean)


def test_what_the_same_person_does_in_another_clip_is_near_the_truth() -> None:
    found = ambiguity_of("walk", frame=5, train=["walk-a", "walk-b"], size=(160, 120))
    assert found.truth_mm is not None
    assert min(found.truth_mm) < 60.0


def test_several_cameras_are_held_against_each_of_them() -> None:
    viewing = {"view_degrees": (0.0, 90.0), "size": (120, 90)}
    found = ambiguity_of("walk", frame=5, within=2.0, train=["walk-a"], **viewing)
    assert [floor.views for floor in found.floors] == ["both cameras", "camera 1", "camera 2"]


def test_of_masks_poses_are_aligned_and_nothing_is_told_of_the_truth(tmp_path: Path) -> None:
    result = run(masks(tmp_path / "seen"), "--train", "walk-a", "--json")
    assert result.exit_code == 0, result.stderr
    summary = json.loads(result.stdout)
    assert summary["translation"] == "aligned"
    assert "truth_mm" not in summary["modes"][0]
    assert [one["views"] for one in summary["floor"]] == ["one camera"]


def test_masks_of_two_calibrated_cameras_are_seen_together_and_alone(tmp_path: Path) -> None:
    walk = built_in.motion("walk")
    words: list[object] = []
    for k, azimuth in enumerate((0.3, 1.9)):
        camera = Camera.around(walk.translations[3], azimuth, 4.0, (120, 90))
        mask = project(Body.of(walk.skeleton), camera, walk.poses[3], walk.translations[3])
        (tmp_path / f"{k}").mkdir()
        cv2.imwrite(str(tmp_path / f"{k}" / "0.png"), mask.astype(np.uint8) * 255)
        (tmp_path / f"{k}.json").write_text(camera.to_json(), "utf-8")
        words += [tmp_path / f"{k}", "--camera", tmp_path / f"{k}.json"]
    result = run(*words, "--train", "walk-a", "--within", 3, "--json")
    assert result.exit_code == 0, result.stderr
    summary = json.loads(result.stdout)
    assert summary["views"] == 2
    assert [one["views"] for one in summary["floor"]] == ["both cameras", "camera 1", "camera 2"]
    assert min(one["least_cost"] for one in summary["floor"]) < 10.0


def test_the_clip_itself_is_left_out_of_the_library() -> None:
    found = ambiguity_of("16_15", frame=5, train=["library:16"], size=(120, 90))
    assert "16_15" not in found.library.names
    assert {name[:3] for name in found.library.names} == {"16_"}


def test_the_result_is_the_same_with_any_number_of_threads() -> None:
    viewing = {"size": (160, 120)}
    one, two = (ambiguity_of("walk", frame=9, train=["walk-a"], **viewing, threads=k) for k in (1, 2))
    np.testing.assert_array_equal(one.states.costs, two.states.costs)
    assert [cluster.weight for cluster in one.clusters] == [cluster.weight for cluster in two.clusters]
