"""Section 5, torque limits: a jump and kick of a heavy man.

    python -m physique.experiments.torque --write docs/section5.md

Takes a minute or two; what is finished is kept in out/section5.
"""

from __future__ import annotations

from physique.character.soles import sole_points
from physique.experiments.section5 import Array, Picture, Section5, ankles, markdown, present, sheet, yes
from physique.runs.run import Run

LIMITS = (300.0, 100.0, 50.0)  # Nm
TEXT = """## Torque limits

The embedded `spinkick`, a kick out of a jump, on the heavy man (155 kg). Heights are those of the
simulated motion, with the reference's in the last row: the lower foot's sole at the top of the
jump, and the ankle at the top of the kick. With 300 Nm at every joint he jumps as the performer
does, which nobody would expect of him; with 100 Nm he jumps lower and lands bent over; with 50 Nm
he sinks to the floor. That is what the paper found.

"""


def measure(options: Section5) -> tuple[str, Picture]:
    """Text and picture."""
    table = [["limit", "followed", "error, mean mm", "jump mm", "kick mm", "torques at their limit"]]
    rows = []
    for limit in LIMITS:
        name = f"{limit:g} Nm"
        run = options.run("spinkick", "heavy", f"spinkick_{limit:g}", torque_limit=limit, end=options.end)
        m, q = run.metrics, run.trajectory.q
        table.append(
            [
                name,
                yes(m["success"]),
                f"{m['mpjpe_mm']:.0f}",
                *_heights(run, q),
                f"{m['torque_saturation']:.0%}",
            ]
        )
        rows.append((name, run, q))
    table.append(["reference", "", "", *_heights(run, run.trajectory.reference_q), ""])
    return TEXT + markdown(table), sheet(rows)


def _heights(run: Run, q: Array) -> tuple[str, str]:
    """Greatest height, mm, of the lowest point of both feet, and of an ankle."""
    lowest = sole_points(run.character(), q)[..., 2].min(axis=(1, 2))
    return f"{1e3 * max(0.0, lowest.max()):.0f}", f"{1e3 * ankles(run, q).max():.0f}"


def main(arguments: list[str] | None = None) -> None:
    """Measure, print and store."""
    present("torque", measure, arguments)


if __name__ == "__main__":
    main()
