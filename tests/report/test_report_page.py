"""A report in a real browser, opened from disk with the network off. Pictures stay in out/tests."""

from __future__ import annotations

import dataclasses
import io
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from physique.commands.report import write_report
from physique.runs.run import Run
from renamed_runs import EVIL, renamed

Picture = NDArray[np.int64]


class Tab:
    """A page that collects what goes wrong on it."""

    def __init__(self, browser: Any, path: Path, **options: Any) -> None:
        context = browser.new_context(reduced_motion="reduce", **options)
        context.set_offline(True)
        self.page = context.new_page()
        self.faults: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda m: self.faults.append(f"{m.type}: {m.text}"))
        self.page.on("pageerror", lambda fault: self.faults.append(str(fault)))
        self.page.on("dialog", lambda dialog: self.faults.append("a dialog"))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(path.as_uri(), timeout=60_000)
        self.page.locator("html[data-ready]").wait_for(state="attached", timeout=60_000)

    def __enter__(self) -> Tab:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        # A tab that goes on playing would starve the next one.
        self.page.context.close()
        if kind is None:
            assert self.faults == []
            assert [u for u in self.requests if not u.startswith(("file:", "data:"))] == []

    def figure(self) -> Picture:
        """What the stage shows, (H, W, 3)."""
        data = self.page.locator("#stage").screenshot()
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)

    def now(self) -> float:
        return float(self.page.locator("#now").inner_text().removesuffix(" s"))

    def play_on(self) -> None:
        """Wait until time has passed."""
        before, deadline = self.now(), time.monotonic() + 30
        while self.now() == before:
            assert time.monotonic() < deadline, "the page does not play"
            self.page.wait_for_timeout(20)


@pytest.fixture(scope="module")
def report(run: Run, armed_run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A man, and the shapes of a man with a stick in his hand."""
    runs = [run, renamed(dataclasses.replace(armed_run, mesh=None), body="heavy")]
    return write_report(tmp_path_factory.mktemp("report") / "report.html", runs)


def test_plays_seeks_and_answers(browser: Any, report: Path, pictures: Path) -> None:
    with Tab(browser, report, viewport={"width": 960, "height": 560}) as tab:
        page = tab.page
        assert page.locator("html").get_attribute("data-ready") == "stage"

        start = tab.figure()
        warm, cold = (start[..., i] - start[..., 2 - i] > 30 for i in (0, 2))
        assert warm.mean() > 0.01  # both figures are there, the first on the left
        assert cold.mean() > 0.01
        assert np.nonzero(warm)[1].mean() < np.nonzero(cold)[1].mean()

        page.locator("#play").click()
        tab.play_on()
        page.locator("#play").click()
        paused = tab.now()
        page.wait_for_timeout(200)
        assert tab.now() == paused

        # A click on the time line at 0.4 s of 0.5, where it is hard.
        strip = page.locator("[data-chart=difficulty]")
        width = strip.bounding_box()["width"]
        strip.click(position={"x": 92 + 0.8 * (width - 100), "y": 10})
        assert tab.now() == pytest.approx(0.4, abs=0.011)
        assert changed(tab.figure(), start)
        assert "very hard" in page.locator("#why").inner_text()
        assert "pose" in page.locator("#tip").inner_text()
        page.mouse.move(5, 5)
        page.screenshot(path=pictures / "report_desktop.png")

        page.keyboard.press("ArrowRight")
        assert tab.now() == pytest.approx(0.41, abs=0.011)
        page.locator("#stage").focus()
        page.keyboard.press("End")
        assert tab.now() == 0.5

        skin = tab.figure()
        for key in "cgef":
            page.keyboard.press(key)
            if key != "f":  # following shows when time goes on
                assert changed(tab.figure(), skin), key
            if key == "c":
                page.screenshot(path=pictures / "report_shapes.png")
            page.keyboard.press(key)
        assert not changed(tab.figure(), skin)

        page.locator("#figures button", has_text="heavy").click()
        assert changed(tab.figure(), skin)  # the camera went to that figure
        assert page.locator("#tabs [aria-pressed=true]").inner_text() == "heavy"
        before = tab.figure()
        page.locator("[data-look=side]").click()
        assert changed(tab.figure(), before)

        # The stick is brown; all else in the middle is blue or grey.
        for key in "gec":
            page.keyboard.press(key)
        alone = tab.figure()
        middle = alone[:, alone.shape[1] // 4 : -alone.shape[1] // 4]
        assert ((middle[..., 0] - middle[..., 2] > 14) & (middle[..., 0] < 150)).sum() > 20

        page.locator("[data-chart=effort]").hover(position={"x": 300, "y": 24})
        assert "Nm" in page.locator("#tip").inner_text()


@pytest.mark.slow
def test_fits_a_phone(browser: Any, report: Path, pictures: Path) -> None:
    size = {"width": 390, "height": 844}
    with Tab(browser, report, viewport=size, is_mobile=True, has_touch=True, color_scheme="light") as tab:
        assert tab.page.evaluate("document.documentElement.scrollWidth") == 390
        for scheme in ("light", "dark"):
            tab.page.emulate_media(color_scheme=scheme)
            assert (tab.figure()[2, 2].mean() > 180) == (scheme == "light")
            tab.page.screenshot(path=pictures / f"report_phone_{scheme}.png")
        tab.page.locator("#play").tap()
        tab.play_on()


def test_hostile_names_do_nothing(browser: Any, run: Run, tmp_path: Path) -> None:
    bare = dataclasses.replace(run, mesh=None)
    evil = [renamed(bare, clip=EVIL, body=f"{EVIL}{i}") for i in range(2)]
    size = {"width": 400, "height": 640}
    with Tab(browser, write_report(tmp_path / "a.html", evil), viewport=size) as tab:
        assert tab.page.locator("img").count() == 0
        assert EVIL in tab.page.locator("#figures").inner_text()
        tab.page.locator("[data-chart=difficulty]").hover()


def changed(a: Picture, b: Picture) -> bool:
    """Whether more than a few pixels differ."""
    return bool((np.abs(a - b).max(axis=-1) > 24).sum() > 30)
