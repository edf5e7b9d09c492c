"""Growing a tree on several processes, with every round kept on disk as soon as it is done.

The files of the rounds are also how the processes hear of each other's branches; gains, which are
most of a tree, they read from a file that they share. A round that is missing or damaged is made
again against the same tree as before, to the same bits, and the rounds after it stay.
"""

from __future__ import annotations

import ctypes
import json
import logging
import multiprocessing
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, closing, contextmanager
from dataclasses import asdict, dataclass, fields
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physique.body.capsule_body import CapsuleBody
from physique.character.model import Character, load_character
from physique.errors import InputError
from physique.feedback.connect import Trunk, make_trunk
from physique.feedback.grow import METHOD, Attempt, Grower, Round, Settings, plan
from physique.feedback.lqr import WeightsName
from physique.feedback.tree import GAIN_TYPE, Branch, Tree, grown, trunk
from physique.provenance import digest, fingerprint, require_same, versions
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.process import quiet
from physique.store import prepare_folder, read_json, read_npz, write_json, write_npz

Array = NDArray[np.float64]

log = logging.getLogger(__name__)

_ATTEMPTS = 3  # at a round whose process was killed
_M_MMAP_THRESHOLD, _LARGE = -3, 1 << 17  # an option of glibc; bytes


@dataclass(frozen=True)
class Job:
    """What a process needs to know: the character, the motion q (T, 57), v (T, 56) under control
    (T - 1, 50), the weights of its LQR, the settings, and the folder of the rounds."""

    xml: str
    body: CapsuleBody
    q: Array
    v: Array
    control: Array
    weights: WeightsName
    settings: Settings
    folder: Path

    @cached_property
    def identity(self) -> dict[str, Any]:
        """All that decides the tree."""
        return {
            **asdict(self.settings),
            "weights": self.weights,
            "motion_sha256": digest((self.q, self.v, self.control)),
            "character_sha256": digest(self.xml),
            "versions": versions(),
            "method": METHOD,
        }

    @cached_property
    def fingerprint(self) -> str:
        """What tells rounds of this growth from those of another."""
        return fingerprint(self.identity)


@dataclass(frozen=True)
class Done:
    """A finished round: how many trials the tree stood, how many nothing led back, the nodes of the
    branches of the others, and the price: simulated steps, wall time and processor time, s."""

    covered: int
    failed: int
    nodes: tuple[int, ...]
    steps: int
    seconds: float
    cpu: float


@dataclass(frozen=True)
class GrowthProgress:
    """How far the growth is: rounds, trials that the tree stood of the latest ones, perturbed
    states and nodes in it, s to go."""

    done: int
    total: int
    coverage: float
    states: int
    nodes: int
    seconds_left: float


@dataclass(frozen=True)
class Growth:
    """The tree, and the rounds that made it."""

    tree: Tree
    rounds: tuple[tuple[Round, Done], ...]


def grow(
    character: Character,
    q: Array,
    v: Array,
    control: Array,
    weights: WeightsName,
    settings: Settings,
    folder: Path,
    *,
    workers: int,
    resume: bool,
    progress: Callable[[GrowthProgress], None] | None = None,
) -> Growth:
    """Grow a tree about the motion, keeping its rounds in `folder`.

    workers: processes; they do not change the tree. Raises InputError for a folder that holds
    rounds, where `resume` is not set or they are of another growth.
    """
    job = Job(character.xml, character.body, q, v, control, weights, settings, folder)
    rounds = plan(settings, len(q), float(character.model.opt.timestep))
    done = _open(job, rounds, resume)
    with quiet(), MujocoSimulator(character, 1) as simulator:
        start = root(make_trunk(simulator, q, v, control, weights))
    _gains_path(job).write_bytes(start.gains.tobytes())
    spent, made = 0.0, 0
    with _team(job, workers) as attempt:
        for index, round_ in enumerate(rounds):
            if round_.index in done:
                _add_gains(job, _load(job, round_.index)[1])
                continue
            clock = time.perf_counter()
            results = attempt(round_)
            seconds = time.perf_counter() - clock
            branches = [r.branch for r in results if r.branch is not None]
            found = Done(
                covered=sum(r.covered for r in results),
                failed=sum(not r.covered and r.branch is None for r in results),
                nodes=tuple(len(b.q) for b in branches),
                steps=sum(r.steps for r in results),
                seconds=seconds,
                cpu=sum(r.cpu for r in results),
            )
            _save(job, round_, found, branches)
            _add_gains(job, branches)
            done[round_.index] = found
            spent, made = spent + seconds, made + 1
            if progress is not None:
                left = spent / made * (len(rounds) - len(done))
                progress(_progress(rounds, done, index, left))
    grown_branches = [b for r in rounds for b in _load(job, r.index)[1]]
    tree = grown(start, grown_branches, _shared_gains(job, start, grown_branches))
    return Growth(tree, tuple((r, done[r.index]) for r in rounds))


