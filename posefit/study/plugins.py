"""What is installed, what is wrong with it, and a new one to start from."""

import os
import re
import shutil
import tempfile
import textwrap
from collections.abc import Iterator, Sequence
from importlib.resources import files
from inspect import Parameter
from pathlib import Path
from string import Template
from typing import Any

from posefit.registry import BLOCK, KINDS, LOAD, STRICT, Kind, Offer, Registry, registry
from posefit.settings import parse
from posefit.testing import Report, optimiser_checks, prior_checks, report, tracker_checks


def described(offer: Offer) -> dict[str, Any]:
    """Return what `posefit plugins --json` says of an offer."""
    settings = [
        {"name": one.name, "type": one.type, "default": None if one.default is Parameter.empty else one.default}
        for one in offer.settings
    ]
    more = {"next_frame": offer.next_frame} if offer.kind == "optimiser" else {}
    return {
        "kind": offer.kind,
        "name": offer.name,
        "distribution": offer.distribution,
        "version": offer.version,
        "summary": offer.summary,
        "install": offer.missing,
        **more,
        "settings": settings,
    }


def listing(found: Registry) -> Iterator[str]:
    """Yield the lines of `posefit plugins`."""
    width = min(shutil.get_terminal_size((100, 24)).columns, 120)
    for kind in KINDS:
        for offer in found.offers[kind].values():
            missing = f" [not installed: python -m pip install '{offer.missing}']" if offer.missing else ""
            yield f"{kind} {offer.name} ({offer.distribution} {offer.version}){missing}"
            yield from textwrap.wrap(offer.summary, width, initial_indent="    ", subsequent_indent="    ")
            settings = ", ".join(
                f"{one.name}: {one.type}" + ("" if one.default is Parameter.empty else f" = {one.default}")
                for one in offer.settings
            )
            yield from textwrap.wrap(settings, width, initial_indent="    --set ", subsequent_indent="          ")


def diagnosis(found: Registry) -> tuple[list[str], bool]:
    """Return what `posefit plugins doctor` says, and whether all is well."""
    lines = [f"{name}={os.environ[name]!r}" for name in (LOAD, BLOCK, STRICT) if name in os.environ]
    for plugin in found.plugins:
        names = ", ".join(f"{offer.kind} {offer.name}" for offer in plugin.offers) or "nothing"
        said = plugin.cause or f"offers {names}"
        lines.append(f"{plugin.state:8}  {plugin.name} ({plugin.distribution} {plugin.version}): {said}")
        for offer in plugin.offers:
            if offer.missing:
                lines.append(f"          {offer.name} is not usable yet: python -m pip install '{offer.missing}'")
            if not offer.summary:
                lines.append(f"          {offer.name} has no docstring to be listed with")
    well = all(plugin.state != "broken" for plugin in found.plugins)
    lines.append("all plugins work" if well else "broken plugins are left out; the others work")
    return lines, well


def checked(kind: Kind, name: str, texts: Sequence[str]) -> Report:
    """Return what the checks say of an installed plugin, with settings given as `SETTING=VALUE`."""
    offer = registry().offer(kind, name)
    given = {}
    for text in texts:
        setting, equals, value = text.partition("=")
        if not equals:
            raise ValueError(f"--set must be SETTING=VALUE such as particles=20, got {text!r}")
        given[setting.rpartition(".")[2]] = value
    settings = parse(offer.name, offer.factory, given)
    if kind == "prior" and settings:
        offer.factory(**settings)  # a value that makes no sense is one mistake, not one a check
    checks = {
        "optimiser": lambda: optimiser_checks(offer.factory, next_frame=offer.next_frame, settings=settings),
        "prior": lambda: prior_checks(offer.factory, settings=settings),
        "tracker": lambda: tracker_checks(offer.factory, settings=settings),
    }[kind]()
    return report(offer.label, checks)


def new(name: str, kind: Kind, folder: str | Path | None = None) -> Path:
    """Return the new folder with a small installable plugin, `posefit-NAME` unless another is given.

    Raises ValueError where the name cannot be a plugin's, or the folder is there already.
    """
    if kind not in KINDS:
        raise ValueError(f"kind must be one of {', '.join(KINDS)}, got {kind!r}")
    if not re.fullmatch(r"[a-z][a-z0-9]*([-_][a-z0-9]+)*", name):
        raise ValueError(f"name must be small letters, digits, - and _, and begin with a letter, got {name!r}")
    if name in (known := registry().offers[kind]):
        raise ValueError(f"name must be a new one, got {name!r}, which {known[name].distribution} registers already")
    module = name.replace("-", "_")
    words = {
        "name": name,
        "kind": kind,
        "module": module,
        "dashed": name.replace("_", "-"),
        "class_name": "".join(part.capitalize() for part in module.split("_")),
        "option": f"{kind} {name}",
    }
    target = Path(folder or f"posefit-{words['dashed']}")
    if target.exists():
        raise ValueError(f"{target}: expected a new folder, got one that exists")
    target.parent.mkdir(parents=True, exist_ok=True)
    building = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    try:
        for template, name in (
            ("pyproject.toml", "pyproject.toml"),
            ("README.md", "README.md"),
            (f"{kind}.py", f"posefit_{module}.py"),
            ("test.py", f"test_{module}.py"),
        ):
            text = (files("posefit") / "templates" / f"{template}.txt").read_text(encoding="utf-8")
            (building / name).write_text(Template(text).substitute(words), encoding="utf-8")
        building.chmod(0o755)
        building.rename(target)
    except BaseException:
        shutil.rmtree(building, ignore_errors=True)
        raise
    return target
