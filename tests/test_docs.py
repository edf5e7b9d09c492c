"""What the README and the documentation say can be run, and what they quote is what is said."""

from __future__ import annotations

import re
import shlex
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

import physique
from physique.character.model import Character
from physique.cli import main, parse
from physique.export.bvh import write_body_bvh
from physique.reference.reference import Reference

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@dataclass(frozen=True)
class Quote:
    """A command of a page, and the line that it is said to answer with."""

    command: str
    answer: str


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", page.read_text("utf-8"), flags=re.DOTALL)


def commands(page: Path) -> list[str]:
    lines = [line for block in blocks(page, "console") for line in block.splitlines()]
    return [line.removeprefix("$ ") for line in lines if re.match(r"(\$ )?physique ", line)]


QUOTES = [
    Quote(*found)
    for page in PAGES
    for block in blocks(page, "console")
    for found in re.findall(r"^\$ physique (.*)\n(physique: .*)$", block, flags=re.MULTILINE)
]


def python_blocks() -> list[object]:
    """Each as a case; those that retarget take minutes, a viewer needs a display and a person."""
    return [
        pytest.param(
            code, marks=[pytest.mark.slow] if "retarget(" in code else [], id=f"{page.stem}-{number}"
        )
        for page in PAGES
        for number, code in enumerate(blocks(page, "python"), start=1)
        if "mujoco.viewer" not in code
    ]


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory, character: Character, walk: Reference) -> Path:
    """A folder with what the pages take for granted: a clip and some runs."""
    folder = tmp_path_factory.mktemp("desk")
    write_body_bvh(folder / "dance.bvh", character.body.joints, walk.q, 100.0)
    physique.retarget("walk", "average", end=0.3, out=folder / "out" / "walk")
    for name in ("heavy", "thin", "punch"):
        shutil.copytree(folder / "out" / "walk", folder / "out" / name)
    physique.stabilize(folder / "out" / "punch")
    return folder


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_commands_are_commands(page: Path) -> None:
    for command in commands(page):
        parse(shlex.split(command, comments=True)[1:])


def test_there_are_commands() -> None:
    assert len(commands(PAGES[0])) >= 5
    assert sum(len(commands(page)) for page in PAGES) >= 40


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text("utf-8"))
    local = [target for target in targets if "://" not in target]
    assert [target for target in local if not (page.parent / target).exists()] == []


@pytest.mark.parametrize("code", python_blocks())
def test_the_python_runs(code: str, desk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(desk)
    exec(compile(code, "an example", "exec"), {})


@pytest.mark.parametrize("quote", QUOTES, ids=lambda quote: quote.command)
def test_the_quoted_faults_are_what_is_said(
    quote: Quote, desk: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(desk)
    before = sorted(desk.rglob("*"))
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(quote.command))
    assert stop.value.code == 2
    assert capsys.readouterr().err == quote.answer + "\n"
    assert sorted(desk.rglob("*")) == before


def test_faults_are_quoted() -> None:
    assert len(QUOTES) >= 10


def test_the_python_page_has_every_public_name_once() -> None:
    page = (ROOT / "docs" / "api.md").read_text("utf-8")
    assert sorted(re.findall(r"^::: physique\.(\w+)$", page, flags=re.MULTILINE)) == sorted(physique.__all__)


def test_the_site_has_every_page() -> None:
    settings = (ROOT / "mkdocs.yml").read_text("utf-8")
    named = re.findall(r"^ +- .+: (\S+\.md)$", settings, flags=re.MULTILINE)
    assert sorted(named) == sorted(page.name for page in PAGES[1:])


@pytest.mark.parametrize("name", ["salsa", "crowd", "torque", "backflip", "stick", "blocks", "push"])
def test_films_of_the_gallery_are_small(name: str) -> None:
    film = ROOT / "docs" / "images" / "gallery" / f"{name}.webp"
    assert film.stat().st_size <= 450_000
