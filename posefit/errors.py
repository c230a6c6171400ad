"""The error that a mistake of the user raises, as opposed to a fault of the program."""


def printable(text: str) -> str:
    r"""Return a text on one line: line breaks become \n, what steers a terminal is written out, too."""
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


class InputError(ValueError):
    """An argument, a setting or a file is not what it must be; the message names what was expected and what came.

    The command line shows it as one line; any other ValueError is a fault of the program and shows its traceback.
    Names from outside may be in it: it is `printable`.
    """

    def __init__(self, message: object = "") -> None:
        super().__init__(printable(str(message)))
