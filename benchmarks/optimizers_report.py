"""Tables and plot of `compare_optimizers.py`."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

MARKS = (1_000, 10_000, 50_000, 100_000, 200_000)  # simulations
STEPS_PER_SIMULATION = 81

TEXT = """# Two optimisers, one cost

`paper` is the optimiser of the paper (section 3.2): CMA-ES with 200 samples an iteration on the
knots of a cubic B-spline, 6 knots for each 0.4 s, started at zero. `fast`, the default, is
iterative LQR with derivatives of the simulator. Both minimise the same E (Eq. 2, the paper's
weights) on the same problem: 0.8 s of a clip, the average body, 100 Nm at every joint, from the
reference's own state at the start of the window. The price is counted in simulated steps; for
`fast` every evaluation of the dynamics for a finite difference counts as one step.

{table}

![E over simulated steps](images/optimizers.png)

How `paper` comes down:

{progress}

`python benchmarks/compare_optimizers.py` measures this again (hours on one core; `--budget 2000`
for a short look), `--only fast` only the fast one.
"""


def write_report(results: dict, docs: Path) -> None:
    """Write docs/optimizers.md and docs/images/optimizers.png."""
    rows = results["windows"]
    (docs / "images").mkdir(parents=True, exist_ok=True)
    (docs / "optimizers.md").write_text(
        TEXT.format(table=_table(rows), progress=_progress(rows)), encoding="utf-8"
    )
    _plot(rows, docs / "images" / "optimizers.png")


def _table(rows: dict) -> str:
    lines = [
        "| window | E fast | steps fast | E paper | steps paper | paper / fast in steps "
        "| steps fast needs to reach E paper |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    stale = False
    for name, row in rows.items():
        fast, paper = row.get("fast"), row.get("paper")
        label = f"{name} ({row['clip']} from {row['start']} s)"
        if fast is None or paper is None:
            lines.append(f"| {label} | {_cost(fast)} | {_steps(fast)} "
                         f"| {_cost(paper)} | {_steps(paper)} | | |")  # fmt: skip
            continue
        stale |= fast["problem"] != paper["problem"]
        reached = [s for s, c in zip(fast["steps"], fast["cost"]) if c <= paper["final_cost"]]
        need = f"{reached[0] / 1e6:.2f} M" if reached else "not reached"
        bold = "**" if fast["final_cost"] <= paper["final_cost"] else ""
        note = "" if fast["problem"] == paper["problem"] else r" \*"
        lines.append(
            f"| {label}{note} "
            f"| {bold}{_cost(fast)}{bold} | {_steps(fast)} | {_cost(paper)} | {_steps(paper)} "
            f"| {paper['final_steps'] / fast['final_steps']:.0f} | {need} |"
        )
    if stale:
        lines.append("\n\\* the two were measured on different versions of the body model.")
    if any(not row.get("paper", {}).get("done", True) for row in rows.values()):
        lines.append('\nA search marked "so far" had not used up its simulations.')
    return "\n".join(lines)


def _cost(entry: dict | None) -> str:
    return f"{entry['final_cost']:.2f}" if entry else "not run"


def _steps(entry: dict | None) -> str:
    if not entry:
        return ""
    return f"{entry['final_steps'] / 1e6:.2f} M" + ("" if entry["done"] else ", so far")


def _progress(rows: dict) -> str:
    lines = [
        "| window | " + " | ".join(f"{m:,} simulations" for m in MARKS) + " |",
        "| --- " * (len(MARKS) + 1) + "|",
    ]
    for name, row in rows.items():
        if "paper" not in row:
            continue
        steps, cost = np.array(row["paper"]["steps"]), np.array(row["paper"]["cost"])
        cells = []
        for mark in MARKS:
            until = steps <= 1.01 * mark * STEPS_PER_SIMULATION
            there = steps[-1] >= 0.99 * mark * STEPS_PER_SIMULATION
            cells.append(f"{cost[until][-1]:.2f}" if there and until.any() else "")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _plot(rows: dict, path: Path) -> None:
    figure, axes = plt.subplots(
        1, max(1, len(rows)), figsize=(3.6 * max(1, len(rows)), 3.4), sharex=True, sharey=True,
        squeeze=False, layout="constrained",
    )  # fmt: skip
    for axis, (name, row) in zip(axes[0], rows.items()):
        for optimizer, color in (("paper", "#b5533c"), ("fast", "#2f6f9f")):
            if optimizer in row:
                entry = row[optimizer]
                axis.plot(entry["steps"], entry["cost"], color=color, label=optimizer, lw=1.8)
                axis.plot(entry["steps"][-1], entry["cost"][-1], "o", color=color, ms=4)
        axis.set(xscale="log", yscale="log", title=name, xlabel="simulated steps",
                 xlim=(1e4, 3e7))  # fmt: skip
        axis.grid(alpha=0.3, which="both", lw=0.4)
        axis.legend(frameon=False)
    axes[0, 0].set_ylabel("E (Eq. 2)")
    figure.savefig(path, dpi=130)
    plt.close(figure)
