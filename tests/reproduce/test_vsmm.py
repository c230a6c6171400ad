"""The experiment of the VSMM patent: what it comes to, and what `posefit reproduce vsmm` prints and draws."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from posefit.cli import main
from posefit.fitting.tracker import Frame
from posefit.motion import built_in
from posefit_reproduce.vsmm import activities
from posefit_reproduce.vsmm.activities import film_of
from posefit_reproduce.vsmm.experiment import (
    HAND,
    METHODS,
    PatentTrack,
    State,
    activity_figures,
    change,
    detected_cm,
    follow_film,
    model_states,
    switching_figures,
)
from posefit_vsmm.state import AT

WORDS = ("walk", "arms-out", "jacks", "squat")  # the labels of the film's activities


@pytest.fixture(scope="module")
def experiment() -> PatentTrack:
    return follow_film(METHODS["default"], 0)


@pytest.fixture(scope="module")
def film() -> activities.Film:
    return film_of(0)


@pytest.mark.slow
def test_the_experiment_is_about_as_good_as_the_patents(experiment: PatentTrack) -> None:
    figures = experiment.figures
    assert figures["dominant_fraction"] >= 0.8
    assert figures["elbow_cm"] <= 5.2
    assert figures["hand_cm"] <= 5.2
    assert figures["activity_accuracy"] > figures["chance"]


def test_no_motion_of_the_experiment_was_learned_from(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "docs" / "studies"))
    from make_models import TEACHINGS

    tested = {one.motion for one in activities.ACTIVITIES}
    stored = json.loads((Path(built_in.__file__).parent / "built_in.json").read_text(encoding="utf-8"))["motions"]
    sources = {stored[name]["source"] for name in tested}
    parts = {(clip.path.split("/")[1], clip.start) for teaching in TEACHINGS.values() for clip in teaching.fitted}
    assert not sources & {name for name, _ in parts}
    assert not tested & set(activities.TRAINING)
    assert not tested & {name for teaching in TEACHINGS.values() for name in teaching.drawn}


@pytest.mark.slow
def test_the_figures_are_drawn(tmp_path: Path, experiment: PatentTrack) -> None:
    pytest.importorskip("matplotlib")
    from posefit_reproduce.vsmm.figures import patent_figures

    names = patent_figures(film_of(0), experiment.frames, tmp_path)
    assert names == ["figure-9-joints.png", "figure-10-probabilities.png", "figure-11-errors.png"]
    assert all((tmp_path / name).stat().st_size > 10_000 for name in names)


@pytest.mark.slow
def test_reproduce_prints_both_presets() -> None:
    wrong = CliRunner().invoke(main, ["reproduce", "vsmm", "--seeds", "0"])
    assert wrong.exit_code == 2
    assert wrong.output.splitlines()[-1] == "posefit: seeds must be at least 1, got 0"
    result = CliRunner().invoke(main, ["reproduce", "vsmm", "--seeds", "1"])
    assert result.exit_code == 0
    for words in ("default  patent  imm_all_six", "\nthe right model ", "\ndegrees ahead ", "\nlabels, patent "):
        assert words in result.stdout


def states(film: activities.Film, probability: float = 0.9) -> list[State]:
    """Return the states of a tracker that is always right and has one group an activity."""
    groups = {one.label: tuple(sorted(one.models)) for one in activities.ACTIVITIES}
    counts = {"lost": False, "filter_seconds": 0.001, "detection_seconds": 0.002}
    every = []
    for label in film.labels:
        name = activities.ACTIVITIES[label].label
        shares = np.full(len(groups[name]), (1.0 - probability) / max(len(groups[name]) - 1, 1))
        shares[0] = probability
        force = {"group": name, "newcomer": None, "models": groups[name], "probabilities": shares}
        every.append({"groups": groups, **force, "activity": WORDS[label], **counts})
    return every


def test_a_tracker_that_is_always_right_makes_no_mistake(film: activities.Film) -> None:
    figures = switching_figures(film, states(film))
    assert figures["dominant_fraction"] == figures["right_model_fraction"] == figures["right_group_fraction"] == 1.0
    assert figures["switch_delays_frames"] == [0, 0, 0]
    assert figures["wrong_activations"] == figures["wrong_terminations"] == figures["activations"] == 0
    assert (figures["filter_ms"], figures["detection_ms"]) == pytest.approx((1.0, 2.0))


def test_what_is_late_or_wrong_is_counted(film: activities.Film) -> None:
    right = states(film)
    # waving and striding shares the model `walk` with stepping; jumping jacks, 140 frames, and squat, 60, do not
    figures = switching_figures(film, [right[0]] * len(right))
    assert figures["switch_delays_frames"] == [0, 140, 60]
    assert figures["right_group_fraction"] == 250 / 450
    right[5] = {**right[5], "newcomer": "squat"}
    right[7] = {**right[7], "group": None}  # a restart
    figures = switching_figures(film, right)
    assert (figures["activations"], figures["wrong_activations"]) == (1, 1)
    assert figures["right_group_fraction"] == 449 / 450


def test_labels_are_counted_by_activity(film: activities.Film) -> None:
    figures = activity_figures(film, states(film))
    assert figures["confusion"] == [[120, 0, 0, 0, 0], [0, 130, 0, 0, 0], [0, 0, 140, 0, 0], [0, 0, 0, 60, 0]]
    assert (figures["activity_accuracy"], figures["chance"]) == (1.0, 140 / 450)
    jump = {**states(film)[0], "activity": "jump"}
    assert activity_figures(film, [jump] * 450)["confusion"][3] == [0, 0, 0, 0, 60]


def test_errors_against_detected_joints_leave_hidden_ones_out(film: activities.Film) -> None:
    truth = film.truth.skeleton.joints(film.truth.poses[:1], film.truth.translations[:1])
    pixels, depths = film.camera.project(truth)
    nothing = np.zeros((1, 3), dtype=np.int64)
    frame = Frame(film.truth.poses[0], film.truth.translations[0], 0.0, nothing, 1)
    joints, confidence = np.zeros((1, 17, 2)), np.zeros((1, 17))
    point = AT["right hand"]
    joints[0, point] = pixels[0, HAND] + [3.0, 4.0]
    confidence[0, point] = 0.5
    assert model_states([frame]) == []  # of a tracker without models
    assert switching_figures(film, []) == {}
    elbow, hand = detected_cm(film, [frame], [{"joints": joints, "confidence": confidence}])[0]
    assert np.isnan(elbow)
    assert hand == pytest.approx(100.0 * 5.0 * depths[0, HAND] / film.camera.focal[0])


def test_alternatives_are_compared_film_by_film() -> None:
    rows: list[list[dict[str, Any]]] = [[{"mpjpe_mm": mm} for mm in values] for values in ((90, 110), (100, 104))]
    assert change(*rows) == {"worse_mm": 2.0, "worse_films": 1.0}
