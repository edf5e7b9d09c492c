"""Serving: addresses, refusals in one line, a missing extra, and the command itself."""

from __future__ import annotations

import shlex
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from physique import extras, rotations
from physique.cli import main, parse
from physique.errors import InputError
from physique.live.bones import send_bones
from physique.live.controllers import Replay
from physique.live.page import Page
from physique.live.panel import BESIDE, HIDDEN
from physique.live.serve import check_address, serving, view
from physique.live.show import Show
from physique.render.skin import joint_transforms
from physique.runs.run import Run, finish_run


def refusal(capfd: pytest.CaptureFixture[str], *arguments: object) -> str:
    """What the command says when it refuses: one line, exit code 2."""
    with pytest.raises(SystemExit) as stop:
        main(["view", *(str(a) for a in arguments)])
    assert stop.value.code == 2
    printed = capfd.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    return printed.err


def test_the_commands_of_its_page_are_commands() -> None:
    text = (Path(__file__).resolve().parents[2] / "docs" / "view.md").read_text(encoding="utf-8")
    commands = [line for line in text.splitlines() if line.startswith("physique view")]
    assert commands
    for command in commands:
        parse(shlex.split(command, comments=True)[1:])


def test_a_port_in_use_gives_one_line(capfd: pytest.CaptureFixture[str], folder: Path) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen(1)
        port = other.getsockname()[1]
        said = refusal(capfd, folder, "--port", port)
    assert f"127.0.0.1:{port}: found a port that is in use" in said
    assert f"--port {port + 1}" in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--port", "70000"], "0 to 65535"),
        (["--port", "-1"], "0 to 65535"),
        (["--host", "192.0.2.7"], "an address of this machine"),
        (["--host", "no.such.host.invalid"], "an address of this machine"),
    ],
)
def test_addresses_that_cannot_be(
    capfd: pytest.CaptureFixture[str], folder: Path, arguments: list[str], words: str
) -> None:
    assert words in refusal(capfd, folder, *arguments)


