"""What a mistake of the user raises, as opposed to a fault of the program, and the warning that a plugin is broken."""

import re
import warnings
from typing import Any

STOPPED = 130  # the exit status of a program that Ctrl-C ended
_LONG = re.compile(r"\S{300,}")  # longer than any one name of a file


def printable(text: str) -> str:
    r"""Return a text on one line: line breaks become \n, what steers a terminal is written out, too.

    The middle of what is too long to be a name is left out, so that 80 characters remain.
    """
    text = _LONG.sub(lambda word: f"{word[0][:38]}...{word[0][-39:]}", text)
    if text.isprintable():
        return text
    return "".join(
        sign if sign.isprintable() else sign.encode("unicode_escape").decode()
        for sign in text
    )


class InputError(ValueError):
    """An argument, a setting or a file is not what it must be; the message names what was expected and what came.

    The command line shows it as one line; any other ValueError is a fault of the program and shows its traceback.
    Names from outside may be in it: it is `printable`.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(printable(str(message)))


class PluginWarning(UserWarning):
    """A plugin is left out; the message, on one line, names it and says why."""

    def __init__(self, message: object = "") -> None:
        super().__init__(printable(" ".join(str(message).split())))


def warn_in_one_line() -> None:
    """Have this process show a `PluginWarning` as one line, without the place in posefit where it was given."""
    usual = warnings.formatwarning

    def formatted(message: Any, category: type[Warning], *place: Any) -> str:
        if issubclass(category, PluginWarning):
            return f"posefit: {message}\n"
        return usual(message, category, *place)

    warnings.formatwarning = formatted  # type: ignore[assignment]
