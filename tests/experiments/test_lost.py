"""Which frames are lost, and whether a detector that was fitted to others knows: tracks, rows, tables, command."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from posefit.cli import main
from posefit.fitting.tracker import Observation
from posefit.silhouette.mask import Mask, Silhouette
from posefit.sweep.check import cell_of
from posefit_exemplars.lost import EVIDENCE, NAMES, Judge
from posefit_experiments.lost import experiment
from posefit_experiments.lost.damage import HELD, Worn, worn
from posefit_experiments.lost.design import CONDITIONS, EVERY, MASKS, USUAL, VIEWS, Turn, turns
from posefit_experiments.lost.model import SWAPPED, Said, features, fit, judge
from posefit_experiments.lost.tables import lost_lines, lost_tables, sides_table
from posefit_experiments.people.clips import Piece

CLIP = Piece("walk-a", 6, 0, "walks")
TRACK = Turn("walks", CLIP, (45.0,), "as they are")


def run(*words: object) -> Result:
    return CliRunner().invoke(main, ["reproduce", "lost", *map(str, words)])


def row(subject: str, far: list[float], mpjpe: list[float], **told: Any) -> dict[str, Any]:
    """Return a row whose frames are told apart by one kind of evidence."""
    return {
        "subject": subject, "group": "walks", "clip": f"{subject}_01", "views_degrees": [45.0],
        "condition": "as they are", "fps": 30.0, "mpjpe_mm": mpjpe, "cost": [100.0 * one for one in far],
        "swapped": [int(one > 150.0) for one in mpjpe],
        "evidence": [{"farthest": one, "mirrored": 1.0 / one} for one in np.maximum(far, 0.01)], **told,
    }  # fmt: skip


def rows() -> list[dict[str, Any]]:
    """Return rows of three people, whose frames are lost where a track is far."""
    rng = np.random.default_rng(3)
    found = []
    for subject in ("02", "05", "16"):
        for lost in (False, True):
            far = np.clip(0.2 + 0.6 * lost + 0.05 * rng.normal(size=20), 0.0, 1.0)
            found.append(row(subject, far.tolist(), (60.0 + 200.0 * lost + 9.0 * rng.normal(size=20)).tolist()))
    return found


def test_every_clip_is_followed_with_clean_and_with_real_masks_and_nobody_by_what_he_taught() -> None:
    tracks = turns(False)
    for masks in (False, True):
        counts = Counter((track.group, track.clip) for track in tracks if (track.condition == MASKS) == masks)
        usual = 2 if masks else 1
        assert counts == {
            (group, clip): usual if group in USUAL else 1 for group, clips in EVERY.items() for clip in clips
        }
    for track in tracks:
        cell = cell_of(track.spec("exemplars", 2440))
        assert cell.train == (f"library:-{track.clip.subject}",)
        assert cell.frames <= 48
        assert (track.condition == MASKS) <= (cell.translation == "aligned")
    assert len({track.clip.subject for track in tracks}) == 10
    assert len(turns(True)) < len(tracks) / 3


def test_all_views_and_conditions_come_about() -> None:
    tracks = turns(False)
    assert {track.condition for track in tracks} == {*CONDITIONS, MASKS}
    for masks in (False, True):
        assert {track.views for track in tracks if (track.condition == MASKS) == masks} == set(VIEWS)


def standing_mask() -> Mask:
    """Return a mask of somebody: a head on a trunk on two legs, 100 pixels tall."""
    mask = np.zeros((140, 90), dtype=bool)
    mask[20:36, 38:52] = mask[34:75, 32:58] = mask[75:120, 32:42] = mask[75:120, 48:58] = True
    return mask


def test_a_worn_mask_is_another_but_much_the_same() -> None:
    rng, mask = np.random.default_rng(0), standing_mask()
    overlaps = []
    for _ in range(30):
        spoilt = worn(mask, 0.0, rng, rng)
        overlaps.append((mask & spoilt).sum() / (mask | spoilt).sum())
    assert max(overlaps) < 1.0
    assert 0.8 < np.mean(overlaps) < 0.97


def test_a_rim_makes_masks_larger_or_smaller() -> None:
    areas = [worn(standing_mask(), rim, *(np.random.default_rng(5) for _ in "ab")).sum() for rim in (-0.01, 0.0, 0.01)]
    assert areas[0] < areas[1] < areas[2]


def test_a_mask_of_which_little_would_be_left_stays_and_so_does_an_empty_one() -> None:
    rng = np.random.default_rng(0)
    for mask in (standing_mask() & False, standing_mask()):
        np.testing.assert_array_equal(worn(mask, -0.1, rng, rng), mask)


def test_what_is_wrong_with_a_mask_stays_for_a_while_and_comes_again_the_same() -> None:
    seen = [Observation([Silhouette.of(standing_mask())] * 2, None)] * (4 * HELD)
    masks = [[one.mask for one in each.silhouettes] for each in Worn(seen, [3])]
    again = Worn(seen, [3])[7].silhouettes
    np.testing.assert_array_equal([one.mask for one in again], masks[7])
    assert (masks[7][0] != masks[7][1]).any()  # each camera has its own
    steps = np.array([(masks[k][0] ^ masks[k + 1][0]).sum() for k in range(len(masks) - 1)])
    changes = np.sort(steps)[::-1]
    assert changes[:3].min() > 1.5 * np.median(steps)  # three times another thing is wrong


def test_a_person_is_judged_by_what_others_taught() -> None:
    # of one person the very opposite is true: a detector that knew him would do better than one that does not
    found = rows()
    other = [row("49", one["evidence"][0]["farthest"] * np.ones(20), (320.0 - np.array(one["mpjpe_mm"])).tolist()) for one in found[:2]]  # fmt: skip
    told = judge([*found, *other])
    told = [one.lost for one in told]
    figures = {one["subject"]: lost_tables([one, two], [a, b])["lost"][0]["auroc"] for one, two, a, b in (
        (*found[:2], *told[:2]), (*other, *told[-2:]))}  # fmt: skip
    assert figures["02"] == 1.0
    assert figures["49"] == 0.0


def test_the_model_that_is_fitted_is_one_that_the_tracker_reads() -> None:
    told = fit(rows())
    assert set(told["lost"]["weights"]) == {"farthest", "farthest, lately"}  # nothing else differs
    assert set(told["sides"]["weights"]) == {"farthest, in general", "mirrored", "mirrored, in general"}
    models, known = Judge.from_dict(told), features(rows()[1])
    assert known.shape == (20, len(NAMES)) == (20, 3 * len(EVIDENCE))
    assert all(models.lost.probability(one) > 0.5 for one in known)
    assert all(models.sides.probability(one) >= models.unknown for one in known)


def test_where_signs_tell_swapped_frames_few_of_the_known_ones_are() -> None:
    found = rows()
    said = judge(found)
    every = sides_table(found, said)[0]
    assert every["auroc"] == 1.0
    assert every["swapped_known"] <= SWAPPED
    assert every["unknown"] == pytest.approx(0.5, abs=0.1)


def test_where_nothing_tells_swapped_frames_nearly_all_are_unknown() -> None:
    rng = np.random.default_rng(0)
    found = [{**one, "swapped": (rng.random(20) < 0.3).astype(int).tolist()} for one in rows()]
    assert sides_table(found, judge(found))[0]["unknown"] > 0.8


@pytest.mark.parametrize(("mpjpe", "count"), [(60.0, 0), (200.0, 40)])
def test_what_cannot_be_told_apart_is_told(mpjpe: float, count: int) -> None:
    same = [row(subject, [0.1] * 20, [mpjpe] * 20) for subject in ("02", "05")]
    with pytest.raises(ValueError, match=f"frames must be lost and not lost, to be told apart, got {count} of 40"):
        fit(same)


def test_one_person_alone_judges_nobody_and_two_people_neither() -> None:
    with pytest.raises(ValueError, match="rows must be of three people or more, got those of 02$"):
        judge(rows()[:2])
    with pytest.raises(ValueError, match="rows must be of three people or more, got those of 02, 05$"):
        judge([row(subject, [0.1] * 20, [60.0] * 20) for subject in ("02", "05")])


def test_tables_say_how_often_it_is_right() -> None:
    one = row("02", [0.0] * 4, [50.0, 60.0, 190.0, 300.0])
    two = row("05", [0.0] * 4, [50.0, 140.0, 160.0, 300.0], views_degrees=[0.0, 90.0], condition="damaged")
    told = lost_tables([one, two], [np.array([0.1, 0.2, 0.3, 0.9]), np.array([0.0, 0.8, 0.7, 0.6])])
    every, walks, single, double, clean, damaged = told["lost"]
    assert [one["name"] for one in told["lost"]] == [
        "all", "walks", "1 camera", "2 cameras", "as they are", "damaged",
    ]  # fmt: skip
    assert (every["frames"], every["tracks"], every["lost_rate"]) == (8, 2, 0.5)
    assert single["auroc"] == 1.0
    # of four pairs of a lost and another frame two are in order
    assert double["auroc"] == damaged["auroc"] == 0.5
    assert (double["said_recall"], double["said_false_alarms"]) == (1.0, 0.5)
    assert double["auroc_clear"] == 1.0
    assert double["false_alarms_95"] == 0.5
    assert single["said_recall"] == 0.5
    # the six least doubted are those with 50, 50, 60, 190, 300 and 160 mm
    assert told["kept"]["0.75"] == pytest.approx(135.0)
    assert walks["auroc"] == every["auroc"]
    assert clean["auroc"] == 1.0
    lines = list(lost_lines(told))
    assert lines[2].startswith("| all | 2 | 8 | 50.0 |")
    assert lines[-1].startswith("mean MPJPE, least doubted frames first: 25 % kept 50 mm")


def test_a_table_of_sides_says_how_many_are_unknown_and_how_many_of_these_are_swapped() -> None:
    one = row("02", [0.1] * 4, [200.0, 60.0, 60.0, 200.0])  # of which the first and the last are swapped
    said = Said(np.zeros(4), np.array([0.9, 0.2, 0.1, 0.15]), np.array([True, True, False, False]))
    every = sides_table([one], [said])[0]
    assert (every["swapped"], every["unknown"], every["unknown_right"]) == (0.5, 0.5, 0.5)
    assert (every["swapped_unknown"], every["swapped_known"]) == (0.5, 0.5)
    assert every["auroc"] == 0.75  # of four pairs three are in order
    assert list(lost_lines({"lost": [], "kept": {}, "sides": [every]}))[-1].startswith("| all | 1 | 4 | 50.0 | 0.750 |")


def test_costs_alone_are_no_probabilities() -> None:
    told = lost_tables(rows()[:2], [np.array(one["cost"]) for one in rows()[:2]])["lost"][0]
    assert told["auroc"] == 1.0
    assert told["said_recall"] is told["said_false_alarms"] is told["calibration_error"] is None


@pytest.mark.parametrize(("method", "told"), [("exemplars", True), ("random@pca", False)])
def test_a_track_becomes_a_row(method: str, told: bool) -> None:
    spec = {"method": method, "motion": "walk-a", "train": ["walk-b", "walk-c"], "frames": 6, "evaluations": 300}
    found = experiment._tracked(cell_of({**spec, "size": [160, 120]}), TRACK)
    assert found.keys() >= experiment.NEEDED
    assert len(found["mpjpe_mm"]) == len(found["cost"]) == 6
    assert ("evidence" in found) == told
    if told:
        assert features(found).shape == (6, len(NAMES))


def written(folder: Path, found: list[dict[str, Any]]) -> Path:
    path = folder / "rows.jsonl"
    path.write_text("".join(f"{json.dumps(one)}\n" for one in found))
    return path


def test_a_detector_is_fitted_to_rows_and_stored(tmp_path: Path) -> None:
    path, stored = written(tmp_path, rows()), tmp_path / "lost.json"
    result = run("--rows", path)
    assert result.exit_code == 0, result.output
    assert "| all | 6 | 120 | 50.0 | 1.000 |" in result.stdout
    assert not stored.exists()
    result = run("--rows", path, "--store", stored, "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(stored.read_text()) == json.loads(result.stdout)["model"]


def test_without_evidence_it_is_the_cost_that_judges(tmp_path: Path) -> None:
    found = rows()
    for one in found:
        del one["evidence"]
    path, stored = written(tmp_path, found), tmp_path / "lost.json"
    told = json.loads(run("--rows", path, "--json").stdout)
    assert told["lost"][0]["auroc"] == 1.0
    assert "model" not in told
    result = run("--rows", path, "--store", stored)
    assert result.exit_code == 2
    assert "rows must have evidence to be fitted" in result.stderr
    assert not stored.exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--store", "FOLDER/out", "--quick"), "store must be asked for with all tracks of exemplars"),
        (("--store", "FOLDER/out", "--method", "sapso@pca"), "store must be asked for with all tracks of exemplars"),
        (("--rows", "FOLDER/rows.jsonl", "--out", "FOLDER/out"), "out must be given for tracks that are followed"),
        (("--rows", "FOLDER/nothing"), "nothing"),
        (("--rows", "FOLDER/none.jsonl"), "expected a row a track, got an empty file"),
        (("--rows", "FOLDER/bad.jsonl"), "line 1 must be a row of a track, got no JSON"),
        (("--rows", "FOLDER/other.jsonl"), "line 1 must be a row of a track, with condition, cost,"),
        (("--quick", "--workers", "0"), "workers must be at least 1, got 0"),
    ],
)
def test_a_mistake_is_one_line_and_status_2(words: tuple[str, ...], said: str, tmp_path: Path) -> None:
    written(tmp_path, rows())
    for name, text in (("none", ""), ("bad", "so\n"), ("other", "[]\n")):
        (tmp_path / f"{name}.jsonl").write_text(text)
    result = run(*(word.replace("FOLDER", str(tmp_path)) for word in words))
    assert result.exit_code == 2
    assert said in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()
