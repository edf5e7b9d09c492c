"""Tables and plot of `compare_optimizers.py`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

STEPS_PER_SIMULATION = 81
MARKS = (10_000, 100_000, 1_000_000, 3_200_000, 8_000_000, 16_000_000, 32_000_000)  # steps


@dataclass(frozen=True)
class Look:
    """How an optimiser is drawn: colours of Okabe and Ito, and a dash of its own."""

    color: str
    dash: str
    width: float = 1.8


LOOKS = {
    "fast": Look("#0072B2", "-", 2.4),
    "paper": Look("#D55E00", "--"),
    "cem": Look("#009E73", "-."),
    "mppi": Look("#CC79A7", ":", 2.4),
}
OTHER = Look("#000000", "-", 1.0)

#: What is said of an optimiser that was run.
ABOUT = {
    "fast": "the default, iterative LQR with derivatives of the simulator. It searches three times "
    "and stops by itself.",
    "paper": "the optimiser of the paper (section 3.2), CMA-ES with 200 samples an iteration on the "
    "knots of a cubic B-spline, 6 knots for each 0.4 s, started at zero.",
    "cem": "the sampler of DynaRetarget (arXiv 2602.06827), the cross-entropy method on a horizon "
    "that grows knot by knot: 1024 samples, 4 % elite, a knot every 0.25 s, started at the reference.",
    "mppi": "the sampler of SPIDER (arXiv 2511.09484), an average of noisy controls with ever less "
    "noise: 2048 samples, the best 10 % weighted by a softmax, a knot every 0.1 s, rounds of 16 "
    "iterations, started at the reference.",
}
RIVALS = """
The samplers of rivals are written anew from these parameters (`benchmarks/samplers.py` says what
they leave open and what we chose); they are not their authors' code, and only the sampler is
compared.
"""
TEXT = """# Optimisers on one cost

