"""README begins with what .ci/run runs, and its optimiser keeps every rule; tests/docs runs its blocks."""

import re
from pathlib import Path
from typing import Any

from posefit.testing import check_optimiser

README = Path(__file__).parents[1] / "README.md"
TEXT = README.read_text("utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)


def test_ci_runs_its_commands() -> None:
    first, second = blocks("sh")
    assert first.startswith(
        "python -m pip install -e . && posefit track walk --out walk && posefit sweep default "
    )
    assert second == "python -m pip install -e '.[test]' && python -m pytest\n"


def test_its_links_exist() -> None:
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", TEXT)
    assert len(links) > 10
    assert [
        link
        for link in links
        if not link.startswith("http") and not (README.parent / link).exists()
    ] == []


def test_its_optimiser_keeps_every_rule() -> None:
    code = next(block for block in blocks("python") if "class Spiral" in block)
    names: dict[str, Any] = {"__name__": "spiral"}
    exec(code, names)
    report = check_optimiser(names["Spiral"])
    # a class without a module cannot be pickled
    assert {one.name for one in report.of("failed")} <= {"copies"}, str(report)
