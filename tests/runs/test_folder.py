"""A run in the making: checkpoints, what is replaced and what is not, one process at a time."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from physique.errors import InputError
from physique.runs.folder import Checkpoint, change_run, open_run
from physique.runs.run import Run, finish_run, load_run, protect_runs, read_record
from physique.store import write_json
from physique.tracking.windows import Window

RECORD: dict[str, Any] = {"identity": {"clip": "walk", "seed": 0, "start": None}, "threads": 1}


def windows(count: int) -> list[Window]:
    random = np.random.default_rng(3)
    found: list[Window] = []
    for i in range(count):
        q, v = random.normal(size=(6, 57)), random.normal(size=(6, 56))
        if found:
            q[0] = found[-1].q[-1]
        found.append(
            Window(
                start=5 * i,
                stop=5 * i + 5,
                q=q,
                v=v,
                control=random.normal(size=(5, 50)),
                torque=random.normal(size=(5, 50)),
                shift=random.normal(size=2),
                tail_q=random.normal(size=(3, 57)),
                tail_v=random.normal(size=(3, 56)),
                tail_control=random.normal(size=(3, 50)),
                terms={"com": random.normal(), "root": 0.1},
                cost=random.normal(),
                iterations=4,
                sim_steps=123,
                status="converged",
            )
        )
    return found


def stored(folder: Path, count: int = 3) -> list[Window]:
    made = windows(count)
    with open_run(folder, RECORD, resume=False, overwrite=False) as run:
        for i, window in enumerate(made):
            run.save(i, Checkpoint(window, 1.5))
    return made


def resume(folder: Path, record: dict[str, Any] = RECORD) -> list[Window]:
    with open_run(folder, record, resume=True, overwrite=False) as run:
        return [c.window for c in run.checkpoints]


def start(folder: Path, *, overwrite: bool = False) -> None:
    with open_run(folder, RECORD, resume=False, overwrite=overwrite) as run:
        assert run.checkpoints == ()


def same(a: Window, b: Window) -> bool:
    return all(
        np.array_equal(x, y) and type(x) is type(y)
        for x, y in zip(vars(a).values(), vars(b).values(), strict=True)
    )


def test_windows_come_back_bit_for_bit(tmp_path: Path) -> None:
    made = stored(tmp_path)
    found = resume(tmp_path)
    assert len(found) == 3
    assert all(same(a, b) for a, b in zip(made, found, strict=True))


@pytest.mark.parametrize("damage", ["cut", "flip", "empty", "foreign"])
def test_a_damaged_checkpoint_is_named_and_what_follows_is_made_anew(
    tmp_path: Path, damage: str, caplog: pytest.LogCaptureFixture
) -> None:
    made = stored(tmp_path)
    path = tmp_path / "windows" / "0001.npz"
    data = path.read_bytes()
    middle = len(data) // 2
    path.write_bytes(
        {
            "cut": data[:middle],
            "flip": data[:middle] + bytes([data[middle] ^ 255]) + data[middle + 1 :],
            "empty": b"",
            "foreign": (tmp_path / "windows" / "0002.npz").read_bytes(),
        }[damage]
    )
    with caplog.at_level(logging.WARNING):
        found = resume(tmp_path)
    assert len(found) == 1
    assert same(found[0], made[0])
    assert "0001.npz" in caplog.text
    assert "window 1" in caplog.text
    assert [p.name for p in (tmp_path / "windows").iterdir()] == ["0000.npz"]


def test_a_gap_ends_what_is_used(tmp_path: Path) -> None:
    stored(tmp_path)
    (tmp_path / "windows" / "0000.npz").unlink()
    assert resume(tmp_path) == []
    assert list((tmp_path / "windows").iterdir()) == []


def test_files_that_a_kill_left_half_written_do_no_harm(tmp_path: Path) -> None:
    stored(tmp_path)
    (tmp_path / "windows" / ".0003.npz.ab12.part").write_bytes(b"half")
    assert len(resume(tmp_path)) == 3
    assert not (tmp_path / "windows" / ".0003.npz.ab12.part").exists()


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"seed": 1}, "a run with seed 0; expected 1, as asked for now"),
        ({"clip": "run"}, "a run with clip walk; expected run"),
        ({"start": 0.5}, "a run with start None; expected 0.5"),
        ({"extra": True}, "a run with extra None; expected True"),
        ({"versions": {"numba": "0.1"}}, "a run with versions numba None; expected 0.1"),
    ],
)
def test_another_run_is_refused_by_its_difference(tmp_path: Path, change: dict[str, Any], text: str) -> None:
    stored(tmp_path)
    with pytest.raises(InputError, match=text):
        resume(tmp_path, {**RECORD, "identity": {**RECORD["identity"], **change}})
    assert len(resume(tmp_path, {**RECORD, "threads": 8})) == 3


def test_overwrite_removes_the_run_and_only_the_run(tmp_path: Path) -> None:
    stored(tmp_path)
    (tmp_path / "notes.txt").write_text("mine")
    start(tmp_path, overwrite=True)
    assert list((tmp_path / "windows").iterdir()) == []
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_a_folder_with_other_files_is_used_and_they_stay(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    start(tmp_path)
    assert {p.name for p in tmp_path.iterdir()} - {".lock"} == {"notes.txt", "run.json", "windows"}


def test_files_of_a_run_without_a_record_are_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "motion.bvh").write_text("mine")
    for ask in (start, resume):
        with pytest.raises(InputError, match="files of a run"):
            ask(tmp_path)
    assert (tmp_path / "motion.bvh").read_text() == "mine"


def test_both_resume_and_overwrite_is_refused_and_nothing_goes(tmp_path: Path) -> None:
    stored(tmp_path)
    with (
        pytest.raises(InputError, match="--resume and --overwrite"),
        open_run(tmp_path, RECORD, resume=True, overwrite=True),
    ):
        pass
    assert len(resume(tmp_path)) == 3


def test_what_is_overwritten_is_named_with_its_price(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    stored(tmp_path)
    write_json(tmp_path / "tree.json", {"perturbed_states": 12, "seconds": 3600.0})
    (tmp_path / "policy.npz").write_bytes(b"")
    with caplog.at_level(logging.WARNING):
        start(tmp_path, overwrite=True)
    assert "replaces run.json, windows, policy.npz, tree.json (12 states, 3600 s of growth)" in caplog.text
    assert not (tmp_path / "tree.json").exists()


def test_two_at_once_are_refused_and_readers_are_not(run: Run, tmp_path: Path) -> None:
    finish_run(tmp_path, run)
    with change_run(tmp_path) as held:
        assert held.folder == tmp_path
        load_run(tmp_path)
        with pytest.raises(InputError, match="another process"), change_run(tmp_path):
            pass
        with pytest.raises(InputError, match="another process"):
            start(tmp_path, overwrite=True)
    assert load_run(tmp_path).success == run.success


def test_a_damaged_record_is_named(tmp_path: Path) -> None:
    stored(tmp_path)
    (tmp_path / "run.json").write_text('{"format": ')
    with pytest.raises(InputError, match=r"run\.json"):
        resume(tmp_path)


def test_a_file_in_the_place_of_the_folder_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("mine")
    with pytest.raises(InputError, match="a folder that can be written"):
        start(path)
    assert path.read_text() == "mine"


def test_a_run_can_be_resumed_whenever_its_start_was_cut_off(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed after each of the changes that replacing a run makes to its folder."""
    for cut in range(12):
        folder = tmp_path / str(cut)
        folder.mkdir()
        finish_run(folder, run)
        (folder / "policy.npz").write_bytes(b"of the old motion")
        left = cut
        with monkeypatch.context() as patch:
            for name in ("unlink", "replace", "mkdir"):
                plain = getattr(Path, name)

                def change(path: Path, *rest: Any, plain: Any = plain, **more: Any) -> Any:
                    nonlocal left
                    if not path.name.startswith((".lock", ".run")) or plain.__name__ == "replace":
                        left -= 1
                    if left < 0:
                        raise KeyboardInterrupt
                    return plain(path, *rest, **more)

                patch.setattr(Path, name, change)
            try:
                start(folder, overwrite=True)
            except KeyboardInterrupt:
                pass
            else:
                assert cut >= 6
                break
        identity = read_record(folder)["identity"]
        if identity == RECORD["identity"]:
            assert resume(folder) == []
            assert sorted(p.name for p in folder.iterdir() if p.name[0] != ".") == ["run.json", "windows"]
        else:
            load_run(folder)  # the old run still, and whole


def test_files_of_a_run_are_no_place_for_others(tmp_path: Path, run: Run) -> None:
    finish_run(tmp_path, run)
    for name in ("trajectory.npz", "policy.npz", "run.json"):
        with pytest.raises(InputError, match="a file of the run in this folder"):
            protect_runs(tmp_path / name)
    protect_runs(tmp_path / "film.mp4")
    protect_runs(tmp_path.parent / "trajectory.npz")
