"""Tables of docs/bodies.md for the ten named bodies.

    python benchmarks/bodies.py [--write FILE.md]

prints them and, if asked, writes them to a file.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

from hull import hull_capsules
from physique.body.build import capsule_body
from physique.body.mass import DE_LEVA, SEGMENTS, part_masses, segment_percent
from physique.body.named import PEOPLE, named_body
from physique.body.surface_error import surface_error


def main() -> None:
    """Measure all ten bodies."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", type=Path, help="markdown file")
    arguments = parser.parse_args()
    shape = [
        "| body | height m | mass kg | volume L | make s | fit s | surface cm | max cm "
        "| mesh to capsules | capsules to mesh | hull rule cm | hull max cm |",
        "| --- " * 12 + "|",
    ]
    mass = ["| body | rule | " + " | ".join(SEGMENTS) + " | RMS |", "| --- " * (len(SEGMENTS) + 3) + "|"]
    for sex, table in DE_LEVA.items():
        values = " | ".join(f"{table[s]:.2f}" for s in SEGMENTS)
        mass.append(f"| de Leva, {sex} | | {values} | |")
    for name, person in PEOPLE.items():
        start = time.perf_counter()
        mesh = named_body(name)
        made = time.perf_counter()
        body = capsule_body(mesh)
        fitted = time.perf_counter()
        ours, hull = surface_error(mesh, body.parts), surface_error(mesh, hull_capsules(mesh))
        shape.append(
            f"| {name} | {mesh.height:.3f} | {mesh.mass:.1f} | {1e3 * mesh.volume:.1f} "
            f"| {made - start:.2f} | {fitted - made:.2f} "
            f"| **{ours.mean_cm:.2f}** | {ours.max_cm:.1f} | {ours.mesh_to_primitives_cm:.2f} "
            f"| {ours.primitives_to_mesh_cm:.2f} | {hull.mean_cm:.2f} | {hull.max_cm:.1f} |"
        )
        table = DE_LEVA[person.sex]
        for rule in ("nearest", "paper"):
            parts = part_masses(mesh, body.parts, rule)
            percent = segment_percent([p.mass for p in parts])
            rms = np.sqrt(np.mean([(percent[s] - table[s]) ** 2 for s in SEGMENTS]))
            values = " | ".join(f"{percent[s]:.2f}" for s in SEGMENTS)
            mass.append(f"| {name} | {rule} | {values} | {rms:.2f} |")
    text = "\n".join([*shape, "", *mass])
    print(text)
    if arguments.write:
        arguments.write.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
