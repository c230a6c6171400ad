"""Writes a new plugin to start from: a package that installs, works and has a test."""

import re
from collections.abc import Sequence
from importlib.resources import files
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path
from string import Template

from posefit.errors import InputError
from posefit.files import new_folder
from posefit.fitting.check import one_of
from posefit.hooks import PROJECT
from posefit.reading import quoted
from posefit.registry import CHECKED_KINDS, COMMAND, Registrable, plugins_of, registry

TAKEN = {"Frame"}  # names that a template's module uses itself


def write_plugin(
    name: str,
    kind: Registrable,
    folder: str | Path | None = None,
    commands: Sequence[str] = (),
) -> Path:
    """Write a small installable plugin, and return its folder.

    Args:
        name: The plugin's name.
        kind: Optimiser, prior, tracker, start, segmenter or command.
        folder: The new folder, by default `posefit-NAME`.
        commands: Names of posefit's own commands, which a new one cannot have.

    Raises:
        InputError: The name cannot be a plugin's, or the folder exists.
    """
    one_of("kind", kind, (*CHECKED_KINDS, COMMAND))
    if not re.fullmatch(r"[a-z][a-z0-9]*([-_][a-z0-9]+)*", name):
        raise InputError(
            "name must be lower-case letters, digits, - and _, and begin with a letter"
            f", got {quoted(name)}"
        )
    if name in (known := _taken(kind, commands)):
        raise InputError(
            f"name must be new, got {name!r}, which {known[name]} already registers"
        )
    module = name.replace("-", "_")
    # an installed module of that name would be imported instead, or be hidden
    if (there := find_spec(f"{PROJECT}_{module}")) is not None:
        raise InputError(
            f"name must give a new module, got {name!r}: "
            f"its module {there.name} would hide the module of that name in "
            f"{there.origin or 'sys.path'}"
        )
    class_name = "".join(part.capitalize() for part in module.split("_"))
    # a plugin may be called `none` or `frame`
    if class_name in TAKEN or iskeyword(class_name):
        class_name += kind.capitalize()
    used = {
        COMMAND: name,
        "segmenter": f"extract VIDEO --out masks --extraction {name}",
        "start": f"fit MASK.png --height 1.75 --set tracker.start={name}",
    }.get(kind, f"track walk --method {'@' if kind == 'prior' else ''}{name}")
    usage = f"posefit {used}"
    if kind != COMMAND:
        usage = f"posefit check {kind} {name}\n{usage}"
    words = {
        "name": name,
        "kind": kind,
        "module": module,
        "dashed": name.replace("_", "-"),
        "class_name": class_name,
        "usage": usage,
    }
    target = Path(folder or f"posefit-{words['dashed']}")
    target.parent.mkdir(parents=True, exist_ok=True)
    with new_folder(target) as building:
        # `posefit check` has no rules for a command
        test = COMMAND if kind == COMMAND else "kit"
        written = {
            "pyproject.toml": "pyproject.toml",
            "README.md": "README.md",
            f"{kind}.py": f"posefit_{module}.py",
            f"{test}_test.py": f"test_{module}.py",
        }
        for template, file_name in written.items():
            source = files("posefit") / "templates" / f"{template}.txt"
            text = Template(source.read_text(encoding="utf-8")).substitute(words)
            (building / file_name).write_text(text, encoding="utf-8")
    return target


def _taken(kind: Registrable, commands: Sequence[str]) -> dict[str, str]:
    """Return the names that are taken, each with its distribution."""
    taken: dict[str, str] = {}
    if kind != COMMAND:
        for offer in registry().offers[kind].values():
            taken[offer.name] = offer.distribution
        return taken
    taken = dict.fromkeys(commands, PROJECT)
    for plugin in plugins_of((COMMAND,), tuple(commands)):
        for command in plugin.commands:
            taken[str(command.name)] = plugin.distribution
    return taken
