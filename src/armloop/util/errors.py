"""The exceptions a user can meet.

All errors mean that the input is at fault. Their message is one line that names the file, the column or the
row, says what is wrong and what would be right; the command line prints it and ends with status 2.
"""

#: Characters of a message; of one that a file's name makes longer the middle is left out.
_LONGEST = 960


def one_line(text: str) -> str:
    """The text in one line; characters that a terminal would obey (a file's name may hold them) are spelt out."""
    text = " ".join(text.split())
    text = "".join(x if x.isprintable() else x.encode("unicode_escape").decode() for x in text)
    half = _LONGEST // 2
    return text if len(text) <= _LONGEST else f"{text[:half]} … {text[-half:]}"


class InputError(ValueError):
    """The input is at fault; its text is one line: where, what is wrong and what would be right."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


class LogError(InputError):
    """A motion log cannot be read, or what it holds is not a motion."""


class ArmError(InputError):
    """An arm's description is missing or broken, or it is not the arm that was asked for."""


class ModelError(InputError):
    """A model file is missing or broken, or it was made for another arm."""


class ScenarioError(InputError):
    """A scenario file is missing, or one of its fields is unknown, absent or out of range."""


class ExcitationError(InputError):
    """The data move too little to determine what was asked of them."""


class InputWarning(UserWarning):
    """The input is doubtful: one line that says what, with the numbers. The work goes on."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))
