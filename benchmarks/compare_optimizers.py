"""The fast optimiser against the paper's: cost E over simulated steps, on the same windows.

    python benchmarks/compare_optimizers.py                  # all, hours on one core
    python benchmarks/compare_optimizers.py --budget 2000 --out out/bench  # a short look
    python benchmarks/compare_optimizers.py --only fast      # after a change to the fast one
    python benchmarks/compare_optimizers.py --only report    # tables and plot from stored results

Results are stored after every window, and every few minutes within one, so that an interrupted
run loses one search at most; searches that are already stored for the very same problem with the
same budget are not run again. Writes benchmarks/results/compare_optimizers.json,
docs/optimizers.md and docs/images/optimizers.png, under another folder with `--out FOLDER`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from optimizers_report import write_report
from physique.body.build import capsule_body
from physique.body.named import named_body
from physique.motion.read import read_motion
from physique.simulation.character import Character, make_character
from physique.simulation.quiet import quiet
from physique.simulation.rollout import Rollout
from physique.simulation.simulator import Simulator
from physique.tracking import cma, ddp
from physique.tracking.problem import Problem, Solution, nominal_motion
from physique.tracking.reference import make_reference

ROOT = Path(__file__).resolve().parents[1]
RESULTS = Path("benchmarks") / "results" / "compare_optimizers.json"
MOCAP_KICK = ROOT.parent / "shared" / "mocap" / "cmu" / "bvh" / "135_04.bvh"
HORIZON = 80  # steps: the paper's two windows of 0.4 s
TORQUE = 100.0  # Nm
SAMPLES = 200
#: The fast one stops by itself or before a fortieth of the paper's 16 million steps.
FAST = ddp.Options(iterations=60, tolerance=0.001)
CHECKPOINT = 120.0  # s between stores


@dataclass(frozen=True)
class Window:
    """A stretch of a clip: `clip` as `read_motion` takes it, from `start` s."""

    name: str
    clip: str
    start: float


def windows() -> list[Window]:
    """A step of a walk, the recovery from a punch, the wind-up of a front kick.

    They start where the pose is sound: no hand inside the belly, no leap under way.
    """
    kick = Window("front kick", str(MOCAP_KICK), 2.1)
    if not MOCAP_KICK.is_file():
        kick = Window("kick", "kick", 0.0)
    return [Window("walk", "walk", 0.2), Window("punch", "punch", 1.2), kick]


def make_problem(character: Character, window: Window) -> Problem:
    """The window as a problem that starts in the reference's own state."""
    reference = make_reference(read_motion(window.clip), character)
    a = round(window.start / reference.timestep)
    target = reference.target(a, a + HORIZON + 1, np.zeros(2))
    return Problem(character, reference.q[a], reference.v[a], target)


def fingerprint(problem: Problem) -> str:
    """Changes with the model, the start or the target."""
    digest = hashlib.sha256(problem.character.xml.encode())
    for array in (problem.q0, problem.v0, problem.target.q, problem.target.v):
        digest.update(np.round(array, 6).tobytes())
    return digest.hexdigest()[:16]


def start_nominal(problem: Problem) -> Rollout:
    """The reference as if it had been simulated."""
    target = problem.target
    return nominal_motion(problem, target.q, target.v, target.q[1:, 7:])


def run_fast(problem: Problem, threads: int, store: Callable[[dict], None]) -> None:
    """The curve of the fast optimiser."""
    with Simulator(problem.character, threads) as simulator:
        curve: list[tuple[int, float]] = []
        begin = time.perf_counter()
        solution = ddp.solve(
            problem, simulator, start_nominal(problem), FAST,
            lambda _, cost: curve.append((simulator.steps, cost)),
        )  # fmt: skip
        store(_entry(curve, solution, time.perf_counter() - begin, {}))


