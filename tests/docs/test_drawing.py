"""The drawing of the packages is made from their imports, and a circle stops it."""

import architecture
import pytest

from tests.docs.pages import DOCS


def test_a_circle_is_reported(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    graph = {"a": frozenset("b"), "b": frozenset("cd"), "c": frozenset("a"), "d": frozenset()}
    assert architecture.circle(graph) == ["a", "b", "c", "a"]
    monkeypatch.setattr(architecture, "imports", lambda: graph)
    assert architecture.main([]) == 1
    assert "a -> b -> c -> a" in capsys.readouterr().err


def test_an_arrow_that_others_imply_is_left_out() -> None:
    graph = {"a": frozenset("bc"), "b": frozenset("c"), "c": frozenset()}
    assert architecture.reduced(graph) == {"a": frozenset("b"), "b": frozenset("c"), "c": frozenset()}


def test_the_drawing_and_the_page_show_every_package() -> None:
    graph, text = architecture.imports(), architecture.drawing()
    page = (DOCS / "background" / "architecture.md").read_text("utf-8")
    for box in graph:
        assert box.removeprefix("posefit_") in text, box
        assert box.startswith("posefit_") or f"`{box}`" in page, box
    arrows, _ = architecture.grouped(architecture.reduced(graph))
    height = {box: level for level, row in enumerate(architecture.levels(arrows)) for box in row}
    assert all(height[box] > height[one] for box, lower in arrows.items() for one in lower)
