"""The command line: what it prints, its exit codes, and one clear line for whatever is wrong."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from command_line import call
from physique import skeleton
from physique.body.named import PEOPLE
from physique.export.bvh import write_bvh
from physique.motion.library import list_clips
from physique.motion.read import read_motion
from physique.provenance import digest
from physique.reference.target import joint_weights, upright_weights

OK, BAD = 0, 2
WALK = ["retarget", "walk", "--body", "average", "--out", "not_made"]


def refusal(capfd: pytest.CaptureFixture[str], *arguments: object) -> str:
    """What a command that must be refused says; nothing else may be printed."""
    assert call(*arguments) == BAD
    printed = capfd.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("physique: ")
    assert printed.err.count("\n") == 1
    assert "found" in printed.err
    assert "expected" in printed.err
    return printed.err


@pytest.fixture(scope="session")
def bvh(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A short walk as the text of a BVH file."""
    motion = read_motion("walk", start=0.2, end=0.6)
    path = tmp_path_factory.mktemp("bvh") / "walk.bvh"
    rest = motion.rest_joints
    offsets = np.array([rest[j] - rest[max(p, 0)] for j, p in enumerate(skeleton.PARENTS)])
    write_bvh(path, skeleton.JOINTS, skeleton.PARENTS, offsets, motion.rotations, motion.root, motion.fps)
    return path.read_text()


def test_the_lists_name_all(capfd: pytest.CaptureFixture[str]) -> None:
    assert call("bodies") == OK
    text = capfd.readouterr().out
    assert all(name in text for name in PEOPLE)
    assert call("clips") == OK
    lines = capfd.readouterr().out.splitlines()
    for clip in list_clips():
        line = next(line for line in lines if line.split()[:1] == [clip.name])
        assert f"{clip.seconds:.2f}" in line
        assert "zlib" in line


def test_body_json_has_the_documented_keys(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out, picture = tmp_path / "new" / "b.npz", tmp_path / "b.png"
    assert (
        call(
            "body",
            "--sex",
            "female",
            "--height",
            1.6,
            "--mass",
            58,
            "--json",
            "--out",
            out,
            "--picture",
            picture,
        )
        == OK
    )
    made = json.loads(capfd.readouterr().out)
    assert set(made) == {
        "height_m",
        "mass_kg",
        "volume_m3",
        "capsule_error_cm",
        "capsule_error_max_cm",
        "segment_mass",
        "fit_seconds",
    }
    assert made["height_m"] == pytest.approx(1.6, abs=1e-3)
    assert made["mass_kg"] == pytest.approx(58, abs=0.02)
    assert set(made["segment_mass"]) == set(skeleton.JOINTS)
    assert sum(made["segment_mass"].values()) == pytest.approx(made["mass_kg"])
    assert picture.read_bytes().startswith(b"\x89PNG")
    # The stored body is the same body.
    assert call("body", out, "--json") == OK
    stored = json.loads(capfd.readouterr().out)
    assert stored["segment_mass"] == made["segment_mass"]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["dance"], "expected one of bodies, clips"),
        (["retraget"], "did you mean 'retarget'?"),
        (["--verison"], "did you mean '--version'?"),
        (["body", "nobody"], "average"),
        (["body", "hevy"], "did you mean 'heavy'?"),
        (["body", "missing.npz"], "no such file"),
        (["body", "heavy", "--mass", "70"], "one or the other"),
        (["body", "--height", "3"], "3 m"),
        (["body", "--height", "12"], "such as 1.63m, 178cm, 5ft10 or 70in"),
        (["body", "--mass", "-5"], "-5"),
        (["body", "--mass", "nan"], "nan"),
        (["body", "--mass", "much"], "much"),
        (["body", "--sex", "other"], "other"),
        (["body", "--wings", "2"], "--wings"),
        (["body", "--heigth=1.8"], "did you mean '--height'?"),
        (["retarget", "walk", "--body", "average"], "found missing from physique retarget: --out DIR; "),
        (["push", "out", "--impulse", "15Ns"], "found '15Ns' for --impulse; "),
        ([*WALK, "--torque-limit", "100Nm"], "see `physique retarget --help`"),
        (["retarget", "wlak", *WALK[2:]], "did you mean 'walk'?"),
        ([*WALK[:3], "hevy", *WALK[4:]], "did you mean 'heavy'?"),
        ([*WALK, "--start", "2 min"], "such as 1.5, 1.5s or 500ms"),
        ([*WALK, "--weight", "roots=2"], "com, com_velocity, pose, velocity, root, acceleration"),
        ([*WALK, "--weight", "joints=2"], "no such weight"),
        ([*WALK, "--weight", "com"], "NAME=NUMBER"),
        ([*WALK, "--weight", "com=much"], "no number"),
        ([*WALK, "--weight", "com=nan"], "no number"),
        ([*WALK, "--weight", "com=-1"], "0 to 1e+09"),
        ([*WALK, "--weight", "com=1", "--weight", "com=2"], "two values"),
        ([*WALK, "--hold", "stick:2"], "without a unit"),
        ([*WALK, "--hold", "stick:-2kg"], "-2 kg"),
        ([*WALK, "--hold", "spear:2kg"], "stick or block"),
        ([*WALK, "--hold", "stick:2kg", "--hand", "third"], "third"),
        ([*WALK, "--hand", "left"], "--hold"),
    ],
)
def test_bad_arguments_are_refused_in_one_line(
    capfd: pytest.CaptureFixture[str], arguments: list[str], text: str
) -> None:
    assert text in refusal(capfd, *arguments)
    assert not Path("not_made").exists()


