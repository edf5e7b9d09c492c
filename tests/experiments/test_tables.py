"""Tables 1 and 2, Fig. 6 and the recovery step, from their commands, on 0.8 s of standing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from physique.character import kinematics
from physique.errors import InputError
from physique.experiments import fig6, recovery, table1, table2
from physique.feedback.policy import load_policy
from physique.feedback.pushes import run_trial
from physique.runs.run import POLICY, load_run
from physique.simulation.mujoco_simulator import MujocoSimulator
from physique.simulation.stepper import Push
from physique.store import read_json


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What Table 2 leaves: its table, and a stabilised run."""
    folder = tmp_path_factory.mktemp("table2")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(table2, "IMPULSES", (1.0, 500.0))
        table2.main(["--out", str(folder), "--trials", "2"])
    return folder


@pytest.fixture(scope="module")
def grown(out: Path) -> Path:
    """The run with the tree of Table 1."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(table1, "FORCES", (900.0,))  # of the paper's this motion needs no branch
        table1.main([str(out / "standing"), "--trials", "1", "--workers", "1"])
    return out / "standing"


def rows(path: Path) -> list[list[str]]:
    return [line[2:-2].split(" | ") for line in path.read_text(encoding="utf-8").splitlines()]


def test_table_2_is_what_the_pushes_left(out: Path) -> None:
    head, _, speed, *bodies = rows(out / "table2.md")
    assert head == ["impulse, Ns", "1", "500"]
    assert float(speed[1]) == pytest.approx(1 / 75, abs=0.01)
    assert float(speed[2]) == pytest.approx(500 / 75, abs=0.01)
    survived = {row[0]: row[1:3] for row in bodies}
    assert survived["PD in the paper, %"] == ["3", "4"]
    # Nobody falls of 1 Ns under LQR, and nobody stands 500.
    assert survived["LQR, %"] == ["100", "0"]
    assert survived["PD, %"][1] == "0"


def test_table_1_counts_the_tree_that_it_grew(grown: Path) -> None:
    _, _, *subtrees = rows(grown / "table1.md")
    tree = read_json(grown / "tree.json")
    assert len(subtrees) == len(tree["subtrees"]) >= 4
    assert [row[0] for row in subtrees] == [str(subtree["timestep"]) for subtree in tree["subtrees"]]
    assert sum(int(row[1]) for row in subtrees) == tree["perturbed_states"] > 0
    assert subtrees[0][3:] == ["230", "7", "140"]


def test_figure_6_shows_both_controllers(grown: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fig6.main([str(grown), "--at", "0.65", "--force", "5"])
    said = capsys.readouterr().out
    assert "lqr: recovers, greatest error 0.0" in said
    assert "tree: recovers, greatest error 0.0" in said
    assert "_ankle at 0.65 s" in said
    assert matplotlib.image.imread(grown / "fig6.png").std() > 0.01
    assert (grown / "fig6.webp").stat().st_size > 1000


def test_a_recovery_step_is_drawn_and_told(
    grown: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run = load_run(grown)
    joints = kinematics.joint_positions(run.character(), run.trajectory.q)
    push = Push(0, (0.0, 20.0, 0.0), 60, 10)
    with MujocoSimulator(run.character(), 1) as simulator:
        trials = {
            name: run_trial(simulator, load_policy(grown / POLICY, name), push, joints)
            for name in ("lqr", "tree")
        }
    trials["lqr"] = replace(trials["lqr"], lost=0.25)
    monkeypatch.setattr(recovery, "find", lambda *_: (recovery.Step("left", 20, 0.15), trials))
    recovery.main([str(grown), "--impulse", "2"])
    said = capsys.readouterr().out
    assert "2 Ns on the pelvis at 0.60 s: lqr is lost after 0.25 s; with the tree" in said
    assert "the left foot comes down 0.15 m from its place 0.20 s after the push" in said
    assert np.std(matplotlib.image.imread(grown / "recovery.png")) > 0.01
    assert (grown / "recovery.mp4").stat().st_size > 1000


def test_no_recovery_step_is_a_fault_that_says_what_to_try(grown: Path) -> None:
    with pytest.raises(InputError, match="no recovery step in 2 pushes of 1 Ns"):
        recovery.main([str(grown), "--impulse", "1", "--trials", "2"])
