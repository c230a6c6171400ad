"""Footage made from the truth: how people move in it, what is seen of them, and what a track of it is worth."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result

from posefit.cli import main
from posefit.footage.extract import extract
from posefit.footage.segmentation import Extraction
from posefit.footage.video import Video, VideoWriter
from posefit.geometry.calibration import read_calibrations, upright
from posefit.geometry.camera import Camera
from posefit.motion.steadiness import acceleration
from posefit.silhouette.cost import project
from posefit.tracking.measures import Measures
from posefit.tracking.run import Track
from posefit_experiments.composites import experiment, ways
from posefit_experiments.composites.clothes import TROUSERS, outfit
from posefit_experiments.composites.experiment import Shot, asked, extraction_named
from posefit_experiments.composites.figures import extraction_figures, steadiness, track_figures, uncut
from posefit_experiments.composites.filming import BEFORE, film
from posefit_experiments.composites.plates import Plate, check_video, plate
from posefit_experiments.composites.rendering import Posed, composited, true_masks
from posefit_experiments.composites.situations import ALWAYS, SHOWS, SIZE, Situation, situation
from posefit_experiments.composites.tables import by_presence, composites_lines

VIDEO = Path(__file__).parents[3] / "shared" / "data" / "video" / "sports2d_walk" / "demo.mp4"
SMALL = (160, 120)


def empty(size: tuple[int, int] = SMALL) -> Plate:
    """Return a place where nothing lives, of blocks of many greens."""
    rng = np.random.default_rng(0)
    blocks = rng.uniform((60, 110, 70), (90, 150, 100), (size[1] // 10, size[0] // 10, 3)).astype(np.float32)
    still = cv2.resize(blocks, size, interpolation=cv2.INTER_NEAREST)
    return Plate(still, np.zeros((2, size[1], size[0], 3), dtype=np.int8))


def posed(actor: ways.Actor, k: int, behind: Plate) -> Posed:
    worn = outfit(actor.outfit, behind.still.astype(np.uint8))
    return Posed(actor.body, actor.motion.poses[k], actor.motion.translations[k], worn)


def brief(frames: int = 8) -> Situation:
    """Return a few frames of somebody who goes past one small camera, and is seen whole."""
    made = situation("through", 1, 0)
    middle = len(made) // 2
    actor = made.actors[0]
    here = replace(actor, motion=actor.motion.frames(middle, middle + frames), present=np.ones(frames, dtype=bool))
    camera = Camera.around(np.array([0.0, 0.95, 0.0]), 0.0, 8.0, SMALL, np.radians(36.0))
    return Situation("through", 1, [here], [camera])


def true_track(made: Situation) -> Track:
    """Return the track that is the truth itself."""
    motion = made.actors[0].motion
    told = {"iou": 1.0, "cost": 0.0, "held_frames": 0, "seconds_per_frame": 0.0, "cpu_seconds_per_frame": None}
    measures = Measures(**told, evaluations=1, evaluations_per_second=1.0)  # type: ignore[arg-type]
    return Track(motion, None, measures, [{"usable": 1.0, "lost": 0.1, "unknown_sides": 1.0}] * len(motion), {}, [])


def run(*words: object) -> Result:
    return CliRunner().invoke(main, ["reproduce", "composites", *map(str, words)])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("no.mp4",), "no.mp4: expected a video file, got nothing of that name"),
        (("no.mp4", "--situation", "flies"), "situation must be one of through, again, back, two, to and fro"),
        (("no.mp4", "--views", "3"), "views must be one of 1, 2, 4, got 3"),
        (("no.mp4", "--seeds", "0"), "seeds must be at least 1, got 0"),
        (("no.mp4", "--extraction", "magic"), "magic"),
        (("no.mp4", "--extraction", ""), "extraction must name a segmenter such as mixture, got ''"),
        (("no.mp4", "--extraction", "mixture soft"), "must be SETTING=VALUE such as population_size=20, got 'soft'"),
        (
            ("no.mp4", "--extraction", "mixture softness=1"),
            "a setting of mixture must be one of history, threshold, got 'softness'",
        ),
    ],
)
def test_a_mistake_is_one_line_and_status_2(words: tuple[str, ...], said: str) -> None:
    result = run(*words)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("posefit: ")
    assert said in line


def test_another_video_than_the_demonstration_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mine.mp4"
    with VideoWriter(path, 30.0, (64, 48)) as writer:
        for _ in range(3):
            writer.write(np.zeros((48, 64, 3), dtype=np.uint8))
    with pytest.raises(ValueError, match="Sports2D, 1768x994 pixels and 230 frames, got 64x48"):
        check_video(str(path))


def test_a_folder_for_pictures_that_cannot_be_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    path.touch()
    with pytest.raises(ValueError, match="expected a folder for pictures, got"):
        experiment._check_folder(path)


def test_what_is_asked_for_twice_is_a_row_once() -> None:
    assert asked(["stands", "stands"], [1, 1], ["mixture", "mixture"], 1, False) == [Shot("stands", 1, "mixture", 0)]


def test_rows_are_written_as_they_come_and_not_measured_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = tmp_path / "rows.jsonl"
    kept = {"situation": "stands", "views": 1, "extraction": "mixture", "seed": 0, "refused": "nobody moves"}
    rows.write_text(f"{json.dumps(kept)}\n")
    new = {"situation": "through", "views": 1, "extraction": "mixture", "seed": 0, "mask_iou": 0.9}

    def each(jobs, workers, progress):  # type: ignore[no-untyped-def]
        assert list(jobs) == [Shot("through", 1, "mixture", 0)]
        return dict(progress(iter([(next(iter(jobs)), new)]), 1))

    monkeypatch.setattr(experiment, "each", each)
    monkeypatch.setattr(experiment, "check_video", lambda _: None)
    told = experiment.composites("demo.mp4", [], [], ["mixture"], 1, True, str(rows), None, 1)
    assert told["rows"] == [new, kept]
    assert [json.loads(line) for line in rows.read_text().splitlines()] == [kept, new]


def test_a_quick_look_is_two_rows_of_each_extraction_and_all_is_every_one() -> None:
    assert len(asked([], [], ["mixture", "median"], 1, True)) == 4
    assert len(asked([], [], ["mixture"], 2, False)) == 2 * 3 * len(SHOWS)
    assert asked(["two"], [4], ["mean"], 1, False) == [Shot("two", 4, "mean", 0)]


def test_an_extraction_is_a_segmenter_by_its_name_with_settings_behind() -> None:
    assert extraction_named("median") == Extraction("median")
    assert extraction_named("mean").settings == {"background": f"0:{BEFORE}"}
    assert extraction_named("mean background=0:5").settings == {"background": "0:5"}
    text = "mixture history=90 threshold=16.0"
    told = extraction_named(text)
    assert (told.name, told.settings) == ("mixture", {"history": 90, "threshold": 16.0})
    (shot,) = asked(["two"], [1], [text], 1, False)
    assert shot.extraction == text


def test_a_walk_goes_on_without_a_jump() -> None:
    clip = ways.frames_of("16_47")
    long = ways.walked_on(clip, 12.0)
    assert np.linalg.norm(long.translations[-1] - long.translations[0]) == pytest.approx(12.0, abs=0.1)
    most = [np.nanmax(acceleration(one.skeleton.joints(one.poses, one.translations), 30.0)) for one in (clip, long)]
    assert most[1] < 1.5 * most[0]


def test_to_turn_a_motion_turns_its_joints_about_the_vertical() -> None:
    clip = ways.frames_of("16_47", 0, 20)
    turned = ways.facing_elsewhere(clip, 0.7)
    sine, cosine = np.sin(0.7), np.cos(0.7)
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    joints = [one.skeleton.joints(one.poses, one.translations) for one in (clip, turned)]
    np.testing.assert_allclose(joints[1], joints[0] @ turn.T, atol=1e-9)


@pytest.mark.parametrize("views", [1, 2, 4])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_who_passes_is_seen_by_nobody_at_first_and_last_and_who_stays_is_seen_whole(views: int, seed: int) -> None:
    for name in SHOWS:
        made = situation(name, views, seed)
        for actor in made.actors:
            frames = [int(np.flatnonzero(actor.present)[k]) for k in (0, -1)]
            if name in ALWAYS:
                assert actor.present.all()
                frames = list(range(0, len(made), 20))
            for camera in made.cameras:
                masks = np.stack(
                    [project(actor.body, camera, actor.motion.poses[k], actor.motion.translations[k]) for k in frames]
                )
                if name in ALWAYS:
                    assert uncut(masks[None]).all(), (name, views, seed)
                else:
                    assert not masks.any(), (name, views, seed)


def test_whoever_comes_back_faces_the_other_way() -> None:
    actor = situation("back", 1, 0).actors[0]
    (gap,) = np.flatnonzero(np.diff(actor.present.astype(int)) == 1)[1:]
    yaws = actor.motion.poses[[gap - 30, gap + 1], 0]
    assert np.cos(yaws[1] - yaws[0]) < -0.9


def test_a_picture_has_a_person_where_his_mask_is_and_a_shadow_beside() -> None:
    made = brief(1)
    behind = empty()
    people = [posed(made.actors[0], 0, behind)]
    image = composited(behind.frame(0), made.cameras[0], people)
    (mask,) = true_masks(made.cameras[0], people)
    near = cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), dtype=np.uint8)) > 0
    inner = cv2.erode(mask.astype(np.uint8), np.ones((3, 3), dtype=np.uint8)) > 0
    away = np.abs(image - behind.still).max(axis=2)
    assert (away[inner] > 5.0).mean() > 0.98
    beside = away[~near]
    assert (beside[beside > 1.0] > 0.0).any()  # the shadow
    darker = image[~near] <= behind.still[~near] + 1e-3
    assert darker.all()


def test_who_is_nearer_hides_the_other() -> None:
    made = brief(1)
    actor, camera, behind = made.actors[0], made.cameras[0], empty()
    near = posed(actor, 0, behind)
    far = near._replace(place=near.place - [0.1, 0.0, 1.0])
    masks = true_masks(camera, [near, far])
    assert np.array_equal(masks[0], project(actor.body, camera, near.pose, near.place))
    assert not (masks[0] & masks[1]).any()
    assert masks[1].any()


def test_some_clothes_have_the_colour_of_what_is_behind() -> None:
    behind = np.full((60, 80, 3), (40, 120, 90), dtype=np.uint8)
    number = TROUSERS.index(None)
    worn = outfit(number, behind).colours
    ratio = worn / (40, 120, 90)
    assert (np.ptp(ratio, axis=1) < 1e-9).any()


def test_a_film_holds_what_is_true_and_its_calibration_is_that_of_its_cameras(tmp_path: Path) -> None:
    made = brief()
    filmed = film(made, [empty()], 0, True, tmp_path)
    assert filmed.first == BEFORE
    video = Video.of(filmed.videos[0])
    assert video.count() == BEFORE + len(made)
    assert video.size == SMALL
    (read,) = read_calibrations(filmed.calibration)
    camera = read.camera(SMALL, upright([read], "y"))
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (20, 3))
    np.testing.assert_allclose(camera.project(points)[0], made.cameras[0].project(points)[0], atol=1e-6)


def test_a_person_before_a_known_background_is_taken_out_of_a_film(tmp_path: Path) -> None:
    made = brief()
    filmed = film(made, [empty()], 0, True, tmp_path)
    how = Extraction(method="mean", background=f"0:{BEFORE}")
    extract(filmed.videos[0], tmp_path / "masks", how, frames=(BEFORE, None))
    with np.load(tmp_path / "masks" / "masks.npz") as stored:
        told = extraction_figures(stored["masks"][None] > 0, stored["usable"][None], filmed.masks)
    assert told["mask_iou"] > 0.75
    assert told["mask_half"] == 0.0


def test_masks_that_are_the_truth_overlap_fully_and_empty_ones_not_at_all(tmp_path: Path) -> None:
    made = brief()
    truth = film(made, [empty()], 0, False, tmp_path).masks
    usable = np.ones((1, len(made)), dtype=bool)
    exact = extraction_figures(truth, usable, truth)
    assert exact == {"mask_iou": 1.0, "mask_iou_worst_view": 1.0, "mask_half": 0.0, "usable": 1.0}
    assert extraction_figures(np.zeros_like(truth), ~usable, truth)["mask_iou"] == 0.0


def test_a_track_that_is_the_truth_has_no_error(tmp_path: Path) -> None:
    made = brief(20)
    truth = film(made, [empty()], 0, False, tmp_path).masks
    track = true_track(made)
    told = track_figures(track, made.actors[0].body.radii, made, truth)
    assert told["seen"] == 20
    assert told["body_iou"] == told["facing_right"] == told["said_unknown"] == 1.0
    assert told["acceleration"] == told["true_acceleration"]
    assert told["mpjpe_mm"] == told["place_mm"] == told["lost"] == told["swapped"] == told["said_lost"] == 0.0
    assert told["slide_cm"] == told["own_slide_cm"] == told["true_slide_cm"]
    assert "other_person" not in told
    poses = track.motion.poses.copy()
    poses[:, 0] += np.pi
    backwards = replace(track, motion=replace(track.motion, poses=poses))
    assert track_figures(backwards, made.actors[0].body.radii, made, truth)["facing_right"] == 0.0


def test_whoever_follows_the_other_of_two_is_told_so() -> None:
    made = situation("two", 1, 0)
    truth = np.zeros((1, len(made), 20, 20), dtype=bool)
    truth[0, 80:90, 5:10, 5:10] = True
    for number, share in ((0, 0.0), (1, 1.0)):
        alone = replace(made, actors=[made.actors[number]])
        told = track_figures(true_track(alone), made.actors[number].body.radii, made, truth)
        assert told["other_person"] == share


def test_steadiness_counts_seen_frames_alone() -> None:
    motion = ways.frames_of("16_47", 0, 60)
    joints = motion.skeleton.joints(motion.poses, motion.translations)
    seen = np.ones(60, dtype=bool)
    seen[30:] = False
    broken = joints.copy()
    broken[32:] += np.random.default_rng(0).normal(0.0, 0.5, broken[32:].shape)
    told = steadiness(joints, broken, seen, 30.0)
    assert told["acceleration"] == told["true_acceleration"]


def test_tables_tell_what_was_refused_and_compare_who_passes_with_who_stays() -> None:
    place = {"views": 1, "extraction": "mixture", "seed": 0}
    rows = [
        {"situation": "through", **place, "mask_iou": 0.9, "mpjpe_mm": 40.0, "own_slide_cm": None},
        {"situation": "back", **place, "mask_iou": 0.8, "mpjpe_mm": 60.0, "own_slide_cm": 3.0},
        {"situation": "stands", **place, "refused": "nobody moves"},
    ]
    passing, always = by_presence(rows)
    assert passing["mask_iou"] == pytest.approx(0.85)
    assert passing["own_slide_cm"] == 3.0
    assert (always["rows"], always["refused"], always["mask_iou"]) == (1, 1, None)
    lines = list(composites_lines({"rows": rows, "groups": by_presence(rows)}))
    assert any("refused: nobody moves" in line for line in lines)
    assert any(line.startswith("passing") and "0.85" in line for line in lines)


@pytest.mark.slow
def test_the_empty_pictures_of_the_demonstration_have_nobody_in_them() -> None:
    if not VIDEO.is_file():
        pytest.skip(f"no video at {VIDEO}")
    for number in range(4):
        found = plate(VIDEO, number, SIZE)
        assert found.still.shape == (SIZE[1], SIZE[0], 3)
        assert np.abs(found.living).max() < 128
        assert 0.1 < np.abs(found.living.astype(np.float32)).mean() < 5.0
    assert not np.array_equal(plate(VIDEO, 0, SIZE).still, plate(VIDEO, 1, SIZE).still)
