"""A person who lifts an arm, written as ASF and AMC."""

from __future__ import annotations

from pathlib import Path

import numpy as np

_UNIT = 0.0254 / 0.45  # m, of CMU's files

# Parent, and the way from the bone's beginning to its end, m: x left, y up, z forward. 1.70 m high.
_BONES: dict[str, tuple[str, tuple[float, float, float]]] = {
    "lowerback": ("root", (0.0, 0.12, 0.0)),
    "upperback": ("lowerback", (0.0, 0.12, 0.0)),
    "thorax": ("upperback", (0.0, 0.12, 0.0)),
    "lowerneck": ("thorax", (0.0, 0.10, 0.0)),
    "head": ("lowerneck", (0.0, 0.15, 0.0)),
}
for _side, _sign in (("l", 1.0), ("r", -1.0)):
    _BONES |= {
        f"{_side}hipjoint": ("root", (0.09 * _sign, -0.07, 0.0)),
        f"{_side}femur": (f"{_side}hipjoint", (0.0, -0.41, 0.0)),
        f"{_side}tibia": (f"{_side}femur", (0.0, -0.40, 0.0)),
        f"{_side}foot": (f"{_side}tibia", (0.0, -0.045, 0.13)),
        f"{_side}toes": (f"{_side}foot", (0.0, 0.0, 0.05)),
        f"{_side}clavicle": ("thorax", (0.18 * _sign, 0.08, 0.0)),
        f"{_side}humerus": (f"{_side}clavicle", (0.28 * _sign, 0.0, 0.0)),
        f"{_side}radius": (f"{_side}humerus", (0.25 * _sign, 0.0, 0.0)),
        f"{_side}wrist": (f"{_side}radius", (0.04 * _sign, 0.0, 0.0)),
        f"{_side}hand": (f"{_side}wrist", (0.08 * _sign, 0.0, 0.0)),
    }


def asf_text() -> str:
    """The skeleton."""
    lines = [":version 1.10", ":name person", ":units", "  mass 1.0", "  length 0.45", "  angle deg", ":root"]
    lines += [
        "  order TX TY TZ RX RY RZ",
        "  axis XYZ",
        "  position 0 0 0",
        "  orientation 0 0 0",
        ":bonedata",
    ]
    for name, (_, way) in _BONES.items():
        length = float(np.linalg.norm(way))
        direction = " ".join(f"{x:.6f}" for x in np.divide(way, length))
        lines += ["  begin", f"    name {name}", f"    direction {direction}"]
        lines += [f"    length {length / _UNIT:.6f}", "    axis 0 0 20 XYZ", "    dof rx ry rz", "  end"]
    lines += [
        ":hierarchy",
        "  begin",
        *(f"    {parent} {name}" for name, (parent, _) in _BONES.items()),
        "  end",
    ]
    return "\n".join(lines) + "\n"


def amc_text(frames: int = 3) -> str:
    """The motion: the left arm goes up by 10 degrees a frame."""
    lines = [":FULLY-SPECIFIED", ":DEGREES"]
    for t in range(frames):
        lines += [str(t + 1), f"root 0 {0.93 / _UNIT:.6f} 0 0 0 0"]
        lines += [f"{name} {'0 0 0' if name != 'lhumerus' else f'0 0 {10 * t}'}" for name in _BONES]
    return "\n".join(lines) + "\n"


def write_person(folder: Path, asf: bytes | None = None, amc: bytes | None = None) -> Path:
    """Write both, whole but for what is given; the path of the .amc."""
    path = folder / "person_01.amc"
    path.write_bytes(amc_text().encode() if amc is None else amc)
    (folder / "person.asf").write_bytes(asf_text().encode() if asf is None else asf)
    return path
