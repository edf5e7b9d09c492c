"""A report: one HTML page that shows runs, works without a network and can be mailed."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Sequence
from importlib.metadata import version
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physique.errors import InputError
from physique.export.bvh import R_FILE_FROM_WORLD
from physique.export.gltf import glb_bytes
from physique.render.layout import labels, side_by_side, strength
from physique.render.palette import body as colour
from physique.report.difficulty import LEVELS
from physique.report.signals import names, signals
from physique.report.words import Row, lost_at, rows, settings, verdict
from physique.runs.run import Run

#: Steps of a run that a report shows; longer runs are shown at every second frame, every third...
MOST_FRAMES = 1500


def report_html(runs: Sequence[Run]) -> str:
    """The text of the page. Raises InputError for no runs, or one that ended before its first step."""
    if not runs:
        raise InputError("report", "no run", "one or more runs", "name the folder of a run")
    for run in runs:
        if run.trajectory.frames < 2:
            raise InputError(run.name, "a run without motion", "two frames at least", "make the run anew")
    short = labels(runs)
    shifts = side_by_side(runs) @ R_FILE_FROM_WORLD.T
    entries, models = [], []
    for index, run in enumerate(runs):
        kept = frames_shown(run.trajectory.frames)
        entries.append(
            {
                "short": short[index],
                "colour": colour(index),
                "shift": np.round(shifts[index], 4).tolist(),
                **signals(run, kept),
            }
        )
        model = glb_bytes(
            [run],
            source=True,
            surface="capsules" if run.mesh is None else "both",
            keep_every=_stride(run.trajectory.frames),
            compact=True,
        )
        text = base64.b64encode(model).decode()
        models.append(f'<script type="application/octet-stream" id="model-{index}">{text}</script>')
    scripts = {name: _static(f"{name}.js") for name in ("stage.min", "plots", "report")}
    style = _static("report.css")
    data = {"runs": entries, "names": names()}
    return _fill(
        _static("report.html"),
        {
            "policy": _policy([style], list(scripts.values())),
            "generator": html.escape(f"physique {version('physique')}"),
            "title": html.escape(_title(runs)),
            "lede": html.escape(_lede(runs)),
            "style": style,
            "verdicts": "".join(_verdict(i, *one) for i, one in enumerate(zip(runs, short))),
            "levels": _levels(),
            "table": _table(runs, short),
            "windows": "".join(_windows(e["short"], e["windows"]) for e in entries),
            "settings": _settings(runs, short),
            "footer": html.escape(
                f"Made by physique {version('physique')} in MuJoCo. "
                "Nothing in this file is loaded from anywhere else."
            ),
            "data": json_for_script(data),
            "models": "\n".join(models),
            "stage": scripts["stage.min"],
            "plots": scripts["plots"],
            "report": scripts["report"],
        },
    )


def frames_shown(frames: int) -> NDArray[np.intp]:
    """The frames, of so many, that a report shows: at most `MOST_FRAMES` and one."""
    return np.unique(np.append(np.arange(0, frames, _stride(frames)), frames - 1))


def json_for_script(value: Any) -> str:
    """JSON that may stand inside a script element, whatever strings it holds."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _stride(frames: int) -> int:
    return max(1, -(-(frames - 1) // MOST_FRAMES))


def _static(name: str) -> str:
    return (files("physique.report") / "static" / name).read_text(encoding="utf-8")


def _fill(template: str, parts: dict[str, str]) -> str:
    """Put parts in their places, in one pass: what a part holds is never looked into."""
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], template)


def _policy(styles: Sequence[str], scripts: Sequence[str]) -> str:
    """Only these very texts may run or style the page, and nothing may be loaded."""

    def sources(texts: Sequence[str]) -> str:
        digests = (hashlib.sha256(text.encode()).digest() for text in texts)
        return " ".join(f"'sha256-{base64.b64encode(d).decode()}'" for d in digests)

    return (
        f"default-src 'none'; script-src {sources(scripts)}; style-src {sources(styles)}; "
        "img-src data:; base-uri 'none'; form-action 'none'"
    )


def _clips(runs: Sequence[Run]) -> list[str]:
    return list(dict.fromkeys(str(run.record["identity"]["clip"]) for run in runs))


def _listed(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def _title(runs: Sequence[Run]) -> str:
    bodies = list(dict.fromkeys(run.body.name for run in runs))
    return f"{_listed(_clips(runs))} on {_listed(bodies)}"


def _lede(runs: Sequence[Run]) -> str:
    who = "a real body" if len(runs) == 1 else "real bodies"
    return (
        f"A recorded motion performed by {who} under physics. Pale: the recording. "
        "Red dots: joints at their full strength."
    )


def _person(run: Run) -> str:
    holding = f", {run.holding}" if run.holding else ""
    return f"{run.body.height:.2f} m, {run.body.mass:.0f} kg, {strength(run)}{holding}"


def _mark(index: int) -> str:
    """A dot in a run's colour: an image, for the policy forbids style attributes."""
    return (
        '<svg class="mark" width="11" height="11" viewBox="0 0 11 11" aria-hidden="true">'
        f'<circle cx="5.5" cy="5.5" r="5.5" fill="{colour(index)}"/></svg>'
    )


def _heads(short: Sequence[str]) -> str:
    names = "".join(f"<th>{_mark(i)}{html.escape(name)}</th>" for i, name in enumerate(short))
    return f"<thead><tr><th></th>{names}</tr></thead>"


def _verdict(index: int, run: Run, name: str) -> str:
    mark = ' class="failed"' if lost_at(run.metrics) is not None else ""
    return (
        f"<div><h3>{_mark(index)}{html.escape(name)}</h3>"
        f'<p class="person">{html.escape(_person(run))}</p>'
        f"<p{mark}>{html.escape(verdict(run))}</p></div>"
    )


def _levels() -> str:
    words = [*(name for name, _ in LEVELS), "lost"]
    return "".join(
        f'<li><span class="dot level-{word.replace(" ", "-")}"></span>{word}</li>' for word in words
    )


def _table(runs: Sequence[Run], short: Sequence[str]) -> str:
    columns: list[list[Row]] = [rows(run) for run in runs]
    body = []
    for line in zip(*columns):
        values = "".join(f"<td>{html.escape(row.value)}</td>" for row in line)
        label = html.escape(line[0].label)
        meaning = html.escape(line[0].meaning)
        body.append(f'<tr><th>{label}<span class="meaning">{meaning}</span></th>{values}</tr>')
    return f"<table>{_heads(short)}<tbody>{''.join(body)}</tbody></table>"


def _windows(name: str, windows: Sequence[dict[str, Any]]) -> str:
    items = []
    for part in windows:
        causes = "; ".join(
            f'<span class="word">{html.escape(word)}</span>: {html.escape(text)}'
            for word, text in part["causes"]
        )
        when = f"{part['start']:.2f} to {part['end']:.2f} s: {html.escape(part['level'])}"
        items.append(f"<li>{when}{'. ' + causes if causes else ''}</li>")
    return f'<h3>{html.escape(name)}</h3><ol class="windows">{"".join(items)}</ol>'


def _settings(runs: Sequence[Run], short: Sequence[str]) -> str:
    made = [dict(settings(run)) for run in runs]
    titles = list(dict.fromkeys(title for one in made for title in one))
    body = "".join(
        f"<tr><th>{html.escape(title)}</th>"
        + "".join(f"<td>{html.escape(one.get(title, ''))}</td>" for one in made)
        + "</tr>"
        for title in titles
    )
    return f"<table>{_heads(short)}<tbody>{body}</tbody></table>"
