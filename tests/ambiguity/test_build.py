"""The build of somebody who was followed before."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from posefit.ambiguity.estimate import body_of
from posefit.cli import main
from posefit.fitting.shape import NAMES
from posefit.geometry.body import Body
from posefit.motion import built_in
from tests.cases import each

BODY = Body.of(built_in.average_skeleton())
FACTORS = dict.fromkeys(NAMES, 1.0)


def folder(path: Path, summary: object) -> Path:
    (path / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    return path


def told(stature: object = 1.8, **factors: Any) -> dict[str, Any]:
    return {"body": {"stature": stature, "factors": FACTORS | factors}}


def test_a_person_of_average_build_is_the_average_body_at_his_height(tmp_path: Path) -> None:
    body = body_of(folder(tmp_path, told(1.8)), BODY)
    assert body.stature == pytest.approx(1.8)
    np.testing.assert_allclose(body.radii / BODY.radii, 1.8 / BODY.stature)
    np.testing.assert_allclose(body.skeleton.lengths / BODY.skeleton.lengths, 1.8 / BODY.stature)


def test_who_is_twice_as_wide_has_twice_the_radii_and_the_same_bones(tmp_path: Path) -> None:
    wide = {name: 2.0 for name in NAMES if name.endswith("girth")}
    body = body_of(folder(tmp_path, told(1.8, **wide)), BODY)
    ratio = body.skeleton.lengths[0] / BODY.skeleton.lengths[0]
    np.testing.assert_allclose(body.radii / BODY.radii, 2.0 * ratio)
    assert body.stature == pytest.approx(1.8)


@each(
    ("summary", "said"),
    [
        ({"body": None}, "expected the build of a person, got none: it was not fitted"),
        ([], "expected the build of a person, got none: it was not fitted"),
        ({}, "expected body in it, got none"),
        ({"body": {"stature": 1.8, "factors": {}}}, "expected scale in it, got none"),
        ({"body": {"factors": FACTORS}}, "expected stature in it, got none"),
        (told(18.0), "stature must lie in 0.3 to 2.8, got 18"),
        (told("tall"), "stature must be a finite number, got 'tall'"),
        (told(scale=0.0), "scale must lie in 0.1 to 10, got 0"),
        (told(scale=float("nan")), "scale must be a finite number, got nan"),
    ],
)
def test_what_is_no_build_is_a_mistake(summary: object, said: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError) as caught:
        body_of(folder(tmp_path, summary), BODY)
    assert str(caught.value) == f"{tmp_path / 'summary.json'}: {said}"


def test_a_folder_of_no_track_and_a_motion_are_mistakes_of_one_line(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"expected the folder of a track with its summary.json, got none$"):
        body_of(tmp_path, BODY)
    (tmp_path / "summary.json").write_text("{" * 100_000, encoding="utf-8")
    with pytest.raises(ValueError, match=r"summary.json: expected a JSON object, got "):
        body_of(tmp_path, BODY)
    result = CliRunner().invoke(main, ["ambiguity", "walk", "--build", str(tmp_path)])
    assert result.exit_code == 2
    assert result.stderr == f"posefit: build must be given for footage only, got '{tmp_path}' for a motion\n"
