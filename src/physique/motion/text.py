"""Text files of motion: decoded, in lines, of which no word is read without a look whether it is there."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from physique.errors import InputError

LARGEST = 1e9  # no unit makes a person so large; squares of such numbers stay finite
_MOST_BYTES = 1 << 30  # 3 hours of 60 joints at 120 frames a second
_DAMAGED = "correct the line, or export the file anew"


@dataclass(frozen=True)
class Line:
    """The words of one line of a file, at least one; `number` counts from 1."""

    path: Path
    number: int
    words: tuple[str, ...]

    @property
    def key(self) -> str:
        """The first word in lower case."""
        return self.words[0].lower()

    def error(self, found: str, expected: str, remedy: str = _DAMAGED) -> InputError:
        """What to raise for this line."""
        return InputError(f"{self.path}, line {self.number}", found, expected, remedy)

    def word(self, index: int, what: str) -> str:
        """The word at `index`, which is `what`. Raises InputError where the line is shorter."""
        if index >= len(self.words):
            raise self.error(shown(" ".join(self.words)), f"{what} after it")
        return self.words[index]

    def count(self, index: int, what: str) -> int:
        """The whole number from 0 to 999,999,999 at `index`. Raises InputError for anything else."""
        word = self.word(index, what)
        if not (word.isascii() and word.isdigit() and len(word) < 10):
            raise self.error(shown(word), what)
        return int(word)

    def numbers(self, first: int, what: str, count: int | None = None) -> list[float]:
        """The finite numbers from word `first` on, `count` of them where given.

        Raises InputError where there are not so many, and for words that are no such numbers.
        """
        values = []
        for word in self.words[first:]:
            try:
                values.append(float(word))
            except ValueError:
                remedy = "write decimal points instead of commas" if "," in word else _DAMAGED
                raise self.error(shown(word), f"numbers for {what}", remedy) from None
            if not abs(values[-1]) < LARGEST:  # nan is not
                raise self.error(f"{word[:60]} for {what}", "finite numbers below 1e9")
        if count is not None and len(values) != count:
            more = ", and then a new line" if len(values) > count else ""
            raise self.error(f"{len(values)} values for {what}", f"{count}{more}")
        return values


def decode(data: bytes) -> str:
    """Text of UTF-8 or marked UTF-16; anything else counts as Latin-1, so that no name is lost."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def read_lines(path: Path, what: str, comment: str | None = None) -> list[Line]:
    """The lines of a text file that hold a word; what follows `comment` in a line is left out.

    Raises InputError, saying that `what` was expected, for files that cannot be read, are empty,
    too large or no text.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise InputError(str(path), "more than 1 GiB", what, "cut the recording into parts")
        text = decode(path.read_bytes())
    except OSError as error:
        raise unreadable(path, error, what) from error
    text = text.rstrip().rstrip("\x1a")  # DOS ended texts with Ctrl-Z
    if not text.strip():
        raise InputError(str(path), "an empty file", what, "copy or export the file anew")
    if "\0" in text:
        raise InputError(str(path), "binary data", what, "export the file as text, in UTF-8")
    return list(_lines(path, text, comment))


def unreadable(path: Path, error: OSError, what: str) -> InputError:
    """What to raise where the system does not let `what` be read."""
    found = error.strerror or "an unreadable file"
    return InputError(str(path), found, what, "check the path and its permissions")


def _lines(path: Path, text: str, comment: str | None) -> Iterator[Line]:
    for number, line in enumerate(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"), start=1):
        words = line.split(comment, 1)[0].split() if comment else line.split()
        if words:
            yield Line(path, number, tuple(words))


def first_words(head: bytes, count: int) -> list[str]:
    """The first words of a text in lower case, `#` comments left out; for guesses at its format."""
    lines = decode(head).replace("\r", "\n").split("\n")
    return [word.lower() for line in lines for word in line.split("#", 1)[0].split()][:count]


def shown(value: object) -> str:
    """A value for a message: quoted, printable and not long, whatever a file holds there."""
    text = repr(value)
    return text if len(text) <= 80 else f"{text[:77]}..."


def joined(names: Sequence[str], most: int = 100) -> str:
    """Names for a message, which stays readable whatever they are and however many."""
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return (
        ", ".join(name if name.isprintable() and len(name) < 80 else shown(name) for name in names[:most])
        + rest
    )
