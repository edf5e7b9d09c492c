"""How many poses a second the live page streams.

    python benchmarks/live_page.py RUN [RUN ...] [--seconds 10] [--chromium /usr/bin/chromium]

plays the runs, simulates them live, and counts the poses of the first body that arrive: in a
client that only reads, and, where the browser is given, in Chromium without a display, which draws
in software and takes what it can.
"""

from __future__ import annotations

import argparse
import threading
import time
from pathlib import Path

import msgspec
import websockets.sync.client
import zstandard
from playwright.sync_api import sync_playwright
from viser import __version__ as viser_version

from physique.live.page import Page
from physique.live.serve import serving
from physique.live.show import Show
from physique.runs.run import load_run

FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def main() -> None:
    """Measure the recording and the live simulation."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--chromium", help="the browser's program")
    arguments = parser.parse_args()
    show = Show([load_run(folder) for folder in arguments.runs])
    with serving("127.0.0.1", 0) as server:
        page, stop = Page(server, show), threading.Event()
        thread = threading.Thread(target=page.run, args=(stop,))
        thread.start()
        try:
            for live in (False, True):
                page.post(lambda live=live: show.go_live(live))
                name = "simulated live" if live else "as recorded"
                rate, busy = in_client(server.get_port(), arguments.seconds)
                print(
                    f"{name}: {rate:.1f} poses/s in a client that reads, "
                    f"{1e3 * busy:.1f} ms of processor time each"
                )
                if arguments.chromium:
                    rate = in_chromium(arguments.chromium, server.get_port(), arguments.seconds)
                    print(f"{name}: {rate:.1f} poses/s in Chromium, drawing in software")
        finally:
            stop.set()
            thread.join()


def has_pose(frame: bytes) -> bool:
    """Whether a websocket frame turns the pelvis of the first body."""
    size = int.from_bytes(frame[8:16], "little")
    content = msgspec.msgpack.decode(zstandard.decompress(frame[16 : 16 + size]))
    return any(
        message["type"] == "SetBoneOrientationMessage"
        and message["bone_index"] == 0
        and message["name"].startswith("/stage/0/skin")
        for message in content["messages"]
    )


def in_client(port: int, seconds: float) -> tuple[float, float]:
    """Poses a second that a client receives which does nothing else, and the seconds of processor
    time that this process takes for each."""
    frames = []
    with websockets.sync.client.connect(
        f"ws://127.0.0.1:{port}", subprotocols=[f"viser-v{viser_version}"], max_size=None
    ) as client:
        busy, end = time.process_time(), time.perf_counter() + seconds
        while time.perf_counter() < end:
            frames.append(client.recv())
        busy = time.process_time() - busy
    poses = sum(has_pose(frame) for frame in frames)
    return poses / seconds, busy / poses


def in_chromium(program: str, port: int, seconds: float) -> float:
    """Poses a second that arrive in a browser, once it has drawn its first frames."""
    frames: list[bytes] = []

    def keep(frame: bytes) -> None:
        frames.append(frame)

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=FLAGS)
        tab = browser.new_page(viewport={"width": 720, "height": 480})
        tab.on("websocket", lambda socket: socket.on("framereceived", keep))
        tab.goto(f"http://127.0.0.1:{port}")
        tab.get_by_text("Playback").wait_for(timeout=120e3)
        tab.wait_for_timeout(10e3)
        frames.clear()
        begin = time.perf_counter()
        tab.wait_for_timeout(1e3 * seconds)
        lasted = time.perf_counter() - begin
        rate = sum(has_pose(frame) for frame in frames) / lasted
        browser.close()
    return rate


if __name__ == "__main__":
    main()
