"""The page of the environments: their docstrings, which are written in Markdown as Gymnasium's are."""

import inspect
import re

from posefit_envs.configure import ConfigureEnv
from posefit_envs.fit import FitEnv
from posefit_envs.track import TrackEnv

ENVIRONMENTS = {"posefit/Fit-v0": FitEnv, "posefit/Track-v0": TrackEnv, "posefit/Configure-v0": ConfigureEnv}


def page() -> str:
    """Return the manual of every environment, as Markdown."""
    parts = []
    for name, environment in ENVIRONMENTS.items():
        text = re.sub(r"^(#+) ", r"\1# ", inspect.getdoc(environment) or "", flags=re.MULTILINE)
        parts.append(f"## `{name}`\n\n{text}")
    return "\n\n".join(parts) + "\n"
