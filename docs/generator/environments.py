"""The pages of the environments: their docstrings, in Markdown as in Gymnasium."""

import inspect

import gymnasium
from gymnasium.envs.registration import load_env_creator

import posefit_envs  # noqa: F401, registers them

NAMESPACE = "posefit"


def pages() -> dict[str, str]:
    """Return every environment's manual in Markdown, by name without the namespace.

    What is registered with arguments is a variant, and has no manual.
    """
    pages = {}
    for name, spec in gymnasium.registry.items():
        if spec.namespace == NAMESPACE and not spec.kwargs:
            assert isinstance(spec.entry_point, str)
            text = inspect.getdoc(load_env_creator(spec.entry_point)) or ""
            pages[name.partition("/")[2]] = f"# {name}\n\n{text}\n"
    return pages
