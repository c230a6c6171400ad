"""How sure a tracker is of people it has never seen: which tracks there are, what is fitted, and what is printed."""

import inspect
import json
from collections import Counter
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from posefit.cli import main
from posefit.geometry.rotation import wrapped
from posefit.motion import recorded
from posefit.sweep.check import cell_of
from posefit_exemplars.doubt import Doubt
from posefit_exemplars.factory import exemplars
from posefit_experiments.people.clips import Piece
from posefit_experiments.posterior.design import OTHERS, TEMPERATURES, OneTrack, pieces, planned_tracks
from posefit_experiments.posterior.experiment import posterior
from posefit_experiments.posterior.fit import MEMBERS, Kept, doubt_of, frame_weights, logistic
from posefit_experiments.posterior.frames import Followed, load_tracks, save_tracks
from posefit_experiments.posterior.tables import best_modes, coverages, judgement, posterior_lines

PEOPLE = ("02", "16", "49")


def run(*words: object) -> Result:
    return CliRunner().invoke(main, ["reproduce", "posterior", *map(str, words)])


def made(person: str, instance: int, off: float, method: str = "exemplars", temperature: float = 8.0) -> Followed:
    """Return a track whose truth is one more draw of what is drawn about the pose that is told, but for noise.

    It costs as much more as it is farther off.
    """
    rng = np.random.default_rng([int(person), instance, len(method)])
    told = 0.3 * rng.standard_normal((20, 66))
    drawn, noise = (off * rng.standard_normal(shape) for shape in ((20, 12, 66), (20, 66)))
    seen = OneTrack("walks", Piece(f"{person}_01", 20, instance, "walks"), (45.0,), "known", 20, method, temperature)
    costs = 100 * off + told[:, 0] ** 2
    return Followed(seen, wrapped(told + noise), told, told[:, None] + drawn, np.full((20, 12), 1 / 12), costs)


def crowd(more: bool = False) -> list[Followed]:
    tracks = [made(person, k, off) for person in PEOPLE for k, off in enumerate(np.geomspace(0.02, 0.2, 12))]
    others = [made(person, 0, 0.02, method) for person in PEOPLE for method in OTHERS]
    return [*tracks, *others] if more else tracks


@pytest.fixture(scope="module")
def kept() -> list[Kept]:
    return [Kept.of(one) for one in crowd()]


@pytest.fixture(scope="module")
def doubt(kept: list[Kept]) -> Doubt:
    return doubt_of(kept)


def test_everybody_is_followed_in_three_or_four_clips_from_every_side() -> None:
    people = Counter(clip.subject for _, clip in pieces())
    assert set(people) == {clip.subject for clip in recorded.clips()}
    assert set(people.values()) <= {3, 4}
    base, others = planned_tracks(8.0, False)
    assert {view for one in base if len(one.views) == 1 for view in one.views} == {0.0, 45.0, 90.0, 135.0, 180.0}
    assert {len(one.views) for one in base} == {1, 2}
    assert {one.translation for one in base} == {"known", "aligned"}
    assert {one.temperature for one in others if one.method == "exemplars"} == set(TEMPERATURES) - {8.0}
    assert {one.method for one in others} == {"exemplars", *OTHERS}
    assert len({*base, *others}) == len(base) + len(others)


def test_whoever_moves_is_left_out_of_the_library_and_every_track_can_be_followed() -> None:
    base, others = planned_tracks(8.0, True)
    for one in (*base, *others):
        cell = cell_of(one.spec)
        assert cell.train == (f"library:-{one.clip.subject}",)
        assert cell.frames <= one.clip.frames


def test_every_joint_but_the_root_is_of_one_group() -> None:
    assert sorted(np.concatenate(list(MEMBERS.values()))) == list(range(1, 27))


def test_clips_count_alike_however_many_tracks_they_have(kept: list[Kept]) -> None:
    weights = frame_weights([kept[0], kept[0], kept[1]])
    assert weights[:40].sum() == pytest.approx(0.5)
    assert weights.sum() == pytest.approx(1.0)


def test_the_doubt_grows_with_the_error(kept: list[Kept], doubt: Doubt) -> None:
    logs = np.array([doubt.log(seen) for one in kept for seen in one.seen])
    errors = np.log(np.concatenate([one.error for one in kept]))
    assert np.corrcoef(logs, errors)[0, 1] > 0.9


def test_intervals_hold_what_they_say_after_the_fit(kept: list[Kept], doubt: Doubt) -> None:
    held = coverages([judgement(doubt, one) for one in kept])
    for one in (held["overall"], *held["joints"].values()):
        for level, share in one["coverage"].items():
            assert share == pytest.approx(float(level) / 100, abs=0.08)
    assert held["angles"]["80"] == pytest.approx(0.8, abs=0.05)