def run_paper(problem: Problem, threads: int, budget: int, store: Callable[[dict], None]) -> None:
    """The curve of the paper's optimiser over `budget` simulations."""
    options = cma.Options(samples=SAMPLES, iterations=max(1, budget // SAMPLES))
    settings = {"budget": budget, "sigma": options.sigma, "seed": options.seed}
    with Simulator(problem.character, threads) as simulator:
        curve: list[tuple[int, float]] = []
        begin = last = time.perf_counter()

        def on_iteration(iteration: int, cost: float) -> None:
            nonlocal last
            curve.append((simulator.steps, cost))
            if time.perf_counter() - last > CHECKPOINT:
                last = time.perf_counter()
                store(_entry(curve, None, last - begin, settings))
                print(f"    {iteration * SAMPLES} simulations, E {cost:.3f}", flush=True)

        solution = cma.solve(
            problem, simulator, start_nominal(problem), options, on_iteration
        )  # fmt: skip
        store(_entry(curve, solution, time.perf_counter() - begin, settings))


def _entry(
    curve: list[tuple[int, float]], solution: Solution | None, seconds: float, settings: dict
) -> dict:
    every = max(1, len(curve) // 250)
    kept = curve[::every] + (curve[-1:] if (len(curve) - 1) % every else [])
    return {
        **settings,
        "done": solution is not None,
        "status": solution.status if solution else "running",
        "steps": [steps for steps, _ in kept],
        "cost": [float(f"{cost:.6g}") for _, cost in kept],
        "final_cost": float(f"{solution.cost if solution else curve[-1][1]:.6g}"),
        "final_steps": curve[-1][0],
        "seconds": round(seconds, 1),
    }


def load(out: Path) -> dict:
    """What is stored so far."""
    if (out / RESULTS).is_file():
        return json.loads((out / RESULTS).read_text(encoding="utf-8"))
    return {"windows": {}}


def save(results: dict, out: Path) -> None:
    """Replace the stored results as a whole."""
    path = out / RESULTS
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(".partial")
    partial.write_text(json.dumps(results) + "\n", encoding="utf-8")
    partial.replace(path)


def main() -> None:
    """Run what is missing, then write the report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--budget", type=int, default=200_000, help="simulations of the paper's")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--only", choices=("fast", "paper", "report"))
    parser.add_argument("--window", help="only the window of this name")
    parser.add_argument("--out", type=Path, default=ROOT, help="write under this folder")
    arguments = parser.parse_args()
    if arguments.only != "report":
        character = make_character(capsule_body(named_body("average")), TORQUE)
        with quiet():
            for window in windows():
                if arguments.window in (None, window.name):
                    measure(character, window, arguments)
    write_report(load(arguments.out), arguments.out / "docs")


def measure(character: Character, window: Window, arguments: argparse.Namespace) -> None:
    """Run both optimisers on one window, unless they are stored already."""
    problem = make_problem(character, window)
    mark = fingerprint(problem)
    clip = window.clip if "/" not in window.clip else Path(window.clip).name

    def store(optimizer: str) -> Callable[[dict], None]:
        def write(entry: dict) -> None:
            results = load(arguments.out)  # another process may have written another window
            row = results["windows"].setdefault(window.name, {})
            row.update(clip=clip, start=window.start)
            row[optimizer] = {"problem": mark, **entry}
            save(results, arguments.out)

        return write

    if arguments.only != "paper":
        print(f"{window.name}: fast", flush=True)
        run_fast(problem, arguments.threads, store("fast"))
    if arguments.only != "fast":
        known = load(arguments.out)["windows"].get(window.name, {}).get("paper", {})
        same = known.get("problem") == mark and known.get("done")
        if same and known["budget"] >= arguments.budget:
            print(f"{window.name}: paper, stored already", flush=True)
            return
        print(f"{window.name}: paper, {arguments.budget} simulations", flush=True)
        run_paper(problem, arguments.threads, arguments.budget, store("paper"))


if __name__ == "__main__":
    main()
