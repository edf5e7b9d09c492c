"""The live page in a real browser. Pictures stay in out/tests."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from physique import skeleton
from physique.live.controllers import Replay
from physique.live.page import Page
from physique.live.panel import HIDDEN
from physique.live.serve import serving
from physique.live.show import Show
from physique.runs.run import Run
from standing import Balance

Array = NDArray[np.float64]
PATIENCE = 90.0  # s; software drawing on a busy machine takes a second a frame
SIZE = {"width": 600, "height": 400}
SCENE = "canvas[data-engine]"  # the others are plots


@pytest.fixture
def served(standing: Run, balance: Balance) -> Iterator[tuple[Any, Page]]:
    """A page of one standing body, which a regulator balances, on a thread of its own."""
    show = Show([standing], [{"replay": Replay(standing.trajectory), "balance": balance}])
    with serving("127.0.0.1", 0) as server:
        page, stop = Page(server, show), threading.Event()
        # Shadows and the ghost take most of the time of drawing in software.
        page.stage.shade(False)
        page.panel._ghost.value = HIDDEN
        thread = threading.Thread(target=page.run, args=(stop,))
        thread.start()
        yield server, page
        stop.set()
        thread.join()


def until(condition: Callable[[], Any], what: str) -> Any:
    """Wait for something, or fail and say what."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        found = condition()
        if found:
            return found
        time.sleep(0.05)
    pytest.fail(f"waited {PATIENCE:.0f} s for {what}")


def on_screen(server: Any, tab: Any, point: Array) -> tuple[float, float]:
    """Where in the tab a point (3,) of the world is seen."""
    camera = next(iter(server.get_clients().values())).camera
    forward = camera.look_at - camera.position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    away = point - camera.position
    box = tab.query_selector(SCENE).bounding_box()
    scale = 0.5 * box["height"] / np.tan(0.5 * camera.fov) / (away @ forward)
    x = box["x"] + 0.5 * box["width"] + scale * (away @ right)
    return float(x), float(box["y"] + 0.5 * box["height"] - scale * (away @ up))


def point_at_chest(server: Any, tab: Any, page: Page) -> tuple[float, float]:
    """Put the mouse on the body; where that is, as soon as the page has drawn something to push."""
    canvas = tab.query_selector(SCENE)

    def pointed() -> tuple[float, float] | None:
        x, y = on_screen(server, tab, chest(page))
        tab.mouse.move(x - 1.0, y)
        tab.mouse.move(x, y)
        return (x, y) if canvas.evaluate("it => it.style.cursor") == "pointer" else None

    found: tuple[float, float] = until(pointed, "the body to be drawn, and nothing over it")
    return found


def chest(page: Page) -> Array:
    """The chest of the first body in the world of the page."""
    lane, act = page.stage.lanes[0], page.show.acts[0]
    place = page.show.poses(act)[skeleton.INDEX["spine3"], :3]
    return page.stage.to_page(lane, place)


def opened(browser: Any, server: Any, url: str) -> tuple[Any, list[str]]:
    """A tab with the page, and the list of what goes wrong in it.

    To fetch from anywhere else is wrong: the page works without internet.
    """
    tab = browser.new_page(viewport=SIZE)
    faults: list[str] = []

    def asked(request: Any) -> None:
        if not request.url.startswith((url, "data:", "blob:")):
            faults.append(request.url)

    tab.on("request", asked)
    tab.on("pageerror", lambda error: faults.append(str(error)))
    tab.goto(url)
    # That the browser draws in software is told in a box that stays, over the body.
    tab.add_style_tag(content="[role=alert] { display: none }")
    tab.wait_for_selector(SCENE, timeout=1e3 * PATIENCE)
    until(lambda: server.get_clients(), "the page to connect")
    return tab, faults


def test_people_play_and_push_a_body_and_see_it_recover(
    browser: Any, served: tuple[Any, Page], pictures: Path
) -> None:
    server, page = served
    show = page.show
    url = f"http://127.0.0.1:{server.get_port()}"
    tab, faults = opened(browser, server, url)
    tab.get_by_role("button", name="Pause").wait_for(timeout=1e3 * PATIENCE)
    tab.get_by_text("as recorded").wait_for(timeout=1e3 * PATIENCE)
    tab.get_by_role("button", name="Pause").click()
    until(lambda: not show.timeline.playing, "the pause")
    page.post(lambda: show.seek(0.3))
    tab.get_by_text("0.30 of 2.40 s").wait_for(timeout=1e3 * PATIENCE)
    tab.screenshot(path=str(pictures / "live_paused.png"))

    page.post(lambda: setattr(show, "restarts", False))
    page.post(lambda: setattr(show.timeline, "speed", 0.1))
    tab.mouse.click(*point_at_chest(server, tab, page))
    until(lambda: show.acts[0].trial.score.pushes == 1, "the push to arrive")
    assert show.live
    trial = show.acts[0].trial
    worst = until(lambda: trial.error > 0.003 and trial.error, "the body to react")
    assert not trial.fallen
    tab.get_by_text("simulated now").wait_for(timeout=1e3 * PATIENCE)
    tab.screenshot(path=str(pictures / "live_pushed.png"))
    page.post(lambda: setattr(show.timeline, "speed", 1.0))
    until(lambda: trial.score.survived == 1, "the body to recover")
    assert np.nanmax(trial.curves.error) >= worst
    cells = tab.locator("tr", has_text="balance").locator("td")
    until(lambda: cells.all_inner_texts()[1:] == ["1", "1", "0"], "the counter to move")
    tab.screenshot(path=str(pictures / "live_survived.png"))
    assert faults == []
    tab.close()


@pytest.mark.slow
def test_drags_and_second_tabs(browser: Any, served: tuple[Any, Page], pictures: Path) -> None:
    server, page = served
    show, trial = page.show, page.show.acts[0].trial
    url = f"http://127.0.0.1:{server.get_port()}"
    tab, faults = opened(browser, server, url)
    # A drag pushes where it goes: to the right of the picture.
    page.post(lambda: show.seek(0.0))
    page.post(lambda: setattr(show.timeline, "speed", 0.1))
    x, y = point_at_chest(server, tab, page)
    tab.mouse.down()
    tab.mouse.move(x + 60.0, y, steps=4)
    tab.mouse.up()
    until(lambda: trial.score.pushes == 1, "the drag to arrive")
    until(lambda: trial.session.v[1] > 0.02, "the body to go where it was dragged")
    tab.screenshot(path=str(pictures / "live_dragged.png"))
    page.post(lambda: setattr(show.timeline, "speed", 1.0))
    assert faults == []

    # A second tab sees the same, and its end does not disturb the first.
    other = browser.new_page(viewport=SIZE)
    other.goto(url)
    other.get_by_text("simulated now").wait_for(timeout=1e3 * PATIENCE)
    other.close()
    until(lambda: len(server.get_clients()) == 1, "the tab to go")
    page.post(lambda: show.seek(0.0))
    page.post(show.timeline.play)
    until(lambda: show.timeline.time > 0.3, "the show to go on")
    assert faults == []
    tab.close()