def test_best_modes_are_right_where_they_are_nearest_and_as_near_as_one_mode_is(kept: list[Kept]) -> None:
    one = replace(kept[0], modes=[np.array([0.8, 0.2])] * 20, nearest=np.zeros((20, 2)))
    one.nearest[:] = [0.0, 0.05]
    one.nearest[:5] = [0.0, 0.15]  # of whom none is right
    one.nearest[5:8] = [1.0, 0.05]
    told = best_modes([one])
    assert (told["right"], told["none"], told["mean_probability"]) == pytest.approx((12 / 20, 5 / 20, 0.8))
    assert told["calibration_error"] == pytest.approx(0.2)
    assert told["calibration_error_none"] == pytest.approx(5 / 20)  # nobody says so


def test_where_no_mode_is_right_is_learned(kept: list[Kept], doubt: Doubt) -> None:
    said = [judgement(doubt, one) for one in kept]
    told = best_modes(kept, said)
    assert told["calibration_error_none"] < 0.05
    assert told["calibration_error"] < best_modes(kept)["calibration_error"]


def test_odds_are_found_again() -> None:
    rng = np.random.default_rng(0)
    design = np.column_stack([np.ones(20000), rng.standard_normal(20000)])
    true = np.array([-1.0, 2.0])
    came = rng.random(20000) < 1.0 / (1.0 + np.exp(-design @ true))
    np.testing.assert_allclose(logistic(design, came, np.full(20000, 1.0 / 20000)), true, atol=0.15)


def test_tracks_come_back_from_a_file(tmp_path: Path) -> None:
    tracks, path = crowd(True)[-2:], tmp_path / "tracks.npz"
    save_tracks(tracks, path)
    for one, other in zip(tracks, load_tracks(str(path)), strict=True):
        assert one.seen == other.seen
        np.testing.assert_allclose(one.drawn, other.drawn, atol=2e-3)
        np.testing.assert_allclose(one.truth, other.truth, atol=1e-6)


def test_tables_are_of_whoever_was_left_out_and_what_is_stored_is_of_all(tmp_path: Path) -> None:
    tracks, table = tmp_path / "tracks.npz", tmp_path / "doubt.json"
    save_tracks(crowd(True), tracks)
    told = posterior(8.0, False, str(tracks), None, str(table), 1)
    assert 0.7 < told["coverage"]["overall"]["coverage"]["80"] < 0.9
    assert set(told["kept"]) == {"exemplars", *OTHERS}
    assert set(told["searches"]) >= {"even", "steepness", "lost", "calibration_error"}
    assert told["modes"]["recalibrated"]["calibration_error"] <= told["modes"]["8, all"]["calibration_error"] + 0.02
    lines = list(posterior_lines(told))
    assert all(line.startswith("| ") or line.startswith("|-") or not line for line in lines[:-1])
    assert lines[-1].startswith("lost, by the cost of what other methods found: even ")
    held = json.loads(table.read_text("utf-8"))
    assert held.pop("temperature") == 8.0
    assert Doubt.from_dict(held).as_dict() == held
    again = run("--again", tracks, "--json")
    assert again.exit_code == 0
    assert json.loads(again.stdout)["coverage"]["angles"] == pytest.approx(told["coverage"]["angles"])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--temperature", "5"], "temperature must be one of 4, 8, 16, 32, got 5"),
        (["--again", "no.npz"], "no.npz: expected tracks that --out wrote"),
        (["--again", "no.npz", "--quick"], "again must not be given beside --quick, got --again no.npz"),
        (["--again", "no.npz", "--out", "new.npz"], "again must not be given beside --out, got --again no.npz"),
        (["--workers", "0"], "workers must be at least 1, got 0"),
    ],
)
def test_a_mistake_is_told_in_one_line_and_nothing_is_written(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    told = run(*words, "--store", "doubt.json")
    assert told.exit_code == 2
    assert said in told.stderr
    assert told.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_tracks_of_too_few_people_are_told(tmp_path: Path) -> None:
    path = tmp_path / "tracks.npz"
    save_tracks(crowd()[:24], path)
    with pytest.raises(ValueError, match="tracks must be of 3 people or more at 8, got 2"):
        posterior(8.0, False, str(path), None, None, 1)


def test_what_posefit_brings_was_learned_at_the_temperature_that_is_the_default() -> None:
    held = json.loads(files("posefit_exemplars").joinpath("doubt.json").read_text("utf-8"))
    assert held["temperature"] == inspect.signature(exemplars).parameters["posterior_temperature"].default
