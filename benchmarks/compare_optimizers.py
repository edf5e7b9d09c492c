"""The fast optimiser against the paper's and two rivals' samplers: E and error over their price.

    python benchmarks/compare_optimizers.py                  # all, hours on one core
    python benchmarks/compare_optimizers.py --budget 2000 --rival-steps 400000 --out out/bench
                                                             # a short look
    python benchmarks/compare_optimizers.py --only fast      # after a change to the fast one
    python benchmarks/compare_optimizers.py --only cem --body heavy  # one rival, one body
    python benchmarks/compare_optimizers.py --only report    # tables and plot from stored results
    python benchmarks/compare_optimizers.py --only report --merge FILE  # and from another file

All start on the same windows, from the same state; `fast`, `cem` and `mppi` also from the same
controls, the reference's (`samplers.py` has the rivals; the paper's own starts at zero).

Results are stored after every window, and every few minutes within one, so that an interrupted
run loses one search at most; searches that are already stored for the very same problem with the
same settings and budget are not run again. Writes benchmarks/results/compare_optimizers.json,
docs/optimizers.md and docs/images/optimizers_*.png, under another folder with `--out FOLDER`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from optimizers_report import STEPS_PER_SIMULATION, write_report
from physique.body.build import capsule_body
from physique.body.named import PEOPLE, named_body
from physique.character import kinematics
from physique.character.joint_error import joint_errors
from physique.character.model import Character, make_character
from physique.motion.read import read_motion
from physique.reference.reference import make_reference
from physique.simulation.quiet import quiet
from physique.simulation.rollout import Rollout
from physique.simulation.simulator import Simulator
from physique.store import write_atomic
from physique.tracking import cma, costs, ddp
from physique.tracking.problem import Problem, Solution, warm_start
from samplers import CemOptions, MppiOptions, annealed_mppi, incremental_cem

ROOT = Path(__file__).resolve().parents[1]
RESULTS = Path("benchmarks") / "results" / "compare_optimizers.json"
MOCAP_KICK = ROOT.parent / "shared" / "mocap" / "cmu" / "bvh" / "135_04.bvh"
HORIZON = 80  # steps: the paper's two windows of 0.4 s
BODIES = ("average", "thin", "heavy")
TORQUE = 100.0  # Nm
SAMPLES = 200
#: Searches three times, and stops by itself before a hundredth of the paper's 32 million steps.
FAST = ddp.DdpOptions(iterations=60, tolerance=0.001, enough=0.0, hard=0.0)
CHECKPOINT = 120.0  # s between stores

OnIteration = Callable[[int, float], None]


@dataclass(frozen=True)
class Optimizer:
    """An entry of the comparison.

    settings: of the stored entry; `budget` among them is what may only grow, all others must be
    equal for a stored search to stand. solve: with these settings.
    """

    settings: dict[str, float]
    solve: Callable[[Problem, Simulator, Rollout, OnIteration], Solution]


def optimizers(budget: int, rival_steps: int) -> dict[str, Optimizer]:
    """All that are compared. budget: simulations of the paper's; rival_steps: of each rival."""
    paper = cma.CmaOptions(samples=SAMPLES, iterations=max(1, budget // SAMPLES))
    cem, mppi = CemOptions(budget=rival_steps), MppiOptions(budget=rival_steps)
    return {
        "fast": Optimizer({}, lambda p, s, n, on: ddp.solve(p, s, n, FAST, on)),
        "paper": Optimizer(
            {"budget": budget, "sigma": paper.sigma, "seed": paper.seed},
            lambda p, s, n, on: cma.solve(p, s, n, paper, on),
        ),
        "cem": Optimizer(asdict(cem), lambda p, s, n, on: incremental_cem(p, s, n, cem, on)),
        "mppi": Optimizer(asdict(mppi), lambda p, s, n, on: annealed_mppi(p, s, n, mppi, on)),
    }


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


@dataclass
class Best:
    """The motion of the lowest E that was asked for: q (N + 1, 57)."""

    cost: float = np.inf
    q: np.ndarray | None = None


@dataclass(frozen=True)
class Watched(Problem):
    """A problem that remembers the best motion, whichever optimiser asks what motions cost."""

    best: Best = field(default_factory=Best)

    def terms(
        self, q: np.ndarray, v: np.ndarray, com: np.ndarray, com_velocity: np.ndarray
    ) -> dict[str, np.ndarray]:
        """As `Problem.terms`."""
        terms = super().terms(q, v, com, com_velocity)
        cost = np.nan_to_num(costs.total(terms), nan=np.inf)
        first = np.unravel_index(np.argmin(cost), cost.shape)
        if cost[first] < self.best.cost:
            self.best.cost, self.best.q = float(cost[first]), q[first].copy()
        return terms

    def beginning(self, steps: int) -> Problem:
        """As `Problem.beginning`; what a shorter motion costs is not watched."""
        whole = Problem(self.character, self.q0, self.v0, self.target, self.weights)
        return self if steps == self.steps else whole.beginning(steps)

    def error(self) -> float:
        """Mean joint error, mm, of the best motion; NaN before there is one."""
        if self.best.q is None:
            return float("nan")
        joints, wanted = (
            kinematics.poses(self.character, q, heights=False).joints for q in (self.best.q, self.target.q)
        )
        return 1e3 * float(joint_errors(joints, wanted).mean())


def start_nominal(problem: Problem) -> Rollout:
    """The reference as if it had been simulated."""
    return warm_start(problem, None)


class Point(NamedTuple):
    """Of a curve: simulated steps, lowest E so far, that motion's error, mm, and seconds."""

    steps: int
    cost: float
    error: float
    seconds: float


def run(optimizer: Optimizer, problem: Problem, threads: int, store: Callable[[dict], None]) -> None:
    """The curve of an optimiser. Seconds are of the processor: other work does not count."""
    watched = Watched(problem.character, problem.q0, problem.v0, problem.target, problem.weights)
    with Simulator(problem.character, threads) as simulator:
        curve: list[Point] = []
        begin = last = time.process_time()

        def on_iteration(iteration: int, cost: float) -> None:
            nonlocal last
            now = time.process_time()
            error = curve[-1].error if curve and cost == curve[-1].cost else watched.error()
            curve.append(Point(simulator.steps, cost, error, now - begin))
            if now - last > CHECKPOINT:
                last = now
                store(_entry(curve, None, now - begin, optimizer.settings))
                print(f"    {simulator.steps / 1e6:.2f} M steps, E {cost:.3f}", flush=True)

        solution = optimizer.solve(watched, simulator, start_nominal(problem), on_iteration)
        seconds = time.process_time() - begin
        if not curve:  # the budget ended before the first iteration
            curve.append(Point(solution.steps, solution.cost, watched.error(), seconds))
        store(_entry(curve, solution, seconds, optimizer.settings))


def _entry(curve: list[Point], solution: Solution | None, seconds: float, settings: dict[str, float]) -> dict:
    every = max(1, len(curve) // 250)
    kept = curve[::every] + (curve[-1:] if (len(curve) - 1) % every else [])
    return {
        **settings,
        "done": solution is not None,
        "status": solution.status if solution else "running",
        "steps": [p.steps for p in kept],
        "cost": [float(f"{p.cost:.6g}") for p in kept],
        "error_mm": [round(p.error, 2) for p in kept],
        "times": [round(p.seconds, 2) for p in kept],
        "final_cost": float(f"{solution.cost if solution else curve[-1].cost:.6g}"),
        "final_steps": curve[-1].steps,
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
    write_atomic(path, f"{json.dumps(results)}\n".encode())


def merge(results: dict, other: dict) -> None:
    """Take the entries of `other` into `results`, but no unfinished one for a finished one."""
    for key, row in other["windows"].items():
        mine = results["windows"].setdefault(key, {})
        for name, value in row.items():
            known = mine.get(name)
            if isinstance(value, dict) and isinstance(known, dict):
                same = known["problem"] == value["problem"]
                if same and known["done"] and not value["done"]:
                    continue
            mine[name] = value


def main() -> None:
    """Run what is missing, then write the report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--budget", type=int, default=400_000, help="simulations of the paper's")
    parser.add_argument(
        "--rival-steps", type=int, help="simulated steps of each rival; a tenth of the paper's"
    )
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--only", choices=(*optimizers(1, 1), "report"))
    parser.add_argument("--window", help="only the window of this name")
    parser.add_argument("--body", choices=PEOPLE, help="only this ready body")
    parser.add_argument("--merge", type=Path, help="take the results of this file too")
    parser.add_argument("--out", type=Path, default=ROOT, help="write under this folder")
    arguments = parser.parse_args()
    if arguments.rival_steps is None:
        arguments.rival_steps = arguments.budget * STEPS_PER_SIMULATION // 10
    if arguments.merge:
        results = load(arguments.out)
        merge(results, json.loads(arguments.merge.read_text(encoding="utf-8")))
        save(results, arguments.out)
    if arguments.only != "report":
        bodies = [arguments.body] if arguments.body else BODIES
        with quiet():
            for body in bodies:
                character = make_character(capsule_body(named_body(body)), TORQUE)
                for window in windows():
                    if arguments.window in (None, window.name):
                        measure(character, window, body, arguments)
    write_report(load(arguments.out), arguments.out / "docs")


def measure(character: Character, window: Window, body: str, arguments: argparse.Namespace) -> None:
    """Run the optimisers on one window, unless they are stored already."""
    problem = make_problem(character, window)
    mark = fingerprint(problem)
    key = f"{window.name}, {body}"
    clip = window.clip if "/" not in window.clip else Path(window.clip).name
    for name, optimizer in optimizers(arguments.budget, arguments.rival_steps).items():
        if arguments.only not in (None, name):
            continue
        if stands(load(arguments.out)["windows"].get(key, {}).get(name), mark, optimizer):
            print(f"{key}: {name}, stored already", flush=True)
            continue

        def store(entry: dict, name: str = name) -> None:
            results = load(arguments.out)  # another process may have written another window
            row = results["windows"].setdefault(key, {})
            row.update(clip=clip, start=window.start, body=body)
            row[name] = {"problem": mark, **entry}
            save(results, arguments.out)

        budget = optimizer.settings.get("budget")
        print(f"{key}: {name}" + (f", budget {budget:,}" if budget else ""), flush=True)
        run(optimizer, problem, arguments.threads, store)


def stands(known: dict | None, mark: str, optimizer: Optimizer) -> bool:
    """Whether a stored entry need not be measured again. The fast one always is: it is quick,
    and its code changes."""
    if not optimizer.settings or not known or known["problem"] != mark or not known["done"]:
        return False
    others = [name for name in optimizer.settings if name != "budget"]
    return known["budget"] >= optimizer.settings["budget"] and all(
        known.get(name) == optimizer.settings[name] for name in others
    )


if __name__ == "__main__":
    main()