def root(motion: Trunk) -> Tree:
    """The tree of the motion alone."""
    return trunk(motion.q, motion.v, motion.control, motion.com, motion.com_velocity, motion.gains)


def _progress(rounds: Sequence[Round], done: dict[int, Done], now: int, left: float) -> GrowthProgress:
    lately = [rounds[i] for i in range(max(0, now - 11), now + 1) if rounds[i].index in done]
    trials = sum(r.count for r in lately)
    nodes = [n for d in done.values() for n in d.nodes]
    return GrowthProgress(
        done=len(done),
        total=len(rounds),
        coverage=sum(done[r.index].covered for r in lately) / max(1, trials),
        states=len(nodes),
        nodes=sum(nodes),
        seconds_left=left,
    )


class _Worker:
    """One process's share: a grower, and how many rounds it has met, which come in their order.
    MuJoCo keeps silent until it is closed."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._met = 0
        with ExitStack() as stack:
            stack.enter_context(quiet())
            simulator = stack.enter_context(MujocoSimulator(load_character(job.xml, job.body), 1))
            motion = make_trunk(simulator, job.q, job.v, job.control, job.weights)
            self._grower = Grower(simulator, motion, job.settings)
            self.close = stack.pop_all().close

    def attempt(self, round_: Round, number: int) -> Attempt:
        """A trial of a round, against the tree of all rounds before it."""
        if self._met < round_.index:
            news = range(self._met, round_.index)
            branches = [b for i in news for b in _load(self._job, i)[1]]
            self._grower.meet(branches, _shared_gains(self._job, self._grower.tree, branches))
            self._met = round_.index
        return self._grower.attempt(round_, number)


_job: Job | None = None  # of a process in the pool, which has no other memory


@cache
def _worker() -> _Worker:
    # At the first trial: a fault here would pass for a killed process in `_begin`.
    assert _job is not None
    return _Worker(_job)


def _begin(job: Job) -> None:
    """Prepare a process that does nothing but grow, and lives as long as its parent at most."""
    global _job
    _job = job
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's
    threading.Thread(target=_end_with_parent, daemon=True).start()
    # glibc comes to keep large arrays that are freed, half of a process's memory, unless told not to.
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, _LARGE)


def _end_with_parent() -> None:
    """A parent that is killed cannot tell its processes to stop."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _attempt(round_: Round, number: int) -> Attempt:
    return _worker().attempt(round_, number)


@contextmanager
def _team(job: Job, workers: int) -> Iterator[Callable[[Round], list[Attempt]]]:
    """What makes all trials of a round, in their order."""
    if workers == 1:
        with closing(_Worker(job)) as alone:
            yield lambda round_: [alone.attempt(round_, n) for n in round_.numbers]
        return
    pool = _pool(job, workers)

    def attempt(round_: Round) -> list[Attempt]:
        nonlocal pool
        for left in range(_ATTEMPTS - 1, -1, -1):
            try:
                return list(pool.map(_attempt, [round_] * round_.count, round_.numbers))
            except BrokenProcessPool:
                if left == 0:
                    raise InputError(
                        str(job.folder),
                        f"that processes were killed {_ATTEMPTS} times in round {round_.index}",
                        f"{workers} processes that live",
                        "look for lack of memory, and go on with fewer --workers and --resume",
                    ) from None
                log.warning("a process was killed; making round %d again", round_.index)
                _kill(pool)
                pool = _pool(job, workers)
        raise AssertionError

    try:
        yield attempt
    except BaseException:
        _kill(pool)
        raise
    pool.shutdown()


