"""The page of the environments: their docstrings, which are written in Markdown as Gymnasium's are."""

import inspect
import re

import gymnasium
from gymnasium.envs.registration import load_env_creator

import posefit_envs  # noqa: F401, which registers them

NAMESPACE = "posefit"


def page() -> str:
    """Return the manual of every environment, as Markdown."""
    parts = []
    for name, spec in gymnasium.registry.items():
        if spec.namespace != NAMESPACE:
            continue
        assert isinstance(spec.entry_point, str)
        text = inspect.getdoc(load_env_creator(spec.entry_point)) or ""
        parts.append(f"## `{name}`\n\n" + re.sub(r"^(#+) ", r"\1# ", text, flags=re.MULTILINE))
    return "\n\n".join(parts) + "\n"
