"""Docstrings for the documentation site: sentences such as "start, end: s, the part." make a list.

An extension of Griffe, which `mkdocs.yml` names; nothing else uses it.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

#: "name: ", "name (T, 57): " or "q (T, 57), v (T, 56): ", where a sentence begins.
_NAME = r"[a-z]\w*(?: \([^)]*\))?"
_FIELD = rf"{_NAME}(?:, {_NAME})*: (?=\S)"
_BEGINS = re.compile(rf"^(?={_FIELD})", re.MULTILINE)
_NEXT = re.compile(rf"(?<=\.) (?={_FIELD})")


class Fields(griffe.Extension):
    """Turns the fields of every docstring into list items."""

    def on_instance(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        """Griffe calls this for each object that it has read."""
        del kwargs
        if obj.docstring is not None:
            obj.docstring.value = as_markdown(obj.docstring.value)


def as_markdown(text: str) -> str:
    """The docstring with its fields as items of a list; all else stays."""
    return "\n\n".join(map(_paragraph, re.split(r"\n\s*\n", text)))


def _paragraph(text: str) -> str:
    begin = _BEGINS.search(text)
    if begin is None:
        return text
    head, fields = text[: begin.start()].strip(), " ".join(text[begin.start() :].split())
    items = "\n".join(_item(*field.split(": ", 1)) for field in _NEXT.split(fields))
    return f"{head}\n\n{items}" if head else items


def _item(names: str, meaning: str) -> str:
    shown = ", ".join(f"`{name}`" for name in re.split(r", (?![^(]*\))", names))
    return f"- {shown}: {meaning}"
