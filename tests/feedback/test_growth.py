"""A growth is the same on any number of processes, stopped, damaged, and with killed processes."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from physique.errors import InputError
from physique.feedback import growth
from physique.feedback.grow import Round, Settings
from physique.feedback.tree import Tree
from physique.runs.run import Run

FEW = Settings(interval=0.25, forces=(600.0,), trials=2)


def grow(
    run: Run,
    folder: Path,
    settings: Settings = FEW,
    *,
    workers: int = 1,
    resume: bool = False,
    progress: Callable[[growth.GrowthProgress], None] | None = None,
) -> growth.Growth:
    motion = run.trajectory
    return growth.grow(
        run.character(),
        motion.q,
        motion.v,
        motion.control,
        "default",
        settings,
        folder,
        workers=workers,
        resume=resume,
        progress=progress,
    )


@pytest.fixture(scope="module")
def whole(run: Run, tmp_path_factory: pytest.TempPathFactory) -> growth.Growth:
    """On one process, without trouble."""
    told: list[growth.GrowthProgress] = []
    made = grow(run, tmp_path_factory.mktemp("growth") / "tree", progress=told.append)
    assert made.tree.branches > 0
    assert told[-1].done == told[-1].total == len(made.rounds) == 2
    assert told[-1].states == made.tree.branches
    return made


def same(a: Tree, b: Tree) -> bool:
    return all(np.array_equal(x, getattr(b, name)) for name, x in vars(a).items())


def test_it_is_the_same_resumed_and_damaged(
    run: Run, whole: growth.Growth, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    grow(run, tmp_path / "tree")
    with pytest.raises(InputError, match="--resume"):
        grow(run, tmp_path / "tree")
    # The first round lost, the last damaged: both are made again, the damage is named.
    paths = sorted((tmp_path / "tree").glob("*.npz"))
    paths[0].unlink()
    paths[-1].write_bytes(paths[-1].read_bytes()[:-20])
    with caplog.at_level(logging.WARNING):
        again = grow(run, tmp_path / "tree", resume=True)
    assert paths[-1].name in caplog.text
    assert same(whole.tree, again.tree)


def test_another_growth_is_refused_by_its_difference(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "tree"

    def stop(_: growth.GrowthProgress) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        grow(run, folder, progress=stop)
    with pytest.raises(InputError, match="a growth with seed 0; expected 1, as asked for now"):
        grow(run, folder, replace(FEW, seed=1), resume=True)
    monkeypatch.setattr(growth, "versions", lambda: {"numba": "0.1"})
    with pytest.raises(InputError, match=r"a growth with versions cma .*; expected None"):
        grow(run, folder, resume=True)
    monkeypatch.undo()
    monkeypatch.setitem(growth.METHOD["fast"], "horizon", 61)
    with pytest.raises(InputError, match="a growth with method fast horizon 60; expected 61"):
        grow(run, folder, resume=True)
    monkeypatch.undo()
    # Rounds do not depend on what stands beside them.
    (folder / "growth.json").unlink()
    with pytest.raises(InputError, match="a round of another growth"):
        grow(run, folder, replace(FEW, seed=1), resume=True)


def test_two_processes_give_the_same_tree_though_one_is_killed(
    run: Run,
    whole: growth.Growth,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    make, made = growth._pool, []

    def killed_at_first(job: growth.Job, workers: int) -> ProcessPoolExecutor:
        pool = make(job, workers)
        if not made:
            pool.submit(os.getpid)
            (process,) = multiprocessing.active_children()
            assert process.pid is not None
            os.kill(process.pid, signal.SIGKILL)
        made.append(pool)
        return pool

    monkeypatch.setattr(growth, "_pool", killed_at_first)
    with caplog.at_level(logging.WARNING):
        found = grow(run, tmp_path / "tree", workers=2)
    assert "a process was killed; making round 0 again" in caplog.text
    assert len(made) == 2
    assert multiprocessing.active_children() == []
    assert same(whole.tree, found.tree)


def test_bad_input_in_a_process_arrives_as_itself(run: Run, tmp_path: Path) -> None:
    motion = run.trajectory
    job = growth.Job("<mujoco/>", run.body, motion.q, motion.v, motion.control, "default", FEW, tmp_path)
    with growth._pool(job, 1) as pool:
        tried = pool.submit(growth._attempt, Round(0, 0, 600.0, 0, 1), 0)
        with pytest.raises(InputError, match="character model: found 0 actuators") as fault:
            tried.result()
    assert fault.value.remedy == "make the run anew"


def test_processes_that_are_killed_again_and_again_are_told_in_a_line(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Killed:
        _processes = None

        def map(self, *_: object) -> None:
            raise BrokenProcessPool

        def shutdown(self, **_: object) -> None:
            pass

    made: list[Killed] = []
    monkeypatch.setattr(growth, "_pool", lambda *_: made.append(Killed()) or made[-1])
    with pytest.raises(InputError, match=r"killed 3 times in round 0;.*--workers"):
        grow(run, tmp_path / "tree", workers=2)
    assert len(made) == 3
