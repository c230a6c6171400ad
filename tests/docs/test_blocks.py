"""Every block of code in README and the handbook runs, or says why it does not and is right as far as can be checked."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import click
import pytest

from posefit.sweep.plan import Plan
from tests.docs import shell
from tests.docs.pages import RUN, SHOWN, Block, blocks, pages

BLOCKS = [block for page in pages() for block in blocks(page)]
# pages that take seconds of a processor
SLOW = tuple(
    f"docs/{page}.md" for page in ("ways/sweep", "howto/ambiguity", "howto/suite", "howto/masks", "howto/settings")
)


def _run() -> list[object]:
    names = dict.fromkeys(block.page for block in BLOCKS if block.language in RUN and block.mark != "not run")
    return [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else [], id=name) for name in names]


@pytest.mark.parametrize("page", _run())
def test_the_blocks_of_a_page_run_in_order(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": "page"}
    for block in BLOCKS:
        if block.page != page or block.mark == "not run":
            continue
        if block.language == "python":
            exec(compile("\n" * block.line + block.text, page, "exec"), names)
        elif block.language == "sh":
            _shell(block, tmp_path)
        elif block.language == "toml":
            (tmp_path / "plan.toml").write_text(block.text, "utf-8")
            assert block.mark == "not a plan" or len(Plan.of(tomllib.loads(block.text)))


def _shell(block: Block, folder: Path) -> None:
    tools = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    result = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", block.text],
        cwd=folder,
        env={**os.environ, "PATH": tools},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert result.returncode == 0, f"{block}: {result.stderr[-2000:]}"


def test_blocks_are_of_a_known_language_and_those_that_are_not_run_are_right() -> None:
    for block in BLOCKS:
        assert block.language in (*RUN, *SHOWN), block
        if not block.mark:
            continue
        assert len(block.reason) > 10, block
        if block.language == "python":
            compile(block.text, str(block), "exec")
        elif block.language == "toml":
            tomllib.loads(block.text)
        else:
            commands = list(shell.commands(block.text))
            assert commands, block
            for words in commands:
                shell.check(words)


def test_the_check_of_commands_notices_wrong_ones() -> None:
    for line in ["posefit trakc walk", "posefit track --no-such-option 1", "posefit extract video.mp4", "rm -r results",
                 "python -m posefit_reproduce.nothing", "python -m pip install -e '.[nothing]'"]:  # fmt: skip
        (words,) = shell.commands(line)
        with pytest.raises((AssertionError, click.UsageError)):
            shell.check(words)


def test_pages_import_posefit_and_its_plugin_module_alone() -> None:
    deep = [str(block) for block in BLOCKS if re.search(r"(from|import) posefit\.(?!plugin\b)", block.text)]
    assert deep == []
