"""Commands of a page that cannot be run: do they and their options exist?"""

import importlib.util
import re
import shlex
import tomllib
from collections.abc import Iterator
from importlib import import_module

import click

from posefit.cli import main
from tests.docs.pages import ROOT

TOOLS = (
    "bash",
    "cd",
    "dask",
    "ffmpeg",
    "lint-imports",
    "mypy",
    "printf",
    "ruff",
    "sphinx-build",
    "uv",
    "sqlite3",
)


def commands(text: str) -> Iterator[list[str]]:
    """Yield the words of every command of a block, without the text of its input."""
    text = re.sub(r"<<'?(\w+)'?\n.*?^\1$", "", text, flags=re.MULTILINE | re.DOTALL)
    words: list[str] = []
    for line in text.replace("\\\n", " ").splitlines():
        lexer = shlex.shlex(line, posix=True, punctuation_chars="&|;")
        lexer.whitespace_split = True
        for word in [*lexer, ";"]:
            if set(word) <= set("&|;"):
                if words:
                    yield words
                words = []
            else:
                words.append(word)


def check(words: list[str]) -> None:
    """Raise AssertionError or click.UsageError where a command is not one."""
    # what a variable of the environment is for this command
    while re.fullmatch(r"[A-Z_]+=\S*", words[0]):
        words = words[1:]
    name, *rest = words
    if name == "posefit":
        _check_posefit(main, rest)
    elif words[:4] == ["python", "-m", "pip", "install"]:
        _check_extras(rest)
    elif words[:2] == ["python", "-m"]:
        assert importlib.util.find_spec(words[2]) is not None, f"no module {words[2]}"
    elif name == "python":
        path = ROOT / words[1]
        assert path.exists(), f"no file {words[1]}"
        study = None
        if path.parent.name == "studies":
            study = getattr(import_module(path.stem), "main", None)
        if isinstance(study, click.Command):
            command, _ = _innermost(study, words[2:])
            options = {
                option for parameter in command.params for option in parameter.opts
            }
            assert {word for word in words if word.startswith("--")} <= options, (
                f"an option that {path.name} lacks"
            )
    elif name == "sbatch":
        for inner in commands(rest[rest.index("--wrap") + 1]):
            check(inner)
    else:
        assert name in TOOLS, f"a command must be known to the tests, got {name}"


def _check_posefit(command: click.Command, words: list[str]) -> None:
    command, rest = _innermost(command, words)
    command.make_context(command.name, rest)


def _innermost(
    command: click.Command, words: list[str]
) -> tuple[click.Command, list[str]]:
    """Return the command of a group that words name, and the words after its name."""
    context = click.Context(command, info_name=command.name)
    while isinstance(command, click.Group) and words and not words[0].startswith("-"):
        inner = command.get_command(context, words[0])
        assert inner is not None, f"{command.name} has no command {words[0]}"
        command = inner
        words = words[1:]
    return command, list(words)


def _check_extras(words: list[str]) -> None:
    known = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"][
        "optional-dependencies"
    ]
    for word in words:
        extras = re.fullmatch(r"(\.|posefit)\[(.*)\]", word)
        for extra in extras[2].split(",") if extras else ():
            assert extra in known, f"no extra {extra}"
