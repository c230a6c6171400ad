"""The error that a mistake of the user raises, as opposed to a fault of the program."""


class InputError(ValueError):
    """An argument, a setting or a file is not what it must be; the message names what was expected and what came.

    The command line shows it as one line; any other ValueError is a fault of the program and shows its traceback.
    """
