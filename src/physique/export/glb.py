"""A binary glTF 2.0 file (GLB) in the making: its JSON, and one buffer with all numbers."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

_COMPONENT = {
    np.dtype("int8"): 5120,
    np.dtype("uint8"): 5121,
    np.dtype("int16"): 5122,
    np.dtype("uint16"): 5123,
    np.dtype("uint32"): 5125,
    np.dtype("float32"): 5126,
}
_SHAPE = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}
#: What a buffer view is for: vertex attributes, triangle indices.
VERTICES, INDICES = 34962, 34963


class Document:
    """Lists of nodes, meshes, skins and so on, which name each other by index."""

    def __init__(self, generator: str) -> None:
        self._lists: dict[str, list[dict[str, Any]]] = {}
        self._asset = {"version": "2.0", "generator": generator}
        self._data = bytearray()

    def add(self, kind: str, item: dict[str, Any]) -> int:
        """Append `item` to the list `kind`, such as "nodes"; its index in it."""
        items = self._lists.setdefault(kind, [])
        items.append(item)
        return len(items) - 1

    def change(self, kind: str, index: int, **fields: Any) -> None:
        """Set fields of an item that was added before."""
        self._lists[kind][index].update(fields)

    def accessor(
        self,
        values: NDArray[Any],
        *,
        target: int | None = None,
        normalized: bool = False,
        bounds: bool = False,
    ) -> int:
        """Store an array (N, ...) of a component type that glTF has; the index of its accessor.

        target: `VERTICES`, `INDICES` or None. normalized: integers stand for -1 to 1 or 0 to 1.
        bounds: write the least and the largest value, which glTF wants of positions and times.
        Matrices are stored by columns, as glTF has them: values are (N, 4, 4) row, column.
        """
        shape = values.shape[1:]
        stored = values.swapaxes(1, 2) if len(shape) == 2 else values
        self._data.extend(b"\0" * (-len(self._data) % 4))
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self._data), "byteLength": stored.nbytes}
        if target is not None:
            view["target"] = target
        little_endian = stored.dtype.newbyteorder("<")
        self._data.extend(np.ascontiguousarray(stored, dtype=little_endian).tobytes())
        item: dict[str, Any] = {
            "bufferView": self.add("bufferViews", view),
            "componentType": _COMPONENT[values.dtype],
            "count": len(values),
            "type": _SHAPE[shape],
        }
        if normalized:
            item["normalized"] = True
        if bounds:
            item["min"] = np.atleast_1d(values.min(axis=0)).tolist()
            item["max"] = np.atleast_1d(values.max(axis=0)).tolist()
        return self.add("accessors", item)

    def to_bytes(self, scene: dict[str, Any]) -> bytes:
        """The whole file, which shows `scene`."""
        data = bytes(self._data) + b"\0" * (-len(self._data) % 4)
        document = {
            "asset": self._asset,
            "scene": 0,
            "scenes": [scene],
            **self._lists,
            "buffers": [{"byteLength": len(data)}],
        }
        text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        total = 12 + 8 + len(text) + 8 + len(data)
        return b"".join(
            [
                struct.pack("<4sII", b"glTF", 2, total),
                struct.pack("<I4s", len(text), b"JSON"),
                text,
                struct.pack("<I4s", len(data), b"BIN\0"),
                data,
            ]
        )
