"""The experiment of the VSMM patent: what it comes to, and what `posefit reproduce vsmm` prints and draws."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from posefit.cli import main
from posefit.motion import built_in
from posefit_reproduce.commands import patent_experiment
from posefit_reproduce.experiment import Results, Run, reproduce
from posefit_reproduce.vsmm import activities, tables
from posefit_reproduce.vsmm.activities import film_of
from posefit_reproduce.vsmm.experiment import LABELS, MODELS, TUNED, Scale, perform
from posefit_reproduce.vsmm.tables import (
    ELBOW,
    HAND,
    film_figures,
    joint_errors,
    switching_figures,
)
from posefit_vsmm.state import AT


@pytest.fixture(scope="module")
def tracked() -> dict[str, Any]:
    return dict(perform(Run("tuned", "film", "default", seed=0)))


@pytest.fixture(scope="module")
def film() -> activities.Film:
    return film_of(TUNED)


@pytest.mark.slow
def test_the_experiment_is_about_as_good_as_the_patents(
    tracked: dict[str, Any],
) -> None:
    figures = film_figures(0, tracked)
    assert figures["dominant"] >= 80.0
    assert figures["elbow"] <= 5.2
    assert figures["hand"] <= 5.2
    assert figures["label"] > 100.0 * 140 / 450  # by chance


def test_no_film_is_both_tuned_on_and_reported() -> None:
    runs = list(Scale(films=3).runs)
    assert {run.seed for run in runs if run.kind == "reported"} == {5, 6, 7}
    assert {run.seed for run in runs if run.kind == "tuned"} == {0, 1, 2, 3, 4}


def test_no_motion_of_the_experiment_was_learned_from(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "docs" / "studies"))
    from make_models import TEACHINGS

    tested = {one.motion for one in activities.ACTIVITIES}
    stored = json.loads(
        (Path(built_in.__file__).parent / "built_in.json").read_text(encoding="utf-8")
    )["motions"]
    sources = {stored[name]["source"] for name in tested}
    parts = {
        (clip.path.split("/")[1], clip.start)
        for teaching in TEACHINGS.values()
        for clip in teaching.fitted
    }
    assert not sources & {name for name, _ in parts}
    assert not tested & set(activities.TRAINING)
    assert not tested & {
        name for teaching in TEACHINGS.values() for name in teaching.drawn
    }


@pytest.mark.slow
def test_tables_and_figures_are_made_of_runs(
    tmp_path: Path, tracked: dict[str, Any]
) -> None:
    pytest.importorskip("matplotlib")
    made = patent_experiment(Scale(films=2))
    found = reproduce(
        dataclasses.replace(made, perform=lambda run: tracked),
        tmp_path / "out",
        1,
        None,
    )
    names = {
        "compared",
        "films",
        "claims",
        "labels-default",
        "labels-patent",
        "recovery",
    }
    assert {table.name for table in found} == names
    for figure in (
        "9-joints-default.jpg",
        "10-probabilities-patent.png",
        "11-errors-default.png",
    ):
        assert (tmp_path / "out" / f"figure-{figure}").stat().st_size > 10_000
    assert found[-1].rows[0][1:3] == ["0.0", "0 of 5"]  # a setting that changes nothing


def test_zero_films_are_a_mistake() -> None:
    wrong = CliRunner().invoke(main, ["reproduce", "vsmm", "--films", "0"])
    assert wrong.exit_code == 2
    assert wrong.output.splitlines()[-1] == "posefit: films must be at least 1, got 0"


def right(film: activities.Film) -> dict[str, Any]:
    """Return what a tracker holds that is always right: groups G1, G1, G3 and G3 in force, one model at 0.9."""
    labels = np.array(film.labels)
    probabilities = np.full((len(labels), len(MODELS)), 0.02)
    names = ("walk", "arms-out", "jacks", "squat")
    probabilities[
        np.arange(len(labels)), [MODELS.index(names[label]) for label in labels]
    ] = 0.9
    return {
        "probabilities": probabilities,
        "group": np.array([0, 0, 2, 2])[labels],
        "candidate_group": np.full(len(labels), -1),
        "label": labels,
        "lost": np.zeros(len(labels), dtype=bool),
        "filter_seconds": np.full(len(labels), 0.001),
        "detection_seconds": np.full(len(labels), 0.002),
    }


def test_a_tracker_that_is_always_right_makes_no_mistake(film: activities.Film) -> None:
    figures = switching_figures(film.labels, right(film))
    assert [figures[name] for name in ("dominant", "model", "group", "label")] == [
        100.0
    ] * 4
    assert [
        figures[name] for name in ("delay", "activations", "wrong_terminations")
    ] == [0.0] * 3
    assert (figures["filter"], figures["detection"]) == pytest.approx((1.0, 2.0))


def test_late_and_wrong_switches_are_counted(film: activities.Film) -> None:
    arrays = right(film)
    # for ten frames all models are tried; G1 stays: waving and striding shares the model `walk` with stepping, and
    # jumping jacks, 140 frames, and squats, 60, do not
    arrays["group"] = np.where(np.arange(450) < 10, -1, 0)
    figures = switching_figures(film.labels, arrays)
    assert figures["delay"] == figures["delay_change"] == 140
    assert figures["group"] == pytest.approx(100.0 * 240 / 450)
    arrays = right(film)
    # G3, while the person steps
    arrays["candidate_group"] = np.where(np.arange(450) == 5, 2, -1)
    figures = switching_figures(film.labels, arrays)
    assert (
        figures["activations"],
        figures["wrong_activations"],
        figures["wrong_terminations"],
    ) == (1, 1, 0)
    arrays = right(film)
    arrays["group"][100:110] = 2  # the right group goes
    assert switching_figures(film.labels, arrays)["wrong_terminations"] == 1


def test_labels_are_counted_by_activity(film: activities.Film) -> None:
    runs = {Run("reported", "film", "default", seed=TUNED): right(film)}
    table = tables.labels_table("labels", Results(runs), "default")
    assert table.heads[0] == "% (by chance 31)"  # 140 of 450 frames
    assert (
        np.array([row[1:] for row in table.rows], dtype=int).tolist()
        == (100 * np.eye(4, 6, dtype=int)).tolist()
    )
    runs[next(iter(runs))]["label"] = np.full(450, LABELS.index("jump"))
    assert tables.labels_table("labels", Results(runs), "default").rows[3][1:] == [
        "0",
        "0",
        "0",
        "0",
        "100",
        "0",
    ]


# Interpretation V18
def test_errors_against_detected_joints_are_of_every_frame(
    film: activities.Film,
) -> None:
    truth = film.truth
    pixels, depths = film.camera.project(
        truth.skeleton.joints(truth.poses, truth.translations)
    )
    joints = np.zeros((450, 1, 17, 2))
    joints[:, 0, AT["right hand"]] = pixels[:, HAND] + [3.0, 4.0]
    joints[:, 0, AT["right elbow"]] = pixels[:, ELBOW]
    errors = joint_errors(
        film,
        {"poses": truth.poses, "translations": truth.translations, "joints": joints},
    )
    np.testing.assert_allclose(errors["_detected"][:, 0], 0.0, atol=1e-9)
    np.testing.assert_allclose(
        errors["_detected"][:, 1], 100.0 * 5.0 * depths[:, HAND] / film.camera.focal[0]
    )
    np.testing.assert_allclose(errors["_space"], 0.0)
