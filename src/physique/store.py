"""A run's folder: arrays as npz and the rest as JSON, each file written whole or not at all."""

from __future__ import annotations

import dataclasses
import io
import json
import math
import os
import secrets
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.lib import format as npy_format
from numpy.typing import ArrayLike, NDArray

from physique.errors import InputError, reason

PathLike = str | os.PathLike[str]

# Equal arrays must give equal bytes on any day: this is the earliest date that a zip can hold.
_DATE = (1980, 1, 1, 0, 0, 0)
_MOST_BYTES = 1 << 32  # of a file's arrays together; a small zip can claim to hold any amount


def prepare_folder(path: PathLike) -> Path:
    """The folder `path`, created with its parents where missing, and known to be writable.

    Raises InputError where it cannot be created or written.
    """
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # Permission bits do not tell of read-only or full disks; a file does.
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(b"physique")
    except OSError as fault:
        raise InputError(
            str(folder),
            reason(fault),
            "a folder that can be written",
            "choose another folder or change its permissions",
        ) from None
    return folder


def write_atomic(path: PathLike, data: bytes) -> None:
    """Put `data` into the file `path` so that every reader meets all of the old or all of the new.

    That holds through a crash and a loss of power: the bytes go to disk in a new file in the same
    folder, which then takes the name. Raises InputError where the file cannot be written.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(6)}.part")
    try:
        try:
            with temporary.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        _sync_folder(path.parent)
    except OSError as fault:
        raise InputError(
            str(path),
            reason(fault),
            "a file that can be written",
            "check that its folder exists, its permissions and the free space",
        ) from None


def write_npz(path: PathLike, arrays: Mapping[str, ArrayLike], *, compressed: bool = True) -> None:
    """Write named arrays as an npz file: atomic, and byte for byte the same for equal arrays.

    Raises InputError where the file cannot be written, ValueError for arrays of Python objects.
    """
    buffer = io.BytesIO()
    method = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in sorted(arrays):
            member = io.BytesIO()
            npy_format.write_array(member, np.asanyarray(arrays[name]), allow_pickle=False)
            entry = zipfile.ZipInfo(f"{name}.npy", date_time=_DATE)
            entry.create_system = 3  # the same bytes on Windows as elsewhere
            archive.writestr(entry, member.getbuffer(), method, compresslevel=6)
    write_atomic(path, buffer.getvalue())


def read_npz(path: PathLike) -> dict[str, NDArray[Any]]:
    """The arrays of an npz file by name; pickled objects are refused.

    Raises InputError where the file is missing, damaged or not an npz file.
    """
    path = Path(path)
    arrays: dict[str, NDArray[Any]] = {}
    member = ""
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > _MOST_BYTES:
                raise ValueError("more than 4 GiB")
            for member in archive.namelist():
                # Reading a member whole checks its checksum before its header is believed.
                content = io.BytesIO(archive.read(member))
                name = member.removesuffix(".npy")
                arrays[name] = npy_format.read_array(content, allow_pickle=False)
    except OSError as fault:
        raise _unreadable(path, reason(fault), "an npz file") from None
    except Exception as fault:  # the parsers of zip and npy raise a dozen kinds on damaged bytes
        where = f"array {member!r} damaged: " if member else ""
        raise _unreadable(path, f"{where}{fault}", "a whole npz file of plain arrays") from None
    return arrays


def write_json(path: PathLike, value: object) -> None:
    """Write `value` as indented JSON with sorted keys, atomically.

    NumPy scalars and arrays become numbers and lists, dataclasses objects, paths strings; numbers
    that JSON does not have (NaN, infinities) become null. Raises InputError where the file cannot
    be written, TypeError for anything else that JSON cannot say.
    """
    text = json.dumps(_plain(value), indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False)
    write_atomic(path, f"{text}\n".encode())


def read_json(path: PathLike) -> Any:
    """The value in a JSON file. Raises InputError where it is missing, damaged or not JSON."""
    path = Path(path)
    try:
        return json.loads(path.read_bytes().decode(), parse_constant=_refuse, parse_float=_finite)
    except OSError as fault:
        raise _unreadable(path, reason(fault), "a JSON file") from None
    except json.JSONDecodeError as fault:
        place = f"line {fault.lineno}, column {fault.colno}"
        raise _unreadable(path, f"{fault.msg} at {place}", "whole, valid JSON") from None
    except (ValueError, RecursionError) as fault:
        raise _unreadable(path, str(fault), "whole, valid JSON") from None


def _plain(value: object) -> object:
    """The same value in the types that the JSON writer knows."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None or isinstance(value, str | bool | int):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        return {str(_plain(key)): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = dataclasses.fields(value)
        return {field.name: _plain(getattr(value, field.name)) for field in fields}
    raise TypeError(f"JSON cannot hold a {type(value).__name__}")


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant}, which is not JSON")


def _finite(number: str) -> float:
    value = float(number)
    return value if math.isfinite(value) else _refuse(number)


def _unreadable(path: Path, found: str, expected: str) -> InputError:
    # The parsers quote damaged bytes, and as many as there are.
    readable = "".join(c if c.isprintable() else "?" for c in found[:300])
    return InputError(str(path), readable, expected, "check the path, or make the file anew")


def _sync_folder(folder: Path) -> None:
    """Put the folder's own entries on disk; only POSIX systems have, and need, such a call."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
