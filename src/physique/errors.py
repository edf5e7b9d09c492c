"""The one exception that bad input raises, and the sentence it must be able to say."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class InputError(ValueError):
    """Input that cannot be used: a file, an option or a value.

    Its text is one line that says where the fault is, what was found, what was expected and what
    to do. The command line prints it and exits with code 2.
    """

    def __init__(self, place: str, found: str, expected: str, remedy: str) -> None:
        self.place, self.found, self.expected, self.remedy = place, found, expected, remedy
        text = f"{place}: found {found}; expected {expected}; {remedy}"
        super().__init__(" ".join(text.split()))

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, str, str]]:
        # An exception is unpickled from its text alone, unless told otherwise.
        return type(self), (self.place, self.found, self.expected, self.remedy)


def suggest(word: str, known: Iterable[str], otherwise: str) -> str:
    """A remedy for a name that is not there: the nearest of those that are, or the other one."""
    names = {name.lstrip("-"): name for name in known}  # dashes are no likeness
    near = get_close_matches(word.lstrip("-"), list(names), n=1)
    return f"did you mean {names[near[0]]!r}?" if near else otherwise


def reason(fault: OSError) -> str:
    """What the system says, without the errno and the path, e.g. "no such file or directory"."""
    return (fault.strerror or str(fault)).lower()
