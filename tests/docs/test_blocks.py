"""Every block of code in README and the handbook runs, or says why it does not and is right as far as can be checked."""

import contextlib
import io
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from _pytest.mark import ParameterSet

from posefit.sweep.plan import Plan
from tests.docs import films, printed, shell
from tests.docs.pages import ROOT, RUN, SHOWN, Block, blocks, pages, sentences

BLOCKS = [block for page in pages() for block in blocks(page)]
# pages that take seconds of a processor
SLOW = (
    *(
        f"docs/{page}.md"
        for page in ("ways/sweep", "howto/suite", "howto/masks", "howto/report")
    ),
    *(
        "docs/reference/settings.md",
        "docs/notebooks/array_to_angles.ipynb",
        "docs/notebooks/learner.ipynb",
    ),
)
VIDEO = ROOT.parent / "shared/data/video/sports2d_walk"
# pages whose blocks make a package that has to be installed, with its name
PACKAGES = {"docs/ways/optimiser.md": "spiral", "docs/howto/plugin.md": "screen"}
_COMMAND = re.compile(r"`((?:[A-Z_]+=\S+ )?(?:posefit|python) [^`\n]+)`")


def _run() -> Iterator[ParameterSet]:
    """Yield every page with a block that is run, and once more where some of its blocks are run in a slow run alone."""
    marks: dict[str, set[str]] = {}
    for block in BLOCKS:
        if block.language in RUN and block.mark != "not run":
            marks.setdefault(block.page, set()).add(block.mark)
    for page, values in marks.items():
        slow = page in SLOW
        if not slow and values != {"nightly"}:
            yield pytest.param(page, False, id=page)
        if slow or "nightly" in values:
            yield pytest.param(page, True, id=f"{page} nightly", marks=pytest.mark.slow)


