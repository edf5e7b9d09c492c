"""The controls and plots beside the scene."""

from __future__ import annotations

import html
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from physique.character.hinges import HINGES
from physique.live.plots import Plot
from physique.live.show import Show
from physique.live.stage import Look
from physique.render import palette

SPEEDS = {"1/10": 0.1, "1/4": 0.25, "1/2": 0.5, "1": 1.0, "2": 2.0}
RECORDED, LIVE = "the recording", "a live simulation"
IN_PLACE, BESIDE, HIDDEN = "in its own place", "beside it", "hidden"
MOST_LOADED = "the most loaded joint"
HANDS_OFF = 0.5  # s
STRENGTH, STRONGEST = 20.0, 200.0  # Ns


class Panel:
    """What people set, and what they are told.

    Everything that changes the show is handed to `post`, which runs it on the page's own thread;
    `shade` switches shadows.
    """

    def __init__(
        self, gui: Any, show: Show, post: Callable[[Callable[[], None]], None], shade: Callable[[bool], None]
    ) -> None:
        self._show, self._post = show, post
        self._names = [act.run.name for act in show.acts]
        gui.configure_theme(control_width="medium", show_logo=False, show_share_button=False)
        gui.set_panel_label("physique")
        gui.main_panel.dock_right()
        self._said, self._told_mode, self._hands_off = "", RECORDED, 0.0
        self._status = gui.add_html("")
        self._playback(gui)
        self._pushes(gui)
        self._looks(gui, shade)
        with gui.add_folder("Plots"):
            self._plots(gui)

    @property
    def strength(self) -> float:
        """Ns of the next push."""
        return float(self._strength.value)

    @property
    def all_alike(self) -> bool:
        """Whether a push goes to every body."""
        return bool(self._alike.value)

    @property
    def follow(self) -> bool:
        """Whether the camera follows."""
        return bool(self._follow.value)

    @property
    def look(self) -> Look:
        """How bodies look."""
        return "skin" if self._look.value == "skin" else "capsules"

    @property
    def ghost(self) -> str:
        """IN_PLACE, BESIDE or HIDDEN."""
        return str(self._ghost.value)

    @property
    def arrows(self) -> bool:
        """Whether the floor's forces are shown."""
        return bool(self._arrows.value)

    def _playback(self, gui: Any) -> None:
        show, post = self._show, self._post
        with gui.add_folder("Playback"):
            self._mode = gui.add_dropdown("Show", (RECORDED, LIVE))
            self._play = gui.add_button("Pause")
            self._restart = gui.add_button("Restart")
            self._time = gui.add_slider(
                "Time, s", 0.0, max(show.timeline.duration, show.timestep), show.timestep, 0.0
            )
            self._speed = gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1")
            self._follow = gui.add_checkbox("Camera follows", True)
        self._mode.on_update(lambda e: post(partial(show.go_live, e.target.value == LIVE)))
        self._play.on_click(lambda _: post(self._toggle))
        self._restart.on_click(lambda _: post(lambda: show.seek(0.0)))
        self._time.on_update(self._scrub)
        self._speed.on_update(lambda _: post(self._set_speed))

    def _pushes(self, gui: Any) -> None:
        show, post = self._show, self._post
        with gui.add_folder("Pushes"):
            gui.add_markdown(
                "Click on a body to push it along the line of sight, or drag on it to choose the "
                "direction. A push lasts 0.1 s."
            )
            self._strength = gui.add_slider("Strength, Ns", 1.0, STRONGEST, 1.0, STRENGTH)
            self._controllers = [
                gui.add_dropdown(
                    "Controller" if len(show.acts) == 1 else f"Controller {i + 1}",
                    tuple(act.controllers),
                    initial_value=show.chosen[i],
                )
                for i, act in enumerate(show.acts)
            ]
            self._alike = gui.add_checkbox("Push all bodies alike", False, visible=len(show.acts) > 1)
            self._again = gui.add_checkbox("Begin anew at the end", True)
            forget = gui.add_button("Set counters to zero")
        for i, choice in enumerate(self._controllers):
            choice.on_update(lambda e, i=i: post(partial(show.choose, i, e.target.value)))
        self._again.on_update(lambda e: post(lambda: setattr(show, "restarts", e.target.value)))
        forget.on_click(lambda _: post(show.forget))

    def _looks(self, gui: Any, shade: Callable[[bool], None]) -> None:
        skinned = any(act.run.mesh is not None for act in self._show.acts)
        with gui.add_folder("Look"):
            self._look = gui.add_dropdown("Body", ("skin", "capsules") if skinned else ("capsules",))
            self._ghost = gui.add_dropdown("Source motion", (IN_PLACE, BESIDE, HIDDEN))
            self._arrows = gui.add_checkbox("Floor forces", False)
            # Drawn without a GPU they cost more than all the rest.
            shadows = gui.add_checkbox("Shadows", True)
        shadows.on_update(lambda e: shade(e.target.value))

    def _plots(self, gui: Any) -> None:
        show = self._show
        count = round(show.timeline.duration / show.timestep) + 1
        times = np.asarray(show.timestep * np.arange(count), dtype=np.float64)
        colours = [palette.body(i) for i in range(len(show.acts))]
        self._length = len(times)
        self._errors = Plot(gui, "joint error, mm", times, self._names, colours, 50.0)
        self._hard = Plot(gui, "difficulty: cost per second of each window", times, self._names, colours, 1.0)
        self._body = gui.add_dropdown("Forces of", tuple(self._labels()), visible=len(show.acts) > 1)
        self._joint = gui.add_dropdown("Torque of", (MOST_LOADED, *(h.name for h in HINGES)))
        self._torques = Plot(
            gui, "torque, share of its limit", times, ("torque", "limit"), ("#7b3fa0", "#bbbbbb"), 1.1
        )
        self._floors = Plot(
            gui,
            "floor force, body weights: left blue, right red",
            times,
            ("left", "right"),
            ("#3a7cc2", "#d0524a"),
            1.5,
        )

    def _labels(self) -> list[str]:
        return [f"{i + 1}: {name}" for i, name in enumerate(self._names)]

    def _toggle(self) -> None:
        timeline = self._show.timeline
        if timeline.playing:
            timeline.playing = False
        elif timeline.time >= timeline.duration:
            self._show.seek(0.0)
            timeline.play()
        else:
            timeline.play()

    async def _scrub(self, event: Any) -> None:
        # What the page itself sets comes back without a client.
        if event.client is None:
            return
        self._hands_off = time.monotonic() + HANDS_OFF
        at = float(event.target.value)

        def seek() -> None:
            self._show.timeline.playing = False
            self._show.seek(at)

        self._post(seek)

    def _set_speed(self) -> None:
        self._show.timeline.speed = SPEEDS[self._speed.value]

    def tell(self, plots: bool) -> None:
        """Bring all that is told up to date; the plots only if asked to: they are large."""
        show = self._show
        mode = LIVE if show.live else RECORDED
        # Only when it changes: what people just chose may not have been done yet.
        if mode != self._told_mode:
            self._told_mode = self._mode.value = mode
        label = "Pause" if show.timeline.playing else "Play"
        if self._play.label != label:
            self._play.label = label
        at = round(show.timeline.time, 2)
        # Who drags the slider must not be pulled back to where it was a moment ago.
        if self._time.value != at and time.monotonic() > self._hands_off:
            self._time.value = at
        said = _box(self._status_html() + self._score_html())
        if said != self._said:
            self._said = self._status.content = said
        if plots:
            self._tell_plots()

    def _status_html(self) -> str:
        show = self._show
        lines = []
        for i, act in enumerate(show.acts):
            frame = show.frame_of(act)
            error = act.trial.error if show.live else act.recorded.error[frame]
            state = f"{1e3 * error:.0f} mm off"
            if show.live and act.trial.fallen:
                state = "has fallen"
            elif show.live and act.trial.finished:
                state = "at the end"
            dot = f'<span style="color:{palette.body(i)}">&#9679;</span>'
            lines.append(f"{dot} {i + 1}: {html.escape(self._names[i])}, {state}")
        what = "simulated now" if show.live else "as recorded"
        lines.append(f"{show.timeline.time:.2f} of {show.timeline.duration:.2f} s, {what}")
        return "<br>".join(lines)

    def _score_html(self) -> str:
        cells = "<th align=left>{}</th>" + "<th align=right>{}</th>" * 3
        head = cells.format("controller", "pushes", "survived", "failed")
        rows = [
            "<tr>"
            + f"<td>{f'{i + 1}: ' if len(self._names) > 1 else ''}{html.escape(name)}</td>"
            + "".join(f"<td align=right>{n}</td>" for n in (s.pushes, s.survived, s.failed))
            + "</tr>"
            for i, name, s in self._show.score_rows()
        ]
        table = f'<table width="100%"><tr>{head}</tr>{"".join(rows)}</table>'
        unjudged = sum(score.not_judged for *_, score in self._show.score_rows())
        if unjudged:
            table += f"{unjudged} not judged: cut short, or too near the clip's end"
        return table

    def _tell_plots(self) -> None:
        show = self._show
        frame = show.frame
        curves = [show.curves(act) for act in show.acts]
        self._errors.show([1e3 * self._fill(c.error) for c in curves], frame)
        self._hard.show([self._fill(act.difficulty) for act in show.acts], frame)
        index = self._labels().index(self._body.value)
        run, chosen = show.acts[index].run, curves[index]
        limit = show.acts[index].trial.session.character.torque_limit
        share = np.abs(chosen.torque) / limit
        if self._joint.value == MOST_LOADED:
            share = share.max(axis=1)
        else:
            share = share[:, [h.name for h in HINGES].index(self._joint.value)]
        self._torques.show([self._fill(share), np.ones(self._length)], frame)
        weights = chosen.floor[:, :, 2] / (9.81 * run.body.mass)
        self._floors.show([self._fill(weights[:, side]) for side in (0, 1)], frame)

    def _fill(self, curve: np.ndarray) -> np.ndarray:
        """A curve (T,) as long as the longest run's."""
        out = np.full(self._length, np.nan)
        out[: len(curve)] = curve
        return out


def _box(content: str) -> str:
    return f'<div style="padding:0 1em;font-size:0.85em;line-height:1.5">{content}</div>'
