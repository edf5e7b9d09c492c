"""What the README says can be run."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from physique.cli import parse

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_the_commands_are_commands() -> None:
    lines = [line for block in blocks("console") for line in block.splitlines()]
    commands = [line for line in lines if line.startswith("physique ")]
    assert len(commands) >= 5
    for command in commands:
        parse(shlex.split(command, comments=True)[1:])


def test_the_links_lead_somewhere() -> None:
    targets = re.findall(r"\]\(([^)#]+)\)", README)
    local = [target for target in targets if "://" not in target]
    assert local
    assert [target for target in local if not (ROOT / target).exists()] == []


@pytest.mark.parametrize(
    "code",
    [
        pytest.param(code, marks=[pytest.mark.slow] if "retarget(" in code else [])
        for code in blocks("python")
    ],
    ids=lambda code: code.splitlines()[2],
)
def test_the_python_runs(code: str) -> None:
    exec(compile(code, "README.md", "exec"), {})
