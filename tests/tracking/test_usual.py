"""What a source is followed with, and what that learns from, where nobody says."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

import posefit
from posefit.cli import main
from posefit.footage.source import Viewing, scene_of
from posefit.motion import recorded
from posefit.registry import Registry
from posefit.tracking import method
from posefit.tracking.method import usual

WALKS = ("walk-a", "walk-b", "walk-c")
SEARCH = {"optimiser": "sapso", "prior": "loose"}
FOLLOWED = {"tracker": "exemplars"}


@pytest.mark.parametrize(
    ("source", "named", "method", "train"),
    [
        ("walk", {}, {"optimiser": "sapso", "prior": "pca"}, WALKS),
        ("run-a", {}, {"optimiser": "sapso", "prior": "pca"}, ("run-b",)),
        ("16_15", {}, {"optimiser": "sapso", "prior": "pca"}, WALKS),
        ("16_15.amc", {"tracker": "exemplars"}, FOLLOWED, WALKS),
        ("16_15", {"train": ["library"]}, {"optimiser": "sapso", "prior": "pca"}, ["library"]),
        ("a.mp4", {}, FOLLOWED, ["library"]),
        ("a.npz", {}, FOLLOWED, ["library"]),
        ("masks/", {"tracker": "exemplars"}, FOLLOWED, ["library"]),
        ("a.npz", {"train": ["library:-16"]}, FOLLOWED, ["library:-16"]),
        ("a.npz", {"optimiser": "annealed"}, {"optimiser": "annealed", "prior": "loose"}, WALKS),
        ("a.npz", {"prior": "pca"}, {"optimiser": "sapso", "prior": "pca"}, WALKS),
        ("a.npz", {"searched": True}, SEARCH, WALKS),
        ("a.npz", {"tracker": "vsmm"}, {"tracker": "vsmm"}, WALKS),
    ],
)
def test_what_is_left_open(source: str, named: dict[str, Any], method: dict[str, str], train: Any) -> None:
    found = usual(source, **named)
    assert found.method == method
    assert found.train == train
    # what was decided decides the same again
    again = usual(source, **found.method, **({"train": named["train"]} if "train" in named else {}))
    assert (again.method, again.train) == (method, train)


def test_footage_is_searched_where_the_tracker_is_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(method, "registry", lambda: Registry(()))
    assert usual("a.npz").method == SEARCH
    assert usual("a.npz").train == WALKS


@pytest.mark.parametrize("named", [{"optimiser": "sapso"}, {"prior": "pca"}])
def test_a_tracker_has_no_optimiser_and_no_prior(named: dict[str, str]) -> None:
    (name, value) = next(iter(named.items()))
    message = f"{name} must not be given beside a tracker, got {value} and vsmm"
    with pytest.raises(ValueError, match=message):
        posefit.track("walk", tracker="vsmm", **named)  # type: ignore[arg-type]
    done = CliRunner().invoke(main, ["track", "walk", "--tracker", "vsmm", f"--{name}", value])
    assert (done.exit_code, done.stderr) == (2, f"posefit: {message}\n")


@pytest.fixture(scope="module")
def masks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("seen") / "masks.npz"
    scene = scene_of(["09_01"], Viewing(frames=(0, 8), size=(120, 90)))
    np.savez(path, masks=np.array([seen.silhouettes[0].mask for seen in scene.observations]))
    return path


def test_masks_are_followed_through_the_library_once_and_a_build_is_fitted(masks: Path) -> None:
    said: list[str] = []
    track = posefit.track(masks, evaluations=400, body_frames=5, say=said.append)
    assert track.summary["method"] == "exemplars"
    assert track.summary["train"] == [one.name for one in recorded.clips()]
    assert track.summary["body"] is not None
    assert not any("looking for the first pose" in one for one in said)
    assert "fitting the person's build to 5 frames" in said


def test_restarts_that_are_asked_for_are_made(masks: Path) -> None:
    said: list[str] = []
    posefit.track(masks, train=["walk-a"], evaluations=400, restarts=1, body_frames=0, say=said.append)
    assert "looking for the first pose, 1 times" in said


@pytest.mark.parametrize(
    ("words", "method"),
    [
        ([], "exemplars"),
        (["--tracker", "exemplars"], "exemplars"),
        (["--set", "exemplars.lag=0"], "exemplars"),
        (["--set", "sapso.cooling=0.9"], "sapso + loose"),
        (["--set", "tracker.floor=0.1"], "sapso + loose"),
    ],
)
def test_settings_say_whose_they_are(masks: Path, words: list[str], method: str) -> None:
    quick = ["--train", "walk-a", "--frames", "0:2", "--evaluations", "400", "--restarts", "1", "--body-frames", "0"]
    done = CliRunner().invoke(main, ["track", str(masks), *quick, *words])
    assert done.exit_code == 0, done.output
    assert f": 2 frames, {method}, " in done.stdout


def test_somebody_is_left_out_of_the_library_that_is_learned_from_by_default(masks: Path) -> None:
    quick = ["--evaluations", "400", "--body-frames", "0", "--frames", "0:2", "--json"]
    others = [f"--without-subject={one}" for one in recorded.subjects() if one != "17"]
    done = CliRunner().invoke(main, ["track", str(masks), *quick, *others])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["train"] == ["17_03", "17_10"]