@pytest.mark.parametrize(("page", "whole"), list(_run()))
def test_the_blocks_of_a_page_run_in_order_and_print_the_text_below_them(
    page: str, whole: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    if whole:
        _prepare(page, tmp_path, monkeypatch)
    names: dict[str, object] = {"__name__": "page"}
    output: str | None = None
    wrong = []
    for block in (block for block in BLOCKS if block.page == page):
        if block.language == "text":
            if block.mark != "not compared" and output is not None:
                wrong += printed.differences(block, output)
        elif block.mark == "not run" or (block.mark == "nightly" and not whole):
            output = None
        elif block.language == "python":
            with contextlib.redirect_stdout(io.StringIO()) as stream:
                exec(compile("\n" * block.line + block.text, page, "exec"), names)
            output = stream.getvalue()
        elif block.language == "sh":
            output = _shell(block, tmp_path)
        elif block.language == "toml":
            (tmp_path / "plan.toml").write_text(block.text, "utf-8")
            assert block.mark or len(Plan.of(tomllib.loads(block.text)))
    assert not wrong, "\n".join(wrong)


def _prepare(page: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Put in `folder` what the blocks of slow runs need.

    These are the studies, the video, films of two cameras, and the package that the
    page makes, as installed.
    """
    for name in ("docs", "tests"):
        (folder / name).symlink_to(ROOT / name)
    if VIDEO.is_dir():
        (folder / "sports2d/Sports2D").mkdir(parents=True)
        (folder / "sports2d/Sports2D/Demo").symlink_to(VIDEO)
    if page == "docs/howto/two-cameras.md":
        films.write_boards(folder)
        films.write_walks(folder)
    if page in PACKAGES:
        name = PACKAGES[page]
        site = folder / "site"
        info = site / f"posefit_{name}-0.1.0.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(
            f"Name: posefit-{name}\nVersion: 0.1.0\n", "utf-8"
        )
        (info / "entry_points.txt").write_text(
            f"[posefit]\n{name} = posefit_{name}\n", "utf-8"
        )
        path = (
            str(site),
            str(folder / f"posefit-{name}"),
            os.environ.get("PYTHONPATH", ""),
        )
        monkeypatch.setenv("PYTHONPATH", os.pathsep.join(path))


def _shell(block: Block, folder: Path) -> str:
    """Return what a block prints; what installs a package is left out."""
    tools = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    text = re.sub(
        r"^python -m pip install .*?(&& |$)", "", block.text, flags=re.MULTILINE
    )
    words = ["bash", "-euo", "pipefail", "-c", text]
    environment = {**os.environ, "PATH": tools}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    result = subprocess.run(
        words, cwd=folder, env=environment, text=True, timeout=600, **pipes
    )
    assert result.returncode == 0, f"{block}: {result.stdout[-2000:]}"
    return result.stdout


def test_blocks_have_a_known_language_and_unrun_ones_are_valid() -> None:
    for block in BLOCKS:
        assert block.language in (*RUN, *SHOWN), block
        if not block.mark:
            continue
        assert (block.mark == "not compared") == (block.language == "text"), block
        assert len(block.reason) > 10, block
        if block.language == "python":
            compile(block.text, str(block), "exec")
        elif block.language == "toml":
            tomllib.loads(block.text)
        elif block.language == "sh":
            commands = list(shell.commands(block.text))
            assert commands, block
            for words in commands:
                shell.check(words)


def test_commands_in_sentences_exist_with_their_options() -> None:
    for page, text in sentences():
        for command in _COMMAND.findall(text):
            if "NAME]" in command or "COMMAND" in command:
                continue  # names to be filled in
            for words in shell.commands(command):
                if words[-1] == "--help":
                    continue
                try:
                    shell.check(words)
                except (AssertionError, click.UsageError) as error:
                    # a command without its arguments is one that the text speaks of
                    named = isinstance(error, click.MissingParameter)
                    assert named, f"{page}: {command}: {error}"


def test_the_check_of_commands_notices_wrong_ones() -> None:
    for line in ["posefit trakc walk", "posefit track --no-such-option 1", "posefit extract video.mp4", "rm -r results",
                 "python -m posefit_reproduce.nothing", "python -m pip install -e '.[nothing]'",
                 "python docs/studies/people.py --nothing"]:  # fmt: skip
        (words,) = shell.commands(line)
        with pytest.raises((AssertionError, click.UsageError)):
            shell.check(words)


def test_printed_text_of_a_page_is_compared_or_has_a_reason() -> None:
    compared: set[str] = set()  # pages whose last block of code is run
    for block in BLOCKS:
        if block.language in ("python", "sh"):
            (compared.discard if block.mark == "not run" else compared.add)(block.page)
        elif block.language == "text" and block.mark != "not compared":
            assert block.page in compared, f"{block} follows no block that is run"


def test_explained_messages_exist() -> None:
    paths = [
        path
        for folder in ("posefit", "plugins")
        for path in (ROOT / folder).rglob("*.py")
    ]
    code = " ".join(path.read_text("utf-8") for path in paths)
    code = re.sub(r'"\s*f?"', "", code)  # of a text over several lines
    page = (ROOT / "docs/howto/troubleshooting.md").read_text("utf-8")
    messages = re.findall(r"^\| `([^`]+)`", page, re.MULTILINE)
    assert len(messages) > 15
    parts = [
        (message, part.strip()) for message in messages for part in message.split("...")
    ]
    assert [message for message, part in parts if part not in code] == []


def test_words_and_counts_are_compared_exactly_and_figures_roughly() -> None:
    for shown, line, holds in (
        (
            "error 1.21 degrees, 5.6 ms a frame",
            "error 1.04 degrees, 90.1 ms a frame",
            True,
        ),
        ("cost 1.65 after 2440 proposals", "cost 6.91 after 2440 proposals", False),
        ("20 checks ran, 1 failed", "20 checks ran, 2 failed", False),
        ("10 poses, toe 269", "10 poses, toe 281", True),
        ("MPJPE 18 mm, lost 0 % of frames", "MPJPE 17 mm, lost 0 % of frames", True),
        ("build: 1.65 m, feet 0.95, ...", "build: 1.66 m, feet 0.94, hands 1.02", True),
        ("error 1.21", "errors 1.21", False),
    ):
        assert printed.same(shown, line) == holds, shown


def test_pages_import_posefit_and_its_plugin_module_alone() -> None:
    deep = [
        str(block)
        for block in BLOCKS
        if re.search(r"(from|import) posefit\.(?!plugin\b)", block.text)
    ]
    assert deep == []
