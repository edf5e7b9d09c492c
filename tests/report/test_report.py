"""Reports: one file, whole, small, escaped, and nothing in it is loaded from elsewhere."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physique import cli
from physique.character.kinematics import joint_positions
from physique.commands.report import write_report
from physique.errors import InputError
from physique.report.report import MOST_FRAMES, frames_shown, json_for_script
from physique.runs.run import Run, finish_run
from renamed_runs import EVIL, renamed
from stepped_runs import BORDER, stepped

ROOT = Path(__file__).parents[2]
STATIC = ROOT / "src" / "physique" / "report" / "static"
WEB = ROOT / "tools" / "web"


class Page(HTMLParser):
    """Elements of a page with their attributes, and the text of scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.raw: list[tuple[str, str]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag in ("script", "style"):
            self.raw.append((dict(attrs).get("id") or tag, ""))

    def handle_data(self, data: str) -> None:
        if self.cdata_elem:
            name, text = self.raw[-1]
            self.raw[-1] = (name, text + data)
        else:
            self.text += data

    def data(self) -> Any:
        return json.loads(dict(self.raw)["data"])


def lengthened(run: Run, frames: int) -> Run:
    """There and back again."""
    motion = run.trajectory
    index = np.abs((np.arange(frames) + 49) % 98 - 49)
    long = dataclasses.replace(
        motion,
        times=np.arange(frames) * 0.01,
        q=motion.q[index],
        v=motion.v[index],
        reference_q=motion.reference_q[index],
        shift=motion.shift[index],
        control=motion.control[index[:-1]],
        torque=motion.torque[index[:-1]],
    )
    return dataclasses.replace(run, trajectory=long)


def page_of(path: Path, runs: list[Run]) -> Page:
    return Page(write_report(path, runs).read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def bare(run: Run) -> Run:
    """The run without its skin, for a page that is made faster."""
    return dataclasses.replace(run, mesh=None)


@pytest.fixture(scope="module")
def page(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Page:
    runs = [run, renamed(run, body="heavy")]
    return page_of(tmp_path_factory.mktemp("report") / "a.html", runs)


def test_signals_are_those_of_the_run(page: Page, run: Run) -> None:
    first, second = page.data()["runs"]
    assert (first["short"], second["short"]) == ("average", "heavy")
    motion = run.trajectory
    assert first["times"] == pytest.approx(motion.times)
    assert first["height"] == pytest.approx(motion.q[:, 2], abs=1e-3)
    assert np.mean(first["error"]) == pytest.approx(run.metrics["mpjpe_mm"], abs=0.1)
    assert max(first["error"]) == pytest.approx(run.metrics["mpjpe_max_mm"], abs=0.1)
    use = np.frombuffer(base64.b64decode(first["use"]), np.uint8).reshape(-1, 50) / 200
    wanted = np.abs(motion.torque) / run.character().torque_limit
    assert np.abs(use[:-1] - wanted).max() < 0.01
    assert (use[-1] == use[-2]).all()
    assert sorted(i for g in page.data()["names"]["groups"] for i in g["hinges"]) == [*range(50)]


def test_figures_stand_beside_each_other(page: Page) -> None:
    left, right = (np.array(run["shift"]) for run in page.data()["runs"])
    assert right[0] - left[0] > 1.0  # x points to the right of who looks at them
    assert np.abs((left + right)[1:]).max() == 0


def test_the_table_says_it_in_words(page: Page, run: Run) -> None:
    m = run.metrics
    slide, recorded = m["foot_skate_planted_mm_per_s"], m["foot_skate_source_mm_per_s"]
    assert f"{slide:.0f} mm a second; in the recording {recorded:.0f}" in page.text
    for title in ("Where it is hard, and why", "In numbers", "How it was made"):
        assert title in page.text


def test_models_are_glb_files(page: Page) -> None:
    for index in range(2):
        assert base64.b64decode(dict(page.raw)[f"model-{index}"])[:4] == b"glTF"


def test_only_the_pages_own_texts_may_run(page: Page) -> None:
    policy = next(a["content"] for t, a in page.elements if a.get("http-equiv") == "Content-Security-Policy")
    assert policy is not None
    assert policy.startswith("default-src 'none';")
    assert "unsafe" not in policy
    allowed = set(re.findall(r"'sha256-([^']+)'", policy))
    texts = [text for name, text in page.raw if name in ("script", "style")]
    assert len(texts) == 4
    digests = [hashlib.sha256(t.encode()).digest() for t in texts]
    assert {base64.b64encode(d).decode() for d in digests} == allowed
    for tag, attributes in page.elements:
        assert not [name for name in attributes if name.startswith("on") or name == "style"], tag


def test_nothing_is_loaded_from_elsewhere(page: Page) -> None:
    for _, attributes in page.elements:
        for name in ("src", "href", "data", "action", "srcset", "poster"):
            assert (attributes.get(name) or "data:").startswith("data:")
    for name, text in page.raw:
        if name in ("style", "script", "data"):
            addresses = set(re.findall(r"\b(?:https?|wss?)://[^\s\"'`)]*", text))
            addresses |= set(re.findall(r"[\"'`]//[^\s\"'`)]*", text))
            assert addresses <= {"http://www.w3.org/1999/xhtml"}, name  # a name, not an address
            assert "url(" not in text or name == "script"


def test_names_from_files_stay_text(bare: Run, tmp_path: Path) -> None:
    evil = renamed(bare, clip=EVIL, body=EVIL)
    harmless = page_of(tmp_path / "a.html", [renamed(bare)])
    page = page_of(tmp_path / "b.html", [evil])
    assert [t for t, _ in page.elements] == [t for t, _ in harmless.elements]
    assert page.data()["runs"][0]["short"] == EVIL
    assert EVIL in page.text


@settings(max_examples=40)
@given(st.recursive(st.text(), lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner)))
def test_json_in_a_script_is_harmless_and_whole(value: Any) -> None:
    text = json_for_script(value)
    assert not set("<>&") & set(text)
    assert json.loads(text) == value


def test_folders_of_machines_are_not_told(bare: Run, tmp_path: Path) -> None:
    for path in ("/home/anna/secret/dance.bvh", r"C:\Users\anna\secret\dance.bvh"):
        record = {**bare.record, "clip_source": path}
        page = page_of(tmp_path / "a.html", [dataclasses.replace(bare, record=record)])
        assert "dance.bvh" in page.text
        assert "anna" not in page.text


@pytest.mark.slow
def test_a_minute_stays_under_three_megabytes(run: Run, tmp_path: Path) -> None:
    path = write_report(tmp_path / "a.html", [lengthened(run, 6001)])
    assert path.stat().st_size <= 3_000_000
    assert Page(path.read_text(encoding="utf-8")).data()["runs"][0]["times"][-1] == 60.0


@given(st.integers(2, 100_000))
def test_few_frames_are_shown_and_the_last(frames: int) -> None:
    kept = frames_shown(frames)
    assert len(kept) <= MOST_FRAMES + 1
    assert (kept[0], kept[-1]) == (0, frames - 1)
    assert (np.diff(kept) > 0).all()


def test_a_body_without_skin_is_shown_by_its_shapes(run: Run, tmp_path: Path) -> None:
    page = page_of(tmp_path / "a.html", [dataclasses.replace(run, mesh=None)])
    model = base64.b64decode(dict(page.raw)["model-0"])
    assert b'"skins"' not in model
    assert b"capsule pelvis" in model


def test_runs_without_motion_and_no_runs_are_refused(run: Run, tmp_path: Path) -> None:
    short = lengthened(run, 1)
    with pytest.raises(InputError, match="without motion"):
        write_report(tmp_path / "a.html", [short])
    with pytest.raises(InputError, match="no run"):
        write_report(tmp_path / "a.html", [])
    with pytest.raises(InputError, match=r"ends in \.html"):
        write_report(tmp_path / "a.pdf", [run])
    assert list(tmp_path.iterdir()) == []


def test_a_lost_motion_is_told(bare: Run, tmp_path: Path) -> None:
    windows = [dict(w) for w in bare.metrics["windows"]]
    windows[1]["success"] = False
    metrics = {**bare.metrics, "success": False, "windows": windows}
    page = page_of(tmp_path / "a.html", [dataclasses.replace(bare, metrics=metrics)])
    assert "Lost the motion after 0.30 s" in page.text
    assert "no, lost at 0.30 s" in page.text
    assert [w["level"] for w in page.data()["runs"][0]["windows"]] == ["easy", "lost"]


def test_command(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    finish_run(folder, run)
    out = tmp_path / "report.html"
    cli.main(["report", str(folder), str(folder), "--out", str(out)])
    assert capsys.readouterr().out == f"{out}\n"
    assert len(Page(out.read_text(encoding="utf-8")).data()["runs"]) == 2
    with pytest.raises(SystemExit) as stop:
        cli.main(["report", str(tmp_path), "--out", str(tmp_path / "no.html")])
    assert stop.value.code == 2
    assert not (tmp_path / "no.html").exists()


def test_the_bundle_is_made_from_its_source() -> None:
    """`make bundle` after each change of tools/web."""
    head = (STATIC / "stage.min.js").read_text(encoding="utf-8").splitlines()[0]
    digest = hashlib.sha256((WEB / "stage.js").read_bytes()).hexdigest()
    three = json.loads((WEB / "package.json").read_text())["devDependencies"]["three"]
    assert head == f"/* tools/web/stage.js {digest}, with three.js {three} (MIT) */"
    assert three in (ROOT / "NOTICE").read_text(encoding="utf-8")


def test_errors_are_against_the_source_as_it_was_moved(run: Run, tmp_path: Path) -> None:
    """What is shown of it stays in place: tests/export/test_source.py."""
    moved = stepped(dataclasses.replace(run, mesh=None))
    still, shifted = (page_of(tmp_path / "a.html", [r]).data()["runs"][0] for r in (run, moved))
    same = slice(0, BORDER + 1)
    assert still["error"][same] == shifted["error"][same]
    motion, character = moved.trajectory, run.character()
    wanted, found = (joint_positions(character, q) for q in (motion.reference_q, motion.q))
    errors = 1e3 * np.linalg.norm(found - wanted, axis=-1).mean(axis=1)
    assert shifted["error"] == pytest.approx(errors, abs=0.06)
    assert shifted["error"] != still["error"]
