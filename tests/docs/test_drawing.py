"""The drawing of the house is made from the imports, and a circle stops it."""

import house
import pytest

from posefit import __file__ as root
from tests.docs.pages import ROOT

GRAPH = house.imports()


def test_every_package_and_plugin_is_a_box() -> None:
    plugins = {path.name for folder in ("plugins", "envs") for path in (ROOT / folder).glob("posefit_*")}
    floors = {
        path.stem for path in (ROOT / "posefit").iterdir() if path.suffix == ".py" or (path / "__init__.py").is_file()
    }
    assert root.startswith(str(ROOT))
    assert set(GRAPH) == plugins | floors - {"__init__", "__main__"}


def test_no_two_packages_import_each_other() -> None:
    assert house.circle(GRAPH) == []


def test_a_circle_is_found_and_told() -> None:
    graph = {"a": frozenset("b"), "b": frozenset("cd"), "c": frozenset("a"), "d": frozenset()}
    assert house.circle(graph) == ["a", "b", "c", "a"]


def test_a_circle_is_exit_status_1(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(house, "imports", lambda: {"a": frozenset("b"), "b": frozenset("a")})
    assert house.main([]) == 1
    assert "a -> b -> a" in capsys.readouterr().err


def test_an_arrow_that_others_imply_is_left_out() -> None:
    graph = {"a": frozenset("bc"), "b": frozenset("c"), "c": frozenset()}
    assert house.reduced(graph) == {"a": frozenset("b"), "b": frozenset("c"), "c": frozenset()}


def test_the_drawing_shows_every_box_and_only_arrows_that_go_down() -> None:
    text = house.drawing()
    for box in GRAPH:
        assert box.removeprefix("posefit_") in text
    arrows, _ = house.grouped(house.reduced(GRAPH))
    height = {box: level for level, row in enumerate(house.levels(arrows)) for box in row}
    assert all(height[box] > height[one] for box, lower in arrows.items() for one in lower)


def test_the_page_of_the_house_tells_every_floor() -> None:
    page = (ROOT / "docs" / "background" / "house.md").read_text("utf-8")
    assert [box for box in GRAPH if not box.startswith("posefit_") and f"`{box}`" not in page] == []
