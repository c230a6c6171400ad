"""What the README shows works as it is shown."""

import re
from pathlib import Path
from typing import Any

from posefit.testing import check_optimiser

README = Path(__file__).parents[1] / "README.md"


def code(word: str) -> str:
    blocks: list[str] = re.findall(r"```python\n(.*?)```", README.read_text("utf-8"), re.DOTALL)
    return next(block for block in blocks if word in block)


def test_the_optimiser_of_the_readme_keeps_every_rule() -> None:
    found: dict[str, Any] = {"__name__": "spiral"}
    exec(code("class Spiral"), found)
    report = check_optimiser(found["Spiral"])
    broken = {one.name for one in report.of("failed")}
    assert broken <= {"pickled"}, str(report)  # a class without a module cannot be pickled
    assert len(code("class Spiral").splitlines()) <= 27


def test_the_pieces_of_the_readme_fit_together(capsys: Any) -> None:
    exec(code("best = minimise"), {"__name__": "pieces"})
    assert float(capsys.readouterr().out) < 15.0


def test_the_environments_of_the_readme_run(capsys: Any) -> None:
    exec(code("posefit_envs:posefit/Fit-v0"), {"__name__": "environments"})
    assert 0.0 <= float(capsys.readouterr().out) < 30.0