def test_an_output_of_the_wrong_kind_is_refused(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert ".npz" in refusal(capfd, "body", "--out", tmp_path / "body.txt")
    assert ".png" in refusal(capfd, "body", "--picture", tmp_path / "body.jpg")
    (tmp_path / "file").write_text("mine")
    assert "file" in refusal(capfd, "body", "--out", tmp_path / "file" / "b.npz")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file"]


DAMAGE = {
    "nan": lambda text: text.replace(text.splitlines()[-1].split()[7], "nan"),
    "twice": lambda text: text.replace("JOINT right_knee", "JOINT left_knee"),
    "no frames": lambda text: text[: text.index("MOTION")] + "MOTION\nFrames: 0\nFrame Time: 0.01",
    "cut off": lambda text: text[: int(0.8 * len(text))],
    "no motion": lambda text: text[: text.index("MOTION")],
    "empty": lambda text: "",
    "no text": lambda text: "\x00\xff" * 500,
    "rate": lambda text: "\n".join(
        "Frame Time: 0" if line.startswith("Frame Time") else line for line in text.splitlines()
    ),
    "unit": lambda text: "\n".join(
        line.split("OFFSET")[0] + "OFFSET " + " ".join(f"{1e6 * float(x)}" for x in line.split()[1:])
        if "OFFSET" in line
        else line
        for line in text.splitlines()
    ),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_damaged_file_is_refused_and_nothing_written(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, bvh: str, damage: str
) -> None:
    path, out = tmp_path / "clip.bvh", tmp_path / "out"
    path.write_text(DAMAGE[damage](bvh), encoding="latin1")
    text = refusal(capfd, "retarget", path, "--body", "average", "--out", out)
    assert "clip.bvh" in text
    assert not out.exists()


def test_files_that_only_look_odd_are_read_and_others_refused(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, mocap: Path
) -> None:
    readable = {"crlf.bvh", "lower.bvh", "tabsframe.bvh"}
    files = sorted((mocap / "malformed").iterdir())
    assert readable < {f.name for f in files}
    for file in files:
        if file.name in readable:
            assert read_motion(file).frames == 173
        else:
            out = tmp_path / "out"
            text = refusal(capfd, "retarget", file, "--body", "average", "--out", out)
            assert file.stem in text
            assert not out.exists()


def test_a_damaged_body_file_is_refused(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "b.npz"
    for content in (b"", b"PK\x03\x04 not really", os.urandom(2000)):
        path.write_bytes(content)
        out = tmp_path / "out"
        assert "b.npz" in refusal(capfd, "retarget", "walk", "--body", path, "--out", out)
        assert not out.exists()


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="needs a file system that refuses folders")
def test_an_unwritable_folder_is_refused(capfd: pytest.CaptureFixture[str]) -> None:
    # Not even the superuser makes folders there.
    text = refusal(capfd, "retarget", "walk", "--body", "average", "--out", "/proc/physique/run")
    assert "/proc/physique" in text
    assert "a folder that can be written" in text


def test_retarget_prints_its_metrics_and_a_second_run_is_refused(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, bvh: str
) -> None:
    path, out = tmp_path / "clip.bvh", tmp_path / "out"
    path.write_text(bvh)
    arguments = [
        "retarget",
        path,
        "--body",
        "thin",
        "--end",
        0.1,
        "--torque-limit",
        150,
        "--threads",
        1,
        "--out",
        out,
    ]
    assert call(*arguments) == OK
    printed = capfd.readouterr()
    assert "joint error" in printed.out
    assert str(out) in printed.out
    assert "clip on thin: 0.1 of 0.1 s" in printed.err
    metrics = json.loads((out / "metrics.json").read_text())
    assert {
        "success",
        "mpjpe_mm",
        "mpjpe_max_mm",
        "mpjpe_local_mm",
        "root_error_mm",
        "foot_skate_mm_per_s",
        "foot_skate_source_mm_per_s",
        "penetration_mm",
        "penetration_max_mm",
        "cost",
        "torque_saturation",
        "sim_steps",
        "sim_steps_per_motion_s",
        "wall_s",
        "wall_s_per_motion_s",
        "seed",
        "versions",
        "windows",
        "worst_frame",
    } <= set(metrics)
    assert {"start", "end", "cost", "mpjpe_mm", "sim_steps"} <= set(metrics["windows"][0])
    assert metrics["versions"].keys() >= {"physique", "mujoco", "numpy"}
    before = {p.name: p.read_bytes() for p in out.iterdir()}
    assert "--resume" in refusal(capfd, *arguments)
    assert "limit 150" in refusal(capfd, *arguments[:7], 120, *arguments[8:], "--resume")
    assert {p.name: p.read_bytes() for p in out.iterdir()} == before


def test_weights_and_objects_reach_the_run(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert (
        call(
            "retarget",
            "walk",
            "--body",
            "average",
            "--end",
            0.06,
            "--threads",
            1,
            "--out",
            out,
            "--weight",
            "com=30",
            "--weight",
            "root=2",
            "--hold",
            "block:3kg:0.15m",
            "--hand",
            "both",
        )
        == OK
    )
    identity = json.loads((out / "run.json").read_text())["identity"]
    assert (identity["weight_com"], identity["weight_root"], identity["weight_pose"]) == (30, 2, 0.5)
    assert identity["joint_weights_sha256"] == digest(upright_weights().joints)
    assert (identity["hold"], identity["hand"]) == ("block:3.0kg:0.15m", "both")
    assert json.loads((out / "metrics.json").read_text())["held_mass_kg"] == 6
    assert (out / "character.xml").read_text().count("held_") == 2


@pytest.mark.parametrize(
    ("options", "paper"),
    [
        ([], False),
        (["--weights", "paper"], True),
        (["--optimizer", "paper"], True),
        (["--optimizer", "paper", "--weights", "default"], False),
    ],
)
def test_which_weights_are_minimised(
    options: list[str], paper: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setattr(
        "physique.commands.retarget.retarget", lambda *_, **told: asked.append(told["weights"])
    )
    monkeypatch.setattr("physique.cli.console.show_runs", lambda runs: None)
    assert call("retarget", "walk", "--body", "average", "--out", tmp_path / "run", *options) == OK
    assert np.array_equal(asked[0].joints, joint_weights() if paper else upright_weights().joints)


@pytest.mark.skipif(os.name != "posix", reason="sends POSIX signals")
def test_ctrl_c_stops_with_one_line_and_the_run_can_be_resumed(tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "physique",
            "retarget",
            "walk",
            "--body",
            "average",
            "--end",
            "3",
            "--threads",
            "1",
            "--out",
            str(out),
        ],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 300
    while not (out / "run.json").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    try:
        _, err = process.communicate(timeout=300)
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
    assert process.returncode == 130
    assert "Traceback" not in err
    assert "--resume" in err.splitlines()[-1]
    assert json.loads((out / "run.json").read_text())["status"] == "running"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [([], "retarget"), (["--version"], "MuJoCo 4."), (["retarget", "--help"], "--torque-limit")],
)
def test_help_and_module_call(arguments: list[str], text: str) -> None:
    command = [sys.executable, "-m", "physique", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert text in done.stdout
    assert done.stderr == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, which Linux has")
@pytest.mark.parametrize("command", [["clips"], ["--version"]])
def test_what_a_full_disk_loses_is_said(command: list[str]) -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "physique", *command],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 2
    assert done.stderr.startswith("physique: standard output: found no space left on device; expected")
    assert len(done.stderr.splitlines()) == 1
