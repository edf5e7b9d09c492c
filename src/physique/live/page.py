"""The page: a show on a stage with a panel, and the loop that keeps them in step."""

from __future__ import annotations

import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from threading import Event
from typing import Any

import numpy as np
from numpy.typing import NDArray

from physique.live.panel import BESIDE, HIDDEN, Panel
from physique.live.show import Show
from physique.live.stage import Stage
from physique.simulation.session import Hit

Array = NDArray[np.float64]

FRAMES_PER_SECOND = 36
PLOTS_EVERY = 0.2  # s
ARROW_SECONDS = 0.7
FOLLOW_EASE = 0.15  # the share of the camera's way that it goes in a frame
LEAST_DRAG = 0.02  # m; a shorter one has no direction


class Page:
    """Draws a show in a viser server. All tabs that are open see the same.

    Everything happens on the thread that calls `tick`; what people do arrives through `post`.
    """

    def __init__(self, server: Any, show: Show) -> None:
        self._server, self.show = server, show
        self._posted: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self.stage = Stage(server, [act.run for act in show.acts])
        self.panel = Panel(server.gui, show, self.post, self.stage.shade)
        self.stage.on_push(
            lambda *a: self.post(lambda: self._click(*a)),
            lambda *a: self.post(lambda: self._grab(*a)),
            lambda *a: self.post(lambda: self._release(*a)),
        )
        self._held: dict[int, Hit] = {}  # what is dragged, by lane
        self._arrows: dict[int, tuple[Hit, Array, float]] = {}  # by lane, with the time it goes
        self._plots_due = 0.0
        self._clock = self._arrow_clock = 0.0  # s that went by; slow motion slows the second
        self.draw(ease=1.0)

    def post(self, action: Callable[[], None]) -> None:
        """Have something done before the next frame."""
        self._posted.put(action)

    def run(self, stop: Event) -> None:
        """Draw in real time until `stop` is set."""
        last = time.perf_counter()
        while not stop.is_set():
            now = time.perf_counter()
            self.tick(now - last)
            last = now
            stop.wait(max(0.0, now + 1.0 / FRAMES_PER_SECOND - time.perf_counter()))

    def tick(self, seconds: float) -> None:
        """Do what people asked for, let this much wall time go by, and draw."""
        while True:
            try:
                action = self._posted.get_nowait()
            except Empty:
                break
            action()
        self._clock += seconds
        self._arrow_clock += seconds * self.show.timeline.speed
        self.show.advance(seconds)
        self.draw()

    def draw(self, ease: float = FOLLOW_EASE) -> None:
        """Send the frame, in one piece."""
        show, panel = self.show, self.panel
        with self._server.atomic():
            roots = []
            for i, (act, lane) in enumerate(zip(show.acts, self.stage.lanes)):
                poses, frame = show.poses(act), show.frame_of(act)
                roots.append(poses[0, :3])
                ghost = None if panel.ghost == HIDDEN else act.source[frame]
                lane.show(poses, ghost, panel.look, panel.ghost == BESIDE)
                if panel.arrows:
                    # Forces belong to the step to a frame.
                    curves, step = show.curves(act), max(frame - 1, 0)
                    lane.show_floor(curves.floor[step], curves.pressure[step])
                else:
                    lane.show_floor(None, None)
                self._draw_push(i)
            self.stage.follow(roots if panel.follow else None, ease)
            plots = self._clock >= self._plots_due
            if plots:
                self._plots_due = self._clock + PLOTS_EVERY
            panel.tell(plots)

    def _draw_push(self, index: int) -> None:
        lane = self.stage.lanes[index]
        hit, impulse, until = self._arrows.get(index, (None, None, 0.0))
        if hit is None or impulse is None or self._arrow_clock > until:
            lane.show_push(None, None)
            return
        session = self.show.acts[index].trial.session
        lane.show_push(session.world_point(hit.part, hit.point), impulse)

    def _hit(self, index: int, origin: Array, direction: Array) -> Hit | None:
        lane = self.stage.lanes[index]
        return self.show.hit(index, self.stage.to_lane(lane, origin), direction)

    def _click(self, index: int, origin: Array, direction: Array) -> None:
        hit = self._hit(index, origin, direction)
        if hit is not None:
            self._push(index, hit, direction)

    def _grab(self, index: int, origin: Array, direction: Array) -> None:
        hit = self._hit(index, origin, direction)
        if hit is not None:
            self._held[index] = hit

    def _release(self, index: int, way: Array) -> None:
        hit = self._held.pop(index, None)
        if hit is not None and np.linalg.norm(way) > LEAST_DRAG:
            self._push(index, hit, way)

    def _push(self, index: int, hit: Hit, direction: Array) -> None:
        impulse = self.panel.strength * direction / np.linalg.norm(direction)
        for i in self.show.push(index, hit, impulse, self.panel.all_alike):
            self._arrows[i] = (hit, impulse, self._arrow_clock + ARROW_SECONDS)
