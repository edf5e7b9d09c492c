"""Packages that only some tasks need: imported there, or asked for in one line."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
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


#: MuJoCo 4 comes in several wheels. `pip install -U` puts them in place and then removes the one
#: wheel of 3.x, with the files that both have.
_MUJOCO = "pip uninstall -y mujoco mujoco-core mujoco-studio && pip install 'mujoco>=4,<5'"


def check_mujoco() -> None:
    """Raises InputError where MuJoCo is missing or of another generation; imports nothing."""
    try:
        found = version("mujoco")
    except PackageNotFoundError:
        raise InputError("MuJoCo", "none", "version 4", "pip install 'mujoco>=4,<5'") from None
    if found.split(".")[0] != "4":
        raise InputError("MuJoCo", f"version {found}", "version 4", _MUJOCO)


def torn_mujoco(fault: BaseException) -> InputError | None:
    """What is to be said where `fault` is that of importing a MuJoCo with wheels missing."""
    if not isinstance(fault, ImportError) or "mujoco" not in f"{fault.name} {fault}":
        return None
    return InputError(
        "MuJoCo",
        "an installation with parts missing, as `pip install -U` from MuJoCo 3 leaves it",
        "the wheels of version 4, all of one version",
        _MUJOCO,
    )