def _pool(job: Job, workers: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), _begin, (job,))


def _kill(pool: ProcessPoolExecutor) -> None:
    """End a pool with all its processes: one that it started while it broke waits for work for ever."""
    processes = list((pool._processes or {}).values())
    pool.shutdown(wait=False, cancel_futures=True)
    for process in processes:
        process.kill()


def _gains_path(job: Job) -> Path:
    """All gains of the tree so far in one file, which processes map. It is written at each start."""
    return job.folder / "gains.bin"


def _add_gains(job: Job, branches: Sequence[Branch]) -> None:
    with _gains_path(job).open("ab") as file:
        for branch in branches:
            file.write(branch.gains.tobytes())


def _shared_gains(job: Job, tree: Tree, branches: Sequence[Branch]) -> NDArray[np.float16]:
    count = len(tree.gains) + sum(len(b.gains) for b in branches)
    shape = (count, *tree.gains.shape[1:])
    return np.asarray(np.memmap(_gains_path(job), GAIN_TYPE, "r", shape=shape))


def _path(folder: Path, index: int) -> Path:
    return folder / f"{index:05d}.npz"


def _save(job: Job, round_: Round, done: Done, branches: Sequence[Branch]) -> None:
    facts = {
        "growth": job.fingerprint,
        "round": round_.index,
        "covered": done.covered,
        "failed": done.failed,
        "steps": done.steps,
        "seconds": done.seconds,
        "cpu": done.cpu,
        "branches": [{"parent": b.parent, "frame": b.frame} for b in branches],
    }
    arrays = {"facts": np.array(json.dumps(facts))}
    for number, branch in enumerate(branches):
        for name in _ARRAYS:
            arrays[f"{number}_{name}"] = getattr(branch, name)
    write_npz(_path(job.folder, round_.index), arrays, compressed=False)


_ARRAYS = [f.name for f in fields(Branch) if f.name not in ("parent", "frame")]


def _load(job: Job, index: int) -> tuple[Done, tuple[Branch, ...]]:
    """A stored round and its branches. Raises InputError where it is missing, damaged or of another
    growth."""
    path = _path(job.folder, index)
    arrays = read_npz(path)
    try:
        facts = json.loads(str(arrays["facts"]))
        branches = tuple(
            Branch(**{n: arrays[f"{i}_{n}"] for n in _ARRAYS}, parent=b["parent"], frame=b["frame"])
            for i, b in enumerate(facts["branches"])
        )
        ours = facts["growth"] == job.fingerprint and facts["round"] == index
        found = Done(
            facts["covered"],
            facts["failed"],
            tuple(len(b.q) for b in branches),
            facts["steps"],
            facts["seconds"],
            facts["cpu"],
        )
    except (KeyError, TypeError, ValueError) as fault:
        raise InputError(str(path), f"a round without {fault}", "a whole one", "none is needed") from None
    if not ours:
        raise _ForeignError(
            str(path),
            "a round of another growth",
            "one with the same options and motion",
            "resume with those, or grow anew with --overwrite",
        )
    return found, branches


class _ForeignError(InputError):
    """A round of another growth, with which none can go on."""


def _open(job: Job, rounds: Sequence[Round], resume: bool) -> dict[int, Done]:
    """The rounds that are done already. Damaged ones are named and made again."""
    folder = job.folder
    held = sorted(folder.glob("*.npz")) if folder.is_dir() else []
    if held and not resume:
        raise InputError(
            str(folder),
            "a growth that was stopped",
            "none",
            "add --resume to go on with it, or --overwrite to grow anew",
        )
    prepare_folder(folder)
    about = folder / "growth.json"
    if resume and about.is_file():
        remedy = "resume with the same options and inputs, or grow anew with --overwrite"
        require_same(about, "a growth", read_json(about), job.identity, remedy)
    write_json(about, job.identity)
    done: dict[int, Done] = {}
    for round_ in rounds:
        if not _path(folder, round_.index).is_file():
            continue
        try:
            done[round_.index], _ = _load(job, round_.index)
        except _ForeignError:
            raise
        except InputError as fault:
            log.warning("%s; making that round again", fault)
    return done
