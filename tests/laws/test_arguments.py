"""Arguments of any library's kind are what Python's own are, or are refused before any work.

A line of `EQUAL` is an option and forms of one value. The first form is Python's own; each of the others gives the same
options, or an InputError.
"""

import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.errors import InputError
from posefit.output.identity import digest_of
from posefit.progress import QUIET
from posefit.tracking.front import _ARGUMENTS
from posefit.tracking.keywords import FitKeywords, TrackKeywords
from posefit.tracking.options import TrackOptions
from tests.laws.sources import FPS, QUICK, Tensor, camera, masks

EQUAL: dict[str, list[Any]] = {
    "frames": [
        (2, 6),
        [2, 6],
        np.array([2, 6]),
        (np.int64(2), np.uint8(6)),
        Tensor([2, 6]),
    ],
    "view_degrees": [
        90.0,
        90,
        [90],
        (np.float32(90.0),),
        np.float64(90.0),
        np.int64(90),
        np.array(90.0),
        np.array([90]),
        Tensor(90.0),
        Tensor([90.0]),
    ],
    "size": [(64, 48), [64, 48], np.array([64, 48]), Tensor([64, 48])],
    "fps": [25.0, 25, np.float32(25.0), np.int64(25), np.array(25.0), Tensor(25.0)],
    "height": [2.0, 2, np.float32(2.0), np.array(2.0), Tensor(2.0)],
    "rate": [120.0, 120, np.float64(120.0), np.uint8(120)],
    "holes": [0.5, np.float16(0.5), np.array(0.5)],
    "label": [3, np.uint8(3), np.array(3), Tensor(3)],
    "person": [2, np.int32(2)],
    "evaluations": [400, np.int64(400), np.array(400), Tensor(400)],
    "restarts": [0, np.int64(0)],
    "body_frames": [0, np.uint16(0)],
    "hypotheses": [1, np.int8(1)],
    "seed": [5, np.int64(5), np.array(5)],
    "threads": [1, np.int64(1)],
    "smooth": [False, np.False_, np.array(False), Tensor(False)],
    "train": [["walk"], ("walk",)],
    "method": ["sapso@pca", np.str_("sapso@pca")],
}
# values of another kind, which no option takes
WRONG: dict[str, list[Any]] = {
    "frames": [(2.5, 6), 5, "2:6", np.array([[2, 6]]), (True, 6)],
    "view_degrees": ["90", [[90]], np.array([[90.0]]), [True]],
    "size": [64, (64.5, 48), np.array([64.0])],
    "camera": [5, [5], np.zeros((3, 3))],
    "asf": [5, ["a.asf"]],
    "smooth": ["no", 1, 0.0],
    "extraction": ["mixture", {"method": "mixture"}],
    "train": ["walk", 5],
    "label": [2.5, "2"],
    "seed": [0.5, -1, True],
}


@pytest.mark.parametrize("name", EQUAL)
def test_forms_of_one_value_are_equal_or_refused(name: str) -> None:
    first, *others = EQUAL[name]
    wanted = getattr(TrackOptions(**{name: first}), name)
    for form in others:
        try:
            came = getattr(TrackOptions(**{name: form}), name)
        except InputError as error:
            assert name in str(error)
            continue
        assert _plain(came) == _plain(wanted), repr(form)
        # so that a track that was begun with one form goes on with another
        assert digest_of(came)["digest"] == digest_of(wanted)["digest"], repr(form)


def _plain(value: Any) -> Any:
    """Return a value as a summary holds it. Fails where that is no JSON."""
    return json.loads(json.dumps(value))


@pytest.mark.parametrize("name", WRONG)
def test_values_of_another_kind_are_refused_by_name(name: str) -> None:
    for value in WRONG[name]:
        with pytest.raises(InputError, match=name):
            TrackOptions(**{name: value})


def test_a_track_with_numpys_arguments_is_written(tmp_path: Path) -> None:
    how: dict[str, Any] = {**QUICK, "camera": camera(), "progress": QUIET}
    given = {
        "fps": np.float32(FPS),
        "frames": np.array([2, 4]),
        "view_degrees": np.array([60.0]),
        "height": np.float64(1.75),
        "seed": np.int64(1),
        "smooth": np.False_,
    }
    plain = {name: value.tolist() for name, value in given.items()}
    theirs = posefit.track(masks(), out=tmp_path / "out", **how, **given)
    ours = posefit.track(masks(), **how, **plain)
    np.testing.assert_array_equal(theirs.motion.poses, ours.motion.poses)
    written = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert written["frames_chosen"] == [2, 4]
    assert written["view_degrees"] == [60.0]


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ([], "source must not be an empty list"),
        ([[]], "source must have image files or masks in the list of each camera"),
        ([[1, 2], [3, 4]], "source must have image files or masks"),
        ({"a.png"}, "source must be a motion, masks, a video or a list of these"),
        (5, "source must be a motion, masks, a video or a list of these, got 5"),
        (None, "source must be a motion, masks, a video or a list of these, got None"),
        ((name for name in "ab"), "source must be a motion, masks"),
        (
            [np.zeros((4, 4), bool), np.zeros((5, 4), bool)],
            "masks must have one shape, got",
        ),
        ([["a.png", "b.npz"]], "source must have image files or masks in the list"),
    ],
)
def test_a_file_that_is_not_a_source_is_refused_before_any_work(
    source: Any, message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message):
        posefit.track(source, out=tmp_path / "out", progress=QUIET, **QUICK)
    assert not list(tmp_path.iterdir())


def test_type_checkers_know_every_option_with_its_type() -> None:
    def names_and_types(hints: Mapping[str, Any]) -> dict[str, str]:
        types = {}
        for name, hint in hints.items():
            types[name] = str(getattr(hint, "__forward_arg__", hint)).strip("'\"")
        return types

    options = names_and_types({each.name: each.type for each in fields(TrackOptions)})
    assert names_and_types(TrackKeywords.__annotations__) == options
    of_fit = names_and_types(FitKeywords.__annotations__)
    assert of_fit.keys() - options.keys() == set(_ARGUMENTS)
    assert options.keys() - of_fit.keys() == {"frames"}
