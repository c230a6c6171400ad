"""Errors of a user's mistakes, as opposed to faults of the program, and a warning."""

import re
import warnings
from typing import Any

STOPPED = 130  # exit status of a program that Ctrl-C ended
_LONG = re.compile(r"\S{300,}")  # longer than the name of a file may be


def printable(text: str) -> str:
    r"""Return a text on one line, without control characters.

    Line breaks become \n, and characters that control a terminal are written out. A
    word that is too long for a name loses its middle, so that 80 characters remain.
    """
    text = _LONG.sub(lambda word: f"{word[0][:38]}...{word[0][-39:]}", text)
    if text.isprintable():
        return text
    signs = []
    for sign in text:
        if not sign.isprintable():
            sign = sign.encode("unicode_escape").decode()
        signs.append(sign)
    return "".join(signs)


class InputError(ValueError):
    """An argument, a setting or a file is invalid.

    The message has the expected and the actual value. The command line shows it as one
    line; any other ValueError is a fault of the program and shows its traceback. The
    message may contain names from outside, and so it is made `printable`.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(printable(str(message)))


class NoPersonError(InputError):
    """Masks do not show the person; another segmenter may find them."""


class PluginWarning(UserWarning):
    """A plugin is left out. The message, on one line, names it and says why."""

    def __init__(self, message: object = "") -> None:
        super().__init__(printable(" ".join(str(message).split())))


def warn_in_one_line() -> None:
    """Show each `PluginWarning` as one line, without the place in the source."""
    usual = warnings.formatwarning

    def formatted(message: Any, category: type[Warning], *place: Any) -> str:
        if issubclass(category, PluginWarning):
            return f"posefit: {message}\n"
        return usual(message, category, *place)

    warnings.formatwarning = formatted  # type: ignore[assignment]
