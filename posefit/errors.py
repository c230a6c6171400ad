"""The error that a mistake of the user raises, as opposed to a fault of the program."""

import re

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
