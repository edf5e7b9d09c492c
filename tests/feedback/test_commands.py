"""The commands stabilize, push and grow, and the experiments' tables."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from command_line import call
from physique import skeleton
from physique.commands.grow import grow_tree
from physique.commands.push import PushReport
from physique.commands.stabilize import stabilize, write_policy
from physique.errors import InputError
from physique.experiments import fig6, table1, table2
from physique.experiments.recovery import longest_step
from physique.feedback import growth
from physique.feedback.policy import load_policy
from physique.runs.run import load_run
from physique.store import write_json

KEYS = {
    "controller",
    "trials",
    "survived",
    "survival",
    "median_recovery_s",
    "impulse_ns",
    "delta_v",
    "decision_ms",
    "realtime_factor",
}


@pytest.fixture(scope="module")
def copy(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("commands") / "run"
    shutil.copytree(folder, target)
    (target / "policy.npz").unlink()
    return target


def test_the_commands_work_together(
    copy: Path, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    push = ["push", copy, "--impulse", 10, "--trials", 3, "--from", 0, "--to", 0.1, "--json"]
    assert call(*push) == 2
    assert "physique stabilize" in capfd.readouterr().err
    assert call("stabilize", copy, "--weights", "paper") == 0
    assert call("stabilize", copy) == 2
    assert "a policy of the weights paper" in capfd.readouterr().err
    assert call("stabilize", copy, "--overwrite") == 0
    assert "policy.npz" in capfd.readouterr().out
    assert "replaces policy.npz" in caplog.text
    assert call(*push, "--controller", "tree") == 2
    assert "physique grow" in capfd.readouterr().err
    assert call(*push, "--controller", "lqr") == 0
    made = json.loads(capfd.readouterr().out)
    assert set(made) == KEYS
    assert made["trials"] == 3
    assert made["decision_ms"] is None
    assert made["delta_v"] == pytest.approx(10 / 75, rel=1e-3)
    grow = ["grow", copy, "--interval", 0.3, "--forces", "900", "--trials", 2, "--workers", 1]
    assert call(*grow) == 0
    printed = capfd.readouterr()
    assert "simulated steps" in printed.out
    assert "covered" in printed.err
    tree = json.loads((copy / "tree.json").read_text())
    assert tree["trials"] == sum(s["trials"] for s in tree["subtrees"])
    assert tree["perturbed_states"] == load_policy(copy / "policy.npz").tree.branches > 0
    assert not (copy / "tree").exists()
    made_at = (copy / "policy.npz").stat().st_mtime_ns
    assert call(*grow, "--resume") == 0
    assert capfd.readouterr().out == printed.out
    assert "the tree is finished" in caplog.text
    assert call(*grow, "--seed", 1, "--resume") == 2
    assert "other options" in capfd.readouterr().err
    for again in (grow, ["stabilize", copy]):
        assert call(*again) == 2
        said = capfd.readouterr().err
        assert f"tree.json ({tree['perturbed_states']} states" in said
        assert "--overwrite" in said
    assert call(*grow, "--resume", "--overwrite") == 2
    assert "--resume and --overwrite" in capfd.readouterr().err
    assert (copy / "policy.npz").stat().st_mtime_ns == made_at
    assert call(*push, "--controller", "tree") == 0
    made = json.loads(capfd.readouterr().out)
    assert set(made["decision_ms"]) == {"median", "worst"}
    table = table1.table(tree)
    assert len(table.splitlines()) == 2 + len(tree["subtrees"])


def test_growing_takes_the_weights_that_are_there(
    copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(copy, folder)
    stabilize(folder, "paper", overwrite=True)
    before = (folder / "policy.npz").read_bytes()
    asked: list[str] = []

    def grow(*arguments: object, **_: object) -> None:
        asked.append(str(arguments[4]))
        raise KeyboardInterrupt

    monkeypatch.setattr(growth, "grow", grow)
    for weights, overwrite in ((None, False), ("paper", False), ("default", True)):
        with pytest.raises(KeyboardInterrupt):
            grow_tree(folder, weights=weights, overwrite=overwrite)
    assert asked == ["paper", "paper", "default"]
    assert "growing with its weights, paper" in caplog.text
    with pytest.raises(InputError, match="a policy of the weights paper; expected default"):
        grow_tree(folder, weights="default")
    assert stabilize(folder, "paper").controller == "lqr"
    assert (folder / "policy.npz").read_bytes() == before
    monkeypatch.setattr("physique.commands.stabilize.versions", lambda: {})
    with pytest.raises(InputError, match="a policy of other versions"):
        stabilize(folder, "paper")


def test_a_growth_replaces_a_tree_only_when_it_is_done(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    target = tmp_path / "run"
    shutil.copytree(folder, target)
    run = load_run(target)
    write_policy(run, run.policy().tree, {"weights": "default", "tree": {"seed": 1}})
    write_json(target / "tree.json", {"perturbed_states": 7, "seconds": 60.0})
    (target / "tree").mkdir()
    (target / "tree" / "00000.npz").write_bytes(b"of another growth")
    with pytest.raises(InputError, match=r"a finished tree of other options, tree\.json \(7 states"):
        grow_tree(target)

    def stop(*_: object, **__: object) -> None:
        assert not (target / "tree").exists()
        raise KeyboardInterrupt

    monkeypatch.setattr(growth, "grow", stop)
    with pytest.raises(KeyboardInterrupt):
        grow_tree(target, overwrite=True)
    assert "replaces tree" in caplog.text
    assert "replaces policy.npz, tree.json (7 states, 60 s of growth)" in caplog.text
    assert (target / "tree.json").exists()
    stabilize(target, overwrite=True)
    assert not (target / "tree.json").exists()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["push", "RUN", "--impulse", "x"], "impulse"),
        (["grow", "RUN", "--forces", "1,a"], "--forces"),
        (["grow", "RUN", "--forces", "-5"], "forces"),
        (["grow", "RUN", "--parts", "tail"], "names of parts"),
        (["grow", "RUN", "--interval", "0"], "interval"),
        (["grow", "RUN", "--workers", "0"], "workers"),
        (["grow", "RUN", "--trials", "0"], "trials"),
        (["stabilize", "nowhere"], "nowhere"),
        (["stabilize", "RUN", "--weights", "best"], "weights"),
    ],
)
def test_bad_arguments_are_one_line(
    folder: Path, capfd: pytest.CaptureFixture[str], arguments: list[str], text: str
) -> None:
    assert call(*(folder if a == "RUN" else a for a in arguments)) == 2
    printed = capfd.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert text in printed.err


def test_table_2_stands_beside_the_papers() -> None:
    reports = [PushReport("lqr", 100, n, n / 100, None, 5.0, 0.1, None, 9.0) for n in (91, 60, 30, 10, 6)]
    text = table2.table({"pd": reports, "lqr": reports})
    assert "| LQR, % | 91 | 60 | 30 | 10 | 6 |" in text
    assert "| LQR in the paper, % | 89 | 28 | 20 | 8 | 5 |" in text


def test_the_kicking_foot_is_the_highest_one() -> None:
    joints = np.zeros((50, 22, 3))
    joints[30, 8, 2] = 1.0  # the right ankle
    joints[10, 7, 2] = 0.5
    assert fig6.kicking_foot(joints, 0.01, None) == (8, 30)
    assert fig6.kicking_foot(joints, 0.01, 0.1) == (7, 10)


def test_a_recovery_step_is_a_foot_that_is_set_down_elsewhere() -> None:
    wanted = np.zeros((120, 22, 3))
    toes = skeleton.INDEX["left_foot"]
    moved = np.clip((np.arange(120) - 40) / 20.0, 0.0, 1.0)[:, None] * np.array([0.2, -0.1, 0.0])
    slid = wanted.copy()
    slid[:, toes] += moved
    assert longest_step(slid, wanted, 0.01) is None
    stepped = slid.copy()
    stepped[40:61, toes, 2] = 0.1 * np.sin(np.linspace(0.0, np.pi, 21))
    step = longest_step(stepped, wanted, 0.01)
    assert step is not None
    assert step.foot == "left"
    assert 58 <= step.frame <= 62
    assert step.length == pytest.approx(np.hypot(0.2, 0.1), abs=0.01)
    assert longest_step(stepped, stepped, 0.01) is None  # the motion's own step is none
    falling = stepped.copy()
    falling[60:, toes, 2] += 0.3  # in the air to the end
    assert longest_step(falling, wanted, 0.01) is None
