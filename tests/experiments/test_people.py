"""People whom the library has never seen: which tracks there are, what they come to, and who is found again."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from posefit.cli import main
from posefit.footage.instance import motion_of_instance
from posefit.motion import recorded
from posefit.sweep.cell import cell_scene
from posefit.sweep.check import cell_of
from posefit.sweep.plan import Plan
from posefit_experiments.people import experiment
from posefit_experiments.people.clips import GROUPS, RUNS, WALKS, Piece
from posefit_experiments.people.closest import closest_mm, distances_mm
from posefit_experiments.people.design import (
    AGAIN,
    BASE,
    CHANGES,
    FULL,
    METHODS,
    OTHERS,
    OWN,
    QUICK,
    STEPS,
    Extent,
    Planned,
    design,
)
from posefit_experiments.people.recovery import AWAY, GAPS, RETURN, judged, recoveries, returned, with_gap
from posefit_experiments.people.tables import interval, people_lines, recovery_lines, recovery_table, tables

CLIP = Piece("02_01", 12, 0, "walks straight")
TINY = Extent(
    walks=1, views=((45.0,),), changed=1, changed_views=((45.0,),), runs=0, stepped_runs=0, rest=0, compared=1,
    compared_views=((45.0,),), compared_rest=0,
)  # fmt: skip


def run(*words: object) -> Result:
    return CliRunner().invoke(main, ["reproduce", "people", *map(str, words)])


def test_clips_are_long_enough_and_of_several_people() -> None:
    for group, clips in GROUPS.items():
        assert len({(clip.name, clip.instance) for clip in clips}) == len(clips) >= 5
        assert len({clip.subject for clip in clips}) >= 3
        assert len({clip.subject for clip in clips[:3]}) == 3
        for clip in clips:
            assert len(motion_of_instance(clip.name, clip.instance, frames=clip.frames, fps=30.0)) == clip.frames
            if group == RUNS and clip.frames < 60:
                assert clip.frames == len(recorded.clip(clip.name).motion())
            else:
                assert 60 <= clip.frames <= 150


def test_nobody_is_followed_by_what_his_own_clips_taught_but_where_that_is_the_question() -> None:
    for track in design(FULL, "exemplars", 2440, METHODS):
        if track.part != OWN:
            assert track.spec["train"] == [f"library:-{track.clip.subject}"]
        else:
            assert track.clip.name not in track.spec["train"]
            assert "16_15" in track.spec["train"]


def test_at_least_three_hundred_tracks_are_sixty_frames_long_and_all_can_be_planned() -> None:
    tracks = design(FULL, "exemplars", 2440, METHODS)
    mine = [track for track in tracks if track.method == "exemplars"]
    assert sum(track.clip.frames >= 60 for track in mine) >= 300
    assert len(mine) <= 540
    assert len(Plan.of({"cells": [track.spec for track in tracks]})) == len(tracks)
    assert len(design(QUICK, "exemplars", 2440, METHODS)) <= 45


def test_one_thing_is_changed_at_a_time_and_on_tracks_of_the_base() -> None:
    tracks = design(FULL, "exemplars", 2440, METHODS)
    base = {track.place: track for track in tracks if track.part == BASE}
    assert {len(views) for _, _, views in base} == {1, 2}
    for track in tracks:
        if track.part not in (BASE, OWN):
            differs = {name for name in track.spec if track.spec[name] != base[track.place].spec.get(name)}
            one = {OTHERS: {"method"}, AGAIN: {"seed"}, **CHANGES, **STEPS}
            assert differs == set(one[track.part])
    counts = Counter(track.part for track in tracks)
    assert len({counts[name] for name in CHANGES}) == len({counts[name] for name in STEPS}) == 1
    assert counts[AGAIN] == 9 * 5 * 2
    assert not any(track.part in STEPS for track in design(FULL, "sapso@pca", 2440, ()))
    assert {track.method for track in tracks if track.part == OTHERS} == set(METHODS)


def test_the_first_yaw_is_told_to_25_degrees_or_not_at_all() -> None:
    for name, most in ((BASE, 25.0), ("first yaw unknown", 180.0), ("all of these", 180.0)):
        (track, *_) = (one for one in design(FULL, "exemplars", 2440, ()) if one.part == name)
        assert cell_of(track.spec).yaw_off_degrees == most


def row(mpjpe: float, lost: float = 0.0) -> dict[str, Any]:
    return {
        "mpjpe_mm": mpjpe,
        "lost_rate": lost,
        "swap_rate": 0.25,
        "baselines_mm": {"nearest": 30.0, "mean_pose": 90.0, "persistence": 200.0},
        "seconds_per_frame": 0.1,
        "error_degrees": {"mean": 1.25, "std": 0.0, "max": 2.0},
    }


def test_tables_hold_medians_and_the_differences_from_the_base() -> None:
    scale = Extent(walks=3, views=((0.0,), (0.0, 90.0)), seeds=(5,), changed=3, changed_views=((0.0,),), runs=0, stepped_runs=0, rest=0, compared=3,
                  compared_views=((0.0,),), compared_rest=0)  # fmt: skip
    found = [track for track in design(scale, "exemplars", 100, ("vsmm",)) if track.part != OWN]
    values = {BASE: 40.0, AGAIN: 40.0, "the path alone": 44.0, "first yaw unknown": 47.0, OTHERS: 300.0}
    rows = [row(values.get(track.part, 50.0) + len(track.views), 0.5 * (track.part == OTHERS)) for track in found]
    told = tables(found, rows, {track.clip: 20.0 for track in found})
    walks = told["groups"][0]
    assert (walks["group"], walks["closest_mm"]) == (WALKS, 20.0)
    assert walks["1_camera"]["tracks"] == 2 * 3
    assert walks["1_camera"]["mpjpe_mm"] == walks["views"][0]["mpjpe_mm"] == 41.0
    assert walks["2_camera"]["mpjpe_mm"] == 42.0
    assert walks["2_camera"]["nearest_mm"] == 30.0
    assert {one["change"]: one["more_mm"] for one in told["changes"]} == {
        BASE: 0.0, **dict.fromkeys(CHANGES, 10.0), "first yaw unknown": 7.0,
    }  # fmt: skip
    assert {one["change"]: one["more_mm"] for one in told["steps"]} == {
        BASE: 0.0, **dict.fromkeys(STEPS, 10.0), "the path alone": 4.0,
    }  # fmt: skip
    assert [(one["method"], one["mpjpe_mm"], one["lost_rate"]) for one in told["methods"]] == [
        ("exemplars", 41.0, 0.0), ("vsmm", 301.0, 0.5),
    ]  # fmt: skip
    lines = list(people_lines(told))
    assert "| walks | 0, 90 | 3 | 42 | 42 to 42 | 0.0 | 25.0 | 30 | 90 | 20 |" in lines
    assert "| vsmm | 3 | 301 | 301 to 301 | 50.0 | 25.0 | 100.0 |" in lines
    for table in "\n".join(lines).split("\n\n"):
        assert len({line.count("|") for line in table.splitlines()}) == 1


def test_an_interval_is_as_wide_as_the_clips_differ() -> None:
    assert interval(np.array([3.0, 3.0, 3.0]), ["a", "b", "c"]) == (3.0, 3.0)
    assert interval(np.array([1.0, 2.0, 9.0]), ["a", "a", "a"]) == (2.0, 2.0)  # one clip says nothing of others
    low, high = interval(np.arange(50.0), [str(k) for k in range(50)])
    assert 10.0 < low < 24.5 < high < 39.0


def test_the_closest_of_some_poses_is_found() -> None:
    truth = np.zeros((2, 81), dtype=np.float32)
    truth[1, 3] = 0.27
    others = np.zeros((100, 81), dtype=np.float32)
    others[:, 3] = np.linspace(0.054, 1.0, 100)
    assert distances_mm(truth, others) == pytest.approx([2.0, 1e3 * np.abs(others[:, 3] - 0.27).min() / 27], abs=1e-3)


def test_a_clip_is_some_way_from_everybody_elses() -> None:
    assert 5.0 < closest_mm([CLIP], 1)[CLIP] < 100.0


def gap_scene() -> Any:
    spec = {"method": "exemplars", "motion": "02_01", "frames": 30, "view_degrees": 90.0}
    return cell_scene(cell_of({**spec, "train": ["library:-02"], "yaw_off_degrees": 25.0}))


def test_in_a_gap_nothing_is_seen_and_nobody_says_where_he_is() -> None:
    scene, gone, back = with_gap(gap_scene(), 10)
    assert (gone, back) == (10, 20)
    for k in range(30):
        seen = scene.observations[k]
        assert seen.usable == seen.silhouettes[0].mask.any() == (not gone <= k < back)
    assert scene.observations[15].translation is None
    assert np.array_equal(scene.observations[20].translation, scene.truth.translations[20])


def test_whoever_comes_back_walks_the_same_way_the_other_way_round() -> None:
    before = gap_scene()
    scene, gone, back = returned(before, (90.0,))
    truth = scene.truth
    assert (gone, back, scene.count) == (30, 30 + AWAY, 60 + AWAY)
    assert scene.yaw == before.yaw
    assert truth.translations[back] == pytest.approx(truth.translations[gone - 1], abs=0.05)
    assert truth.translations[-1] == pytest.approx(truth.translations[0], abs=0.05)
    way = truth.translations[gone - 1] - truth.translations[0]
    assert np.allclose((truth.translations[-1] - truth.translations[back])[[0, 2]], -way[[0, 2]])
    assert np.cos(truth.poses[back, 0] - truth.poses[0, 0]) == pytest.approx(-1.0)
    assert not scene.observations[back - 1].usable
    assert scene.observations[back].silhouettes[0].mask.any()


def test_a_track_is_right_again_that_is_not_lost_from_the_tenth_frame_on() -> None:
    mpjpe = np.full(60, 40.0)
    mpjpe[20:33] = 300.0
    yaws = np.zeros(60)
    found = judged(mpjpe, yaws, yaws, 20, 30)
    assert found == {"before": True, "right": True, "frames": 3, "facing_right": True, "mpjpe_mm": 40.0}
    mpjpe[45] = 300.0
    found = judged(mpjpe, yaws, yaws + 3.0, 20, 30)
    assert (found["right"], found["frames"], found["facing_right"]) == (False, 16, False)
    mpjpe[45:] = mpjpe[12] = 300.0
    found = judged(mpjpe, yaws, yaws, 20, 30)
    assert (found["before"], found["right"], found["frames"]) == (False, False, None)


def test_trials_of_every_kind_are_made_and_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("posefit_experiments.people.recovery.BEFORE", 30)
    monkeypatch.setattr("posefit_experiments.people.recovery.TRANSLATIONS", ("aligned",))
    found = recoveries([CLIP._replace(frames=62)], ((90.0,),), "random@pca", 80, 1)
    assert [one["kind"] for one in found] == [*GAPS, RETURN]
    told = recovery_table(found)
    assert [(one["kind"], one["translation"], one["trials"]) for one in told] == [
        (kind, "aligned", 1) for kind in (*GAPS, RETURN)
    ]
    assert len(list(recovery_lines({"recovery": told}))) == 2 + len(told)


def test_tracks_are_run_kept_and_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def short(scale: Extent, method: str, evaluations: int, others: Any) -> list[Planned]:
        found = [track for track in design(scale, method, evaluations, others) if track.part in (BASE, *CHANGES)]
        return [track._replace(spec={**track.spec, "train": ["library:16"], "frames": 2}) for track in found]

    monkeypatch.setattr(experiment, "QUICK", TINY)
    monkeypatch.setattr(experiment, "design", short)
    monkeypatch.setattr(experiment, "closest_mm", lambda clips, _workers, _progress: dict.fromkeys(clips, 20.0))
    ledger, out = tmp_path / "ledger", tmp_path / "rows.jsonl"
    words = ("--quick", "--method", "random@pca", "--evaluations", 80, "--ledger", ledger)
    result = run(*words, "--out", out, "--json")
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    assert told["tracks"] == 1 + len(CHANGES)
    rows = [json.loads(line) for line in out.read_text().splitlines()]
    assert [one["part"] for one in rows] == [BASE, *CHANGES]
    assert rows[0]["mpjpe_mm"] == told["groups"][0]["views"][0]["mpjpe_mm"]
    again = run(*words)
    assert "7 of 7 cells are done already" in again.stderr
    assert again.stdout.startswith("| group | view | tracks | median MPJPE mm |")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--method", "exemplar"), "did you mean 'exemplars'"),
        (("--method", "exemplar", "--recovery"), "did you mean 'exemplars'"),
        (("--recovery", "--ledger", "there"), "got --ledger with --recovery"),
        (("--workers", "0"), "workers must be at least 1, got 0"),
        (("--evaluations", "0"), "evaluations must be a whole number of at least 1, got 0"),
    ],
)
def test_a_mistake_is_one_line_and_status_2(words: tuple[str, ...], said: str, tmp_path: Path) -> None:
    out = tmp_path / "rows.jsonl"
    result = run(*words, "--out", out)
    assert result.exit_code == 2, result.output
    (line,) = result.stderr.splitlines()
    assert line.startswith("posefit: ")
    assert said in line
    assert not out.exists()