All minimise the same E (Eq. 2, the paper's weights) on the same problem: 0.8 s of a clip, 100 Nm at
every joint, from the reference's own state at the start of the window. The price is counted in
simulated steps. For `fast` the derivatives of a step, in closed form, count as one step more; what
they take beyond that shows in the seconds.

{about}

{summary}

{table}

E after so many simulated steps:

{progress}

{pictures}

A filled end: the search was finished; an open end: it was not.

The paper gives a window ten times these 40,000 simulations. An earlier version (commit 69d77f0),
with another reference, was compared at 200,000 on the average body: E of `fast` against that of
`paper` was 0.53 against 19.2 on the walk, 0.66 against 26.6 on the punch and 2.47 against 60.2 on
the front kick. It has not been measured again.

`python benchmarks/compare_optimizers.py` measures this again (two hours on one core; a search that
was stopped goes on where it was; `--budget 2000 --out out/bench` for a short look), `--only fast`
only the fast one.
"""


#: Pictures: what is drawn, over what.
AXES = {
    "cost": "E (Eq. 2)",
    "error_mm": "mean joint error, mm",
    "steps": "simulated steps",
    "times": "seconds of one processor",
}
PICTURES = [(y, x) for x in ("steps", "times") for y in ("cost", "error_mm")]


def write_report(results: dict, docs: Path) -> None:
    """Write docs/optimizers.md and docs/images/optimizers_*.png."""
    rows = results["windows"]
    (docs / "images").mkdir(parents=True, exist_ok=True)
    names = [f"optimizers_{y}_{x}.png" for y, x in PICTURES]
    text = TEXT.format(
        about=_about(rows),
        summary=_summary(rows),
        table=_table(rows),
        progress=_progress(rows),
        pictures="\n\n".join(
            f"![{AXES[y]} over {AXES[x]}](images/{name})" for (y, x), name in zip(PICTURES, names)
        ),
    )
    (docs / "optimizers.md").write_text(text, encoding="utf-8")
    for (y, x), name in zip(PICTURES, names):
        _plot(rows, y, x, docs / "images" / name)


def entries(row: dict) -> dict[str, dict]:
    """The optimisers that were run on a window, the known ones first."""
    found = [name for name, value in row.items() if isinstance(value, dict)]
    order = [*(name for name in LOOKS if name in found), *(n for n in found if n not in LOOKS)]
    return {name: row[name] for name in order}


def _about(rows: dict) -> str:
    """The optimisers that were run, and what they were allowed."""
    lines = []
    for name, words in ABOUT.items():
        found = [row[name] for row in rows.values() if name in row]
        if not found:
            continue
        budgets = {entry["budget"] for entry in found if "budget" in entry}
        unit = "simulations" if name == "paper" else "simulated steps"
        allowed = " or ".join(f"{budget:,}" for budget in sorted(budgets))
        lines.append(f"- `{name}`: {words}" + (f" Budget: {allowed} {unit}." if allowed else ""))
    rivals = any(name in row for row in rows.values() for name in ("cem", "mppi"))
    return "\n".join(lines) + ("\n" + RIVALS.rstrip() if rivals else "")


def _summary(rows: dict) -> str:
    """What `fast` reaches against each of the others, where both were run to their end."""
    lines = []
    for name in LOOKS:
        pairs = [
            (row["fast"], row[name])
            for row in rows.values()
            if name != "fast"
            and {"fast", name} <= row.keys()
            and row[name]["done"]
            and row[name]["problem"] == row["fast"]["problem"]
        ]
        if not pairs:
            continue
        ratios = [ours["final_cost"] / theirs["final_cost"] for ours, theirs in pairs]
        steps = [theirs["final_steps"] / ours["final_steps"] for ours, theirs in pairs]
        lower = sum(ratio < 1 for ratio in ratios)
        lines.append(
            f"- Of {len(pairs)} window{'s' * (len(pairs) > 1)} `fast` ends lower than `{name}` on {lower}. "
            f"E is {np.median(ratios):.3f} times that of `{name}` in the median "
            f"({min(ratios):.3f} to {max(ratios):.3f}), which took {np.median(steps):,.0f} times "
            "the simulated steps."
        )
    return "\n".join(lines)


def _table(rows: dict) -> str:
    lines = [
        "| window | body | optimiser | E | error mm | simulated steps | seconds | `fast` needs for this E |",
        "| --- " * 8 + "|",
    ]
    stale = False
    for key, row in rows.items():
        found = entries(row)
        fast = found.get("fast")
        lowest = min((entry["final_cost"] for entry in found.values()), default=0.0)
        label = f"{_window(key, row)} ({row['clip']} from {row['start']} s)"
        differs = len({entry["problem"] for entry in found.values()}) > 1
        stale |= differs
        note = r" \*" if differs else ""
        for name, entry in found.items():
            bold = "**" if entry["final_cost"] == lowest else ""
            lines.append(
                f"| {label} | {row['body']} | {name}{note} "
                f"| {bold}{entry['final_cost']:.2f}{bold} | {entry['error_mm'][-1]:.0f} "
                f"| {_steps(entry)} "
                f"| {entry['seconds']:.0f} | {_need(fast, entry)} |"
            )
    if stale:
        lines.append("\n\\* on this window not all were measured on the same version of the body model.")
    if any(not entry["done"] for row in rows.values() for entry in entries(row).values()):
        lines.append('\nA search marked "so far" had not used up its budget.')
    return "\n".join(lines)


def _window(key: str, row: dict) -> str:
    return key.removesuffix(f", {row['body']}")


def _steps(entry: dict) -> str:
    steps = f"{entry['final_steps'] / 1e6:.3g} M"
    if entry["done"]:
        return steps
    return f"{steps}, so far ({entry['final_steps'] // STEPS_PER_SIMULATION:,} simulations)"


def _need(fast: dict | None, entry: dict) -> str:
    if fast is None or entry is fast:
        return ""
    reached = [s for s, c in zip(fast["steps"], fast["cost"]) if c <= entry["final_cost"]]
    return f"{reached[0] / 1e6:.3g} M steps" if reached else "not reached"


def _progress(rows: dict) -> str:
    longest = max((e["final_steps"] for r in rows.values() for e in entries(r).values()), default=0)
    marks = [mark for mark in MARKS if mark <= 1.02 * longest]
    lines = [
        "| window | body | optimiser | " + " | ".join(f"{m / 1e6:g} M" for m in marks) + " |",
        "| --- " * (len(marks) + 3) + "|",
    ]
    for key, row in rows.items():
        for name, entry in entries(row).items():
            cells = " | ".join(_cost_at(entry, mark) for mark in marks)
            lines.append(f"| {_window(key, row)} | {row['body']} | {name} | {cells} |")
    return "\n".join(lines)


def _cost_at(entry: dict, mark: int) -> str:
    """E after `mark` steps; empty where a budget ended before. Who stops by himself, stays."""
    steps, cost = np.array(entry["steps"]), np.array(entry["cost"])
    until = steps <= 1.01 * mark
    ended = entry["final_steps"] < 0.98 * mark
    if not until.any() or (ended and (not entry["done"] or "budget" in entry)):
        return ""
    return f"{cost[until][-1]:.2f}"


def _plot(rows: dict, y: str, x: str, path: Path) -> None:
    """A panel a window, a row of panels a body."""
    bodies = list(dict.fromkeys(row["body"] for row in rows.values()))
    windows = list(dict.fromkeys(_window(key, row) for key, row in rows.items()))
    shape = max(1, len(bodies)), max(1, len(windows))
    figure, axes = plt.subplots(
        *shape,
        figsize=(3.4 * shape[1], 2.7 * shape[0]),
        sharex=True,
        sharey=True,
        squeeze=False,
        layout="constrained",
    )
    for key, row in rows.items():
        axis = axes[bodies.index(row["body"]), windows.index(_window(key, row))]
        axis.set_title(key, fontsize=10)
        for name, entry in entries(row).items():
            _draw(axis, np.maximum(entry[x], 0.01), entry[y], name, entry["done"])
    for axis in axes.flat:
        axis.set(xscale="log", yscale="log")
        axis.grid(alpha=0.3, which="major", lw=0.4)
    for axis in axes[:, 0]:
        axis.set_ylabel(AXES[y])
    for axis in axes[-1]:
        axis.set_xlabel(AXES[x])
    handles = {
        label: handle for axis in axes.flat for handle, label in zip(*axis.get_legend_handles_labels())
    }
    if handles:
        names = [*(n for n in LOOKS if n in handles), *(n for n in handles if n not in LOOKS)]
        figure.legend(
            [handles[n] for n in names], names, loc="outside upper center", ncols=len(names), frameon=False
        )
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _draw(axis: plt.Axes, x: np.ndarray, y: list[float], name: str, done: bool) -> None:
    look = LOOKS.get(name, OTHER)
    axis.plot(x, y, look.dash, color=look.color, lw=look.width, label=name)
    axis.plot(
        x[-1], y[-1], "o", color=look.color, ms=6, zorder=3, markerfacecolor=look.color if done else "white"
    )
