"""Runs as files: the right writer, safe names, one line for what cannot be, whole files only."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from dataclasses import replace
from inspect import signature
from pathlib import Path
from pkgutil import resolve_name

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import physique
from command_line import call
from physique.cli import parse
from physique.cli.show import ExportCommand
from physique.commands.export import export_run, file_names
from physique.errors import InputError
from physique.export import formats
from physique.export.formats import FORMATS, Format
from physique.runs.run import Run, finish_run, load_run

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def folder(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("runs") / "walk"
    path.mkdir()
    finish_run(path, run)
    return path


@pytest.mark.parametrize(
    ("kind", "name", "start"),
    [
        ("bvh", "a.bvh", b"HIERARCHY"),
        ("usd", "a.usd", b"PXR-USDC"),
        ("usd", "a.usda", b"#usda"),
        ("amass", "a.npz", b"PK"),
        ("mjcf", "a.xml", b"<mujoco"),
        ("csv", "a.csv", b"time_s,"),
        ("mp4", "a.mp4", b"\x00\x00\x00"),
    ],
)
def test_each_format_from_the_command_line(
    folder: Path, tmp_path: Path, kind: str, name: str, start: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / name
    more = ["--size", 64, 48] if kind == "mp4" else []
    assert call("export", folder, "--format", kind, "--out", out, *more) == 0
    assert capfd.readouterr().out == f"{out}\n"
    assert out.read_bytes().startswith(start)
    assert [path.name for path in out.parent.iterdir()] == [name]


def test_the_suffix_says_the_format(folder: Path, tmp_path: Path) -> None:
    for kind in FORMATS:
        if kind.name in ("glb", "mp4"):
            continue
        for suffix in kind.suffixes:
            out = tmp_path / f"a{suffix}"
            assert physique.export_run(folder, None, out) == [out]


def test_bvh_holds_the_simulation_or_the_source(run: Run, tmp_path: Path) -> None:
    made = [export_run(run, "bvh", tmp_path / f"{source}.bvh", source=source)[0] for source in (False, True)]
    lines = [path.read_text().splitlines()[-run.trajectory.frames :] for path in made]
    places = [np.array([[float(x) for x in line.split()[:3]] for line in part]) for part in lines]
    # Centimetres, with the world's x along the file's z.
    for place, q in zip(places, (run.trajectory.q, run.trajectory.source_q)):
        assert place[:, 2] == pytest.approx(100 * q[:, 0], abs=1e-3)
        assert place[:, 1] == pytest.approx(100 * q[:, 2], abs=1e-3)


def test_several_runs_share_a_file_or_go_to_a_folder(run: Run, tmp_path: Path) -> None:
    files = export_run([run, run], "csv", tmp_path / "tables")
    assert [path.name for path in files] == ["walk_on_average.csv", "walk_on_average_2.csv"]
    assert all(path.is_file() for path in files)
    assert len(export_run([run, run], "usd", tmp_path / "both.usd")) == 1
    with pytest.raises(InputError, match="one file for 2 runs"):
        export_run([run, run], "csv", tmp_path / "both.csv")


def test_glb_gets_the_runs_and_its_options(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def write_glb(path: Path, runs: Sequence[Run], *, source: bool = False, capsules: bool) -> Path:
        path.write_text(f"{len(runs)} {source} {capsules}")
        return path

    monkeypatch.setattr("physique.export.gltf.write_glb", write_glb)
    out = tmp_path / "both.glb"
    assert export_run([run, run], None, out, capsules=True) == [out]
    assert out.read_text() == "2 False True"


def test_names_of_a_run_cannot_leave_the_folder(run: Run, tmp_path: Path) -> None:
    evil = replace(
        run,
        record={"identity": {"clip": "../../etc/passwd", "body": "x"}},
        body=replace(run.body, name="/root/..\\C:"),
    )
    out = tmp_path / "inside"
    files = export_run([evil, run], "bvh", out)
    assert {path.parent for path in files} == {out}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["inside"]


@given(st.lists(st.text(max_size=200), min_size=1, max_size=8))
def test_file_names_are_plain_and_different(titles: Sequence[str]) -> None:
    names = file_names(titles)
    assert len({name.lower() for name in names}) == len(titles)
    for name in names:
        assert Path(name).name == name
        assert name.isascii()
        assert 0 < len(name) < 100
        assert not set(name) & set('/\\:*?"<>|. \0')


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--out", "a.txt"], "the suffix '.txt'"),
        (["--out", "a.fbx"], "write a .glb, then `python tools/glb_to_fbx.py"),
        (["--format", "FBX", "--out", "a.fbx"], "tools/glb_to_fbx.py"),
        (["--format", "csv", "--out", "a.txt"], "a file that ends in .csv"),
        (["--format", "csv", "--out", "a.csv", "--capsules"], "option capsules"),
        (["--format", "usd", "--out", "a.usd", "--rate", "5"], "option rate"),
        (["--format", "mjcf", "--out", "a.xml", "--size", "64", "48"], "option size"),
        (["--format", "mjcf", "--out", "a.xml", "--rate", "0"], "a positive number"),
        (["--format", "mp4", "--out", "a.mp4", "--size", "63", "48"], "even numbers"),
        (["--format", "csv"], "--out"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    arguments: list[str],
    text: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call("export", folder, *arguments) == 2
    printed = capfd.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("physique: ")
    assert printed.err.count("\n") == 1
    assert text in printed.err
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_no_run_is_named(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert call("export", tmp_path, "--out", tmp_path / "a.csv") == 2
    assert "no run.json" in capfd.readouterr().err
    assert list(tmp_path.iterdir()) == []
    assert call("export", "--out", tmp_path / "a.csv") == 2
    assert "at least one run" in capfd.readouterr().err


def test_an_export_that_fails_leaves_the_old_file(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from physique.render import scene

    out = tmp_path / "a.mp4"
    out.write_bytes(b"old")
    drawn = scene.Scene.picture

    def failing(self: scene.Scene, frame: int) -> NDArray[np.uint8]:
        if frame > 4:
            raise KeyboardInterrupt
        return drawn(self, frame)

    monkeypatch.setattr(scene.Scene, "picture", failing)
    with pytest.raises(KeyboardInterrupt):
        export_run(run, "mp4", out, size=(64, 48))
    assert out.read_bytes() == b"old"
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]


def test_a_run_of_one_frame_can_be_exported(run: Run, tmp_path: Path) -> None:
    one = replace(run, trajectory=run.trajectory.beginning(1))
    for kind in FORMATS:
        out = tmp_path / f"a{kind.suffixes[0]}"
        assert export_run(one, kind.name, out, size=(64, 48) if kind.name == "mp4" else None) == [out]
        assert out.is_file()


def test_the_same_run_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    run = load_run(folder)
    for kind in FORMATS:
        suffix = kind.suffixes[-1]  # .usda is text
        size = (64, 48) if kind.name == "mp4" else None
        a, b = (export_run(run, kind.name, tmp_path / f"{n}{suffix}", size=size)[0] for n in "ab")
        assert a.read_bytes() == b.read_bytes(), kind.name


def test_the_documented_commands_are_commands() -> None:
    page = Path(__file__).resolve().parents[2] / "docs" / "export.md"
    blocks = re.findall(r"```console\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    commands = [line for block in blocks for line in block.splitlines() if "physique " in line]
    assert len(commands) >= 5
    for command in commands:
        made = parse(shlex.split(command)[1:])
        assert isinstance(made, ExportCommand)
        assert any(kind.owns(made.out) for kind in FORMATS)


def test_the_page_of_formats_has_them_all() -> None:
    """Its tables of uses and of units have a line for each, its text the options of each."""
    page = (Path(__file__).resolve().parents[2] / "docs" / "export.md").read_text(encoding="utf-8")
    _, uses, units, options, *_ = re.split(r"^## ", page, flags=re.MULTILINE)
    for kind in FORMATS:
        assert f"`{kind.name}`" in uses
        assert f"\n| `{kind.name}` |" in units
        assert ("--rate" in units.split(f"\n| `{kind.name}` |")[1].split("\n")[0]) == ("rate" in kind.options)
    for start, names in (
        ("- `--capsules`", formats.names("capsules")),
        ("- Several runs", formats.names(together=True)),
    ):
        line = next(line for line in options.splitlines() if line.startswith(start)).split(".")[0]
        assert re.findall(r"`(\w+)`", line) == names.split(", ")


def test_writers_take_the_options_of_their_formats() -> None:
    for kind in FORMATS:
        taken = signature(resolve_name(kind.writer)).parameters.values()
        assert {p.name for p in taken if p.kind is p.KEYWORD_ONLY} == set(kind.options), kind.name


def write_heights(path: Path, run: Run, *, rate: float = 100.0) -> None:
    path.write_text(f"{rate:g} {run.trajectory.q[0, 2]:.3f}")


def test_a_new_format_is_one_line(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    new = Format("heights", (".hts",), f"{__name__}:write_heights", ("rate",))
    monkeypatch.setattr(formats, "FORMATS", (*FORMATS, new))
    (out,) = export_run(run, None, tmp_path / "walk.hts", rate=5.0)
    assert out.read_text() == f"5 {run.trajectory.q[0, 2]:.3f}"
    files = export_run([run, run], "heights", tmp_path / "two")
    assert [path.name for path in files] == ["walk_on_average.hts", "walk_on_average_2.hts"]
    with pytest.raises(InputError, match="option source: found the format heights; expected glb, bvh"):
        export_run(run, "heights", tmp_path / "walk.hts", source=True)
    with pytest.raises(InputError, match="csv, heights"):
        export_run(run, "pdf", tmp_path / "walk.hts")


def test_help_names_the_formats(capfd: pytest.CaptureFixture[str]) -> None:
    assert call("export", "--help") == 0
    said = " ".join(re.sub(r"[^\w,().:-]+", " ", capfd.readouterr().out).split())
    assert f"what to write: {formats.names()}" in said
    for option in ("capsules", "rate", "size"):
        assert f"({formats.names(option)})" in said
