"""Packages that only some tasks need: imported there, or asked for in one line."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from physique.errors import InputError


def require(module: str, extra: str) -> Any:
    """The module, e.g. "pxr.UsdSkel", which the extra `extra` of physique brings.

    Raises InputError with the command that installs it where it is missing.
    """
    try:
        return import_module(module)
    except ImportError:
        raise InputError(
            f"extra {extra!r}",
            f"no package {module.split('.')[0]!r}",
            f"what the extra {extra!r} installs",
            f"pip install 'physique[{extra}]'",
        ) from None