def test_folders_that_are_no_runs(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert "the folder of a run" in refusal(capfd, tmp_path)
    assert "1 to 6 runs" in refusal(capfd, *[tmp_path] * 7)


def test_a_run_that_blew_up_at_once(capfd: pytest.CaptureFixture[str], standing: Run, tmp_path: Path) -> None:
    whole = standing.trajectory
    start = whole.beginning(1)
    finish_run(tmp_path, replace(standing, trajectory=start))
    assert "blew up at its start" in refusal(capfd, tmp_path)


def test_a_missing_extra_names_the_command(
    capfd: pytest.CaptureFixture[str], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(name: str) -> Any:
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(extras, "import_module", missing)
    assert "pip install 'physique[view]'" in refusal(capfd, folder)


def test_only_this_machine_is_served() -> None:
    with serving("127.0.0.1", 0) as server:
        port = server.get_port()
        with urllib.request.urlopen(f"http://127.0.0.1:{port}", timeout=20) as answer:
            assert answer.status == 200
        # Nobody listens at the machine's other addresses: they can be taken.
        with socket.socket() as other:
            other.bind(("127.0.0.2", port))
        with pytest.raises(InputError, match="in use"):
            check_address("127.0.0.1", port)
        # No visitor may have the page published.
        assert server.request_share_url() is None
    check_address("127.0.0.1", port)


@pytest.mark.parametrize(("host", "words"), [("127.0.0.1", "only this"), ("0.0.0.0", "EVERYONE")])
def test_it_says_who_can_see_it(folder: Path, host: str, words: str) -> None:
    said: list[str] = []
    stop = threading.Event()
    stop.set()
    view([folder], host=host, port=0, told=said.append, stop=stop)
    assert said[0].startswith(f"http://{host}:")
    assert words in said[1]


def test_ctrl_c_ends_the_command(folder: Path) -> None:
    command = [sys.executable, "-m", "physique", "view", str(folder), "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    url, who = (process.stdout.readline().strip() for _ in range(2))
    assert "only this machine" in who
    with urllib.request.urlopen(url, timeout=20) as answer:
        assert b"<html" in answer.read().lower()
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 0
    assert errors == ""


@pytest.fixture(scope="module")
def page(standing: Run) -> Any:
    """A page of two bodies that nobody looks at; time goes by when a test says so."""
    controllers = [{"replay": Replay(standing.trajectory)} for _ in range(2)]
    with serving("127.0.0.1", 0) as server:
        yield Page(server, Show([standing, standing], controllers))


def test_the_page_draws_what_is_chosen(page: Page) -> None:
    panel, lane = page.panel, page.stage.lanes[0]
    skin, capsules = lane.targets
    page.tick(0.1)
    assert (skin.visible, capsules.visible) == (True, False)
    place = page.show.poses(page.show.acts[0])[0, :3]
    assert np.allclose(skin.position, place)
    panel._look.value, panel._ghost.value, panel._arrows.value = "capsules", BESIDE, True
    page.tick(0.1)
    assert (skin.visible, capsules.visible) == (False, True)
    # It stands: both feet carry it.
    assert [arrow.node.visible for arrow in lane._floor] == [True, True]
    ghost = lane._ghosts["capsules"].node
    assert ghost.visible
    panel._ghost.value = HIDDEN
    page.tick(0.1)
    assert not ghost.visible
    panel._look.value, panel._arrows.value = "skin", False


def test_a_body_without_a_skin_shows_its_capsules(standing: Run) -> None:
    show = Show([replace(standing, mesh=None)], [{"replay": Replay(standing.trajectory)}])
    with serving("127.0.0.1", 0) as server:
        page = Page(server, show)
        page.tick(0.1)
        (capsules,) = page.stage.lanes[0].targets
        assert capsules.visible
        assert page.panel.look == "capsules"


def test_a_stick_goes_with_the_hand(armed_run: Run) -> None:
    show = Show([armed_run], [{"replay": Replay(armed_run.trajectory)}])
    with serving("127.0.0.1", 0) as server:
        page = Page(server, show)
        show.seek(0.3)
        page.tick(0.0)
        lane, act = page.stage.lanes[0], show.acts[0]
        (stick,), (ghost,) = lane._props, lane._ghost_props
        assert stick.node in lane.targets
        for prop, q in ((stick, armed_run.trajectory.q), (ghost, armed_run.trajectory.source_q)):
            wrist = joint_transforms(armed_run.body, q[30:31])[0, 21]
            assert prop.node.visible
            assert prop.node.position == pytest.approx(wrist[:, 3])
            assert rotations.to_matrix(np.array(prop.node.wxyz)) == pytest.approx(wrist[:, :3])
        page.panel._ghost.value, page.panel._look.value = HIDDEN, "capsules"
        page.tick(0.0)
        assert (stick.node.visible, ghost.node.visible) == (True, False)
        # It can be pushed too: what is hit is the hand.
        show.go_live(True)
        tip = act.trial.session.world_point(21, stick.node.vertices[-1])
        hit = show.hit(0, tip + np.array([0.0, 0.0, 0.1]), np.array([0.0, 0.0, -1.0]))
        assert hit is not None
        assert hit.part == 21


def test_bones_arrive_as_if_they_were_assigned(page: Page) -> None:
    """The messages are those that viser's own setters make."""
    node = page.stage.lanes[0].targets[0]
    sent: list[Any] = []
    random = np.random.default_rng(0)
    places, turns = random.normal(size=(22, 3)), random.normal(size=(22, 4))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(node._impl.api, "_queue_scene_message", sent.append)
        send_bones(node, places, turns)
        ours = [*sent]
        sent.clear()
        for bone, place, turn in zip(node.bones, places, turns):
            bone.position, bone.wxyz = place, turn
    assert len(ours) == 44
    assert ours == sent


def test_lanes_do_not_overlap_and_the_camera_follows(page: Page) -> None:
    stage, acts = page.stage, page.show.acts
    for _ in range(100):
        page.tick(0.01)
    places = [stage.to_page(lane, page.show.poses(act)[0, :3]) for lane, act in zip(stage.lanes, acts)]
    # Who looks at their faces, along -x, has y to the right.
    assert places[1][1] - places[0][1] > 1.0
    assert np.abs(np.mean(places, axis=0)[:2]).max() < 0.1
    assert np.allclose(stage.to_lane(stage.lanes[1], places[1]), page.show.poses(acts[1])[0, :3])


def test_a_click_and_a_drag_push_the_body_under_them(page: Page) -> None:
    lane, show = page.stage.lanes[1], page.show
    trial = show.acts[1].trial
    chest = page.stage.to_page(lane, show.poses(show.acts[1])[9, :3])
    ahead = np.array([-1.0, 0.0, 0.0])
    page.post(lambda: page._click(1, chest - 3.0 * ahead, ahead))
    page.tick(0.0)
    assert show.live
    assert trial.score.pushes == 1
    assert show.acts[0].trial.score.pushes == 0
    assert lane._push.node.visible
    page.tick(0.1)
    assert trial.session.v[0] < -0.05
    page.tick(2.0)
    assert not lane._push.node.visible
    # A drag to the left pushes to the left.
    page.post(lambda: show.seek(0.0))
    page.post(lambda: page._grab(1, chest - 3.0 * ahead, ahead))
    page.post(lambda: page._release(1, np.array([0.0, 0.4, 0.0])))
    page.tick(0.1)
    assert trial.score.pushes == 2
    assert trial.session.v[1] > 0.05
    # Beside the body, and without a way, nothing is pushed.
    page.post(lambda: page._click(1, chest + np.array([3.0, 5.0, 0.0]), ahead))
    page.post(lambda: page._grab(1, chest - 3.0 * ahead, ahead))
    page.post(lambda: page._release(1, np.zeros(3)))
    page.tick(0.0)
    assert trial.score.pushes == 2


def test_controls_reach_the_show(page: Page) -> None:
    show, panel = page.show, page.panel

    def settle(condition: Callable[[], bool]) -> None:
        end = time.monotonic() + 20.0
        while not condition() and time.monotonic() < end:
            page.tick(0.0)
            time.sleep(0.01)
        assert condition()

    panel._mode.value = "a live simulation"
    settle(lambda: show.live)
    panel._mode.value = "the recording"
    settle(lambda: not show.live)
    # The page's own changes show in the control, and do not come back.
    page.post(lambda: show.go_live(True))
    settle(lambda: panel._mode.value == "a live simulation")
    settle(lambda: show.live)
    page.post(lambda: show.go_live(False))
    settle(lambda: panel._mode.value == "the recording")
    panel._speed.value = "1/4"
    settle(lambda: show.timeline.speed == 0.25)
    panel._speed.value = "1"
    panel._again.value = False
    settle(lambda: not show.restarts)


def test_what_the_panel_tells(page: Page) -> None:
    page.post(lambda: page.show.go_live(True))
    page.post(page.show.forget)
    page.tick(0.0)
    lane = page.stage.lanes[0]
    chest = page.stage.to_page(lane, page.show.poses(page.show.acts[0])[9, :3])
    ahead = np.array([-1.0, 0.0, 0.0])
    page.post(lambda: page._click(0, chest - 3.0 * ahead, ahead))
    page.tick(0.05)
    said = page.panel._status.content
    assert "simulated now" in said
    assert "1: replay</td><td align=right>1</td><td align=right>0</td>" in said
    assert "not judged" not in said
    page.post(lambda: page.show.seek(0.0))
    page.tick(0.0)
    assert "1 not judged" in page.panel._status.content
    times, *curves, line = page.panel._errors._handle.data
    assert len(times) == len(line) == len(curves[0])
    assert np.isfinite(line).sum() == 2
