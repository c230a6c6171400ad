"""The experiment of the VSMM patent: what it comes to, and what `posefit reproduce vsmm` prints and draws."""

import json
from dataclasses import replace
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
from posefit_reproduce.vsmm.experiment import METHODS, PatentTrack, follow_film
from posefit_reproduce.vsmm.switches import ModelState, model_states, switching_figures


@pytest.fixture(scope="module")
def experiment() -> PatentTrack:
    return follow_film(METHODS["vsmm"], 0)


@pytest.mark.slow
def test_the_experiment_is_about_as_good_as_the_patents(experiment: PatentTrack) -> None:
    figures = experiment.figures
    assert figures["dominant_fraction"] >= 0.8
    assert figures["switch_delay_frames"] <= 15
    assert figures["elbow_cm"] <= 5.2
    assert figures["hand_cm"] <= 5.2


def test_no_motion_of_the_experiment_was_learned_from() -> None:
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
def test_reproduce_prints_the_figures_as_json(tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["reproduce", "vsmm", "--seeds", "1", "--json"])
    assert result.exit_code == 0
    figures = json.loads(result.stdout)
    keys = {
        "dominant_fraction", "switch_delay_frames", "elbow_cm", "hand_cm", "elbow_3d_cm", "hand_3d_cm", "filter_ms",
        "detection_ms", "wrong_activations", "wrong_terminations",
    }  # fmt: skip
    assert keys <= set(figures)
    assert keys <= set(figures["imm_all_six"])


def test_reproduce_says_what_seeds_must_be() -> None:
    result = CliRunner().invoke(main, ["reproduce", "vsmm", "--seeds", "0"])
    assert result.exit_code == 2
    assert result.output.splitlines()[-1] == "posefit: seeds must be at least 1, got 0"


def states(film: activities.Film, probability: float = 0.9, **changes: Any) -> list[ModelState]:
    """Return what a tracker tells that is always right and has one group an activity."""
    groups = {one.label: tuple(sorted(one.models)) for one in activities.ACTIVITIES}
    every = []
    for label in film.labels:
        name = activities.ACTIVITIES[label].label
        shares = np.full(len(groups[name]), (1.0 - probability) / max(len(groups[name]) - 1, 1))
        shares[0] = probability
        nothing = np.empty(0)
        one = ModelState(groups, name, None, groups[name], shares, False, 0, 0.001, 0.002, nothing, nothing)
        every.append(replace(one, **changes))
    return every


def test_a_tracker_that_is_always_right_makes_no_mistake(film: activities.Film) -> None:
    figures = switching_figures(film, states(film))
    assert figures["dominant_fraction"] == figures["right_model_fraction"] == 1.0
    assert figures["switch_delays_frames"] == [0, 0, 0]
    assert figures["wrong_activations"] == figures["wrong_terminations"] == figures["activations"] == 0
    assert (figures["filter_ms"], figures["detection_ms"]) == (1.0, 2.0)


def test_a_group_that_never_changes_is_late_by_whole_activities(film: activities.Film) -> None:
    right = states(film)
    # waving and striding shares the model `walk` with stepping; jumping jacks, 140 frames, and squat, 60, do not
    figures = switching_figures(film, [right[0]] * len(right))
    assert figures["switch_delays_frames"] == [0, 140, 60]
    assert figures["switch_delay_frames"] == 140


def test_a_newcomer_without_a_right_model_is_a_wrong_activation(film: activities.Film) -> None:
    every = states(film)
    every[5] = replace(every[5], newcomer="squat")
    figures = switching_figures(film, every)
    assert (figures["activations"], figures["wrong_activations"]) == (1, 1)


def test_a_tracker_without_models_tells_nothing(film: activities.Film) -> None:
    frame = Frame(np.zeros(66), np.zeros(3), 0.0, np.zeros((1, 3), dtype=np.int64), 1, 0.0, np.zeros(1))
    assert model_states([frame]) == []
    assert switching_figures(film, []) == {}


@pytest.fixture(scope="module")
def film() -> activities.Film:
    return film_of(0)
