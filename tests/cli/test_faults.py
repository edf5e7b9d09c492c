"""What was not foreseen: faults of physique's own, and readers that go away."""

from __future__ import annotations

import functools
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from command_line import call
from physique.cli.make import ClipsCommand
from physique.cli.progress import _bar


@pytest.fixture
def broken(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """`physique clips` meets a fault that no message was written for; the folder of its report."""

    def fail(self: ClipsCommand) -> None:
        raise IndexError("list index\nout of range")

    monkeypatch.setattr(ClipsCommand, "run", fail)
    named = functools.partial(tempfile.NamedTemporaryFile, dir=tmp_path)
    monkeypatch.setattr(tempfile, "NamedTemporaryFile", named)
    return tmp_path


def test_an_unforeseen_fault_is_one_line_and_a_file(broken: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert call("clips") == 70
    printed = capfd.readouterr()
    assert printed.out == ""
    line = re.fullmatch(
        r"physique: a fault of physique's own: IndexError: list index out of range; please report it, "
        r"with the file (\S+)\n",
        printed.err,
    )
    assert line is not None
    (report,) = broken.iterdir()
    assert report == Path(line[1])
    text = report.read_text("utf-8")
    assert text.startswith("physique ")
    assert "MuJoCo 4" in text
    assert "\nphysique clips\n" in text
    assert 'raise IndexError("list index' in text


def test_where_no_file_can_be_written_the_traceback_is_printed(
    broken: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError("read-only")

    monkeypatch.setattr(tempfile, "NamedTemporaryFile", refuse)
    assert call("clips") == 70
    assert "raise IndexError" in capfd.readouterr().err


def test_a_torn_mujoco_is_bad_input(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def fail(self: ClipsCommand) -> None:
        raise ImportError("its core bindings ('mujoco-core') are missing or corrupted")

    monkeypatch.setattr(ClipsCommand, "run", fail)
    assert call("clips") == 2
    printed = capfd.readouterr()
    assert printed.err.count("\n") == 1
    assert "pip uninstall -y mujoco" in printed.err


def run(*arguments: str, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], text=True, check=False, **options)


def test_the_help_comes_without_the_heavy_packages() -> None:
    code = (
        "import sys\nfrom physique.cli import main\n"
        "try: main(['retarget', '--help'])\n"
        "except SystemExit as stop: assert not stop.code\n"
        "print(sorted({'mujoco', 'scipy', 'numba', 'numpy', 'cma'} & set(sys.modules)))"
    )
    done = run("-c", code, capture_output=True)
    assert "--torque-limit" in done.stdout
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.skipif(os.name != "posix", reason="closes pipes as POSIX systems do")
@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_reader_that_goes_away_does_not_end_the_work(stream: str, tmp_path: Path) -> None:
    # Work that shows something before it is done, to a pipe that nobody reads.
    code = (
        "import logging, sys, pathlib\n"
        "from physique.cli import console\nfrom physique.cli.progress import _bar\n"
        "console.set_up_logging()\n"
        "with _bar('work') as show:\n"
        "    show('work', 'begun', 0, 1)\n"
        "    logging.warning('odd')\n    console.say('a line')\n    console.table(['a'], [['b']])\n"
        "    show('work', 'done', 1, 1)\n"
        "    pathlib.Path(sys.argv[1]).write_text('done')\n"
        "console.show_files(['x'])"
    )
    end, other = os.pipe()
    os.close(end)
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, stream: other}
    done = run("-c", code, str(tmp_path / "result"), **streams)
    os.close(other)
    assert done.returncode == 0
    assert not done.stderr or "Error" not in done.stderr
    assert (tmp_path / "result").read_text() == "done"


def test_progress_is_a_line_for_each_tenth(capfd: pytest.CaptureFixture[str]) -> None:
    with _bar("work") as show:
        for step in range(41):
            show("work", f"{step} of 40", step, 40)
    lines = capfd.readouterr().err.splitlines()
    assert lines == [f"work: {step} of 40" for step in range(0, 41, 4)]
