"""The planted plugins, as a plugin that is installed: each class under its name in small letters, words by dashes."""

import re
from pathlib import Path
from typing import Any

from posefit import hookimpl
from tests.testing import planted


def named(kind: type) -> str:
    """Return the name that a planted class is registered under."""
    return re.sub(r"(?<!^)(?=[A-Z])", "-", kind.__name__).lower()


def install(folder: Path, module: str = __name__, name: str = "sabotage") -> Path:
    """Return the folder with a distribution `posefit-NAME` 1.0 in it, whose plugin is a module."""
    metadata = folder / f"posefit_{name}-1.0.dist-info"
    metadata.mkdir(parents=True)
    (metadata / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: posefit-{name}\nVersion: 1.0\n"
    )
    (metadata / "entry_points.txt").write_text(f"[posefit]\n{name} = {module}\n")
    return folder


@hookimpl
def posefit_register_optimisers(register: Any) -> None:
    for kind in (
        *planted.OPTIMISERS,
        *planted.RIGHT,
        *planted.APART,
        planted.LeavesAThread,
    ):
        register(named(kind), kind)


@hookimpl
def posefit_register_priors(register: Any) -> None:
    for kind in (*planted.PRIORS, planted.Unhurried):
        register(named(kind), kind)


@hookimpl
def posefit_register_trackers(register: Any) -> None:
    for kind in (planted.Holds, *planted.TRACKERS):
        register(named(kind), kind)
