"""The functions of `posefit.plugin`, each with its signature and what it returns: their docstrings."""

import inspect

import posefit.plugin

CHECKS = "check_"  # what begins so is the kit, which the page shows in use


def page() -> str:
    """Return a table of the functions."""
    functions = {name: getattr(posefit.plugin, name) for name in posefit.plugin.__all__}
    lines = ["| function | what it returns |", "|---|---|"]
    for name, function in functions.items():
        if inspect.isfunction(function) and not name.startswith(CHECKS):
            lines.append(f"| `{name}({_parameters(function)})` | {_summary(function)} |")
    return "\n".join(lines)


def _parameters(function: object) -> str:
    """Return the names of a function's parameters, with their defaults."""
    signature = inspect.signature(function)  # type: ignore[arg-type]
    bare = [one.replace(annotation=inspect.Parameter.empty) for one in signature.parameters.values()]
    text = str(inspect.Signature(bare))[1:-1]
    return text.replace("|", "\\|")


def _summary(function: object) -> str:
    """Return the first paragraph of a function's docstring, and what it raises."""
    paragraphs = (inspect.getdoc(function) or "").split("\n\n")
    raises = [" ".join(text.split()) for text in paragraphs[1:] if text.lstrip().startswith("Raises")]
    text = " ".join([" ".join(paragraphs[0].split()), *raises]).replace("|", "\\|")
    return text.removeprefix("Return ").removeprefix("nothing. ")
