"""Serving the page, on this machine alone unless told otherwise."""

from __future__ import annotations

import contextlib
import errno
import io
import ipaddress
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from typing import Any

from physique.errors import InputError
from physique.extras import require
from physique.live.page import Page
from physique.live.show import Show
from physique.runs.run import Run, load_run
from physique.simulation.process import quiet

HOST, PORT = "127.0.0.1", 8080
MOST_RUNS = 6


def view(
    folders: Sequence[Path],
    *,
    host: str = HOST,
    port: int = PORT,
    told: Callable[[str], None],
    stop: Event | None = None,
) -> None:
    """Serve a page that shows the runs in these folders, until `stop` is set or Ctrl-C.

    told: is handed lines for the person who waits: first the page's address.
    Raises InputError for a folder without a finished run, a host or port that cannot be used, and
    where the extra `view` is missing.
    """
    require("viser", "view")
    if not 1 <= len(folders) <= MOST_RUNS:
        raise InputError("view", f"{len(folders)} runs", f"1 to {MOST_RUNS} runs", "name their folders")
    check_address(host, port)
    show = Show([_load(folder) for folder in folders])
    with quiet(), serving(host, port) as server:
        page = Page(server, show)
        told(f"http://{_in_url(host)}:{server.get_port()}")
        told(_who_sees(host))
        page.run(stop or Event())


def _load(folder: Path) -> Run:
    run = load_run(folder)
    if run.trajectory.frames < 2:
        raise InputError(
            str(folder),
            "a simulation that blew up at its start",
            "a run with motion",
            "choose another part of the clip and run it again",
        )
    return run


@contextmanager
def serving(host: str, port: int) -> Iterator[Any]:
    """A viser server on this address, and on no other; port 0 takes a free one.

    Raises InputError where the address cannot be used.
    """
    viser = require("viser", "view")
    check_address(host, port)
    with _silence():
        server = viser.ViserServer(host=host, port=port, verbose=False)
    # Any page in the browser could ask the server to publish itself through a tunnel.
    server.request_share_url = lambda *_, **__: None
    try:
        if port and server.get_port() != port:
            # The server takes the next free port where another program was faster.
            raise _taken(host, port)
        yield server
    finally:
        with _silence():
            server.stop()


def check_address(host: str, port: int) -> None:
    """Raises InputError where no page can be served on this host and port."""
    if not 0 <= port <= 65535:
        raise InputError("--port", str(port), "0 to 65535", "choose another port")
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (OSError, UnicodeError):
        raise InputError(
            "--host", repr(host), "an address of this machine", f"leave it out, or give {HOST}"
        ) from None
    with socket.socket(family, kind, protocol) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(address)
            # Two programs may bind one address; only one may listen.
            probe.listen(1)
        except PermissionError:
            raise InputError(
                "--port", str(port), "a port that this user may open", "choose one above 1023"
            ) from None
        except OSError as fault:
            if fault.errno == errno.EADDRNOTAVAIL:
                raise InputError(
                    "--host", repr(host), "an address of this machine", f"leave it out, or give {HOST}"
                ) from None
            raise _taken(host, port) from None


def _taken(host: str, port: int) -> InputError:
    return InputError(
        f"{host}:{port}",
        "a port that is in use",
        "a free port",
        f"choose another, such as --port {port + 1}, or --port 0 for any",
    )


def _in_url(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _who_sees(host: str) -> str:
    try:
        local = ipaddress.ip_address(host).is_loopback
    except ValueError:
        local = host == "localhost"
    if local:
        return "only this machine can open the page; Ctrl-C ends it"
    return f"EVERYONE who can reach {host} can open the page, without a password; Ctrl-C ends it"


@contextmanager
def _silence() -> Iterator[None]:
    """Without what viser prints of its own."""
    with contextlib.redirect_stdout(io.StringIO()):
        yield
