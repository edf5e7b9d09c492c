"""Compiled loops: what is told while they are compiled, and where none can be kept."""

from __future__ import annotations

import logging
from collections.abc import Iterator

import numba
import pytest
from numba.core import caching

from physique import compiled as room
from physique.compiled import compiled, compiling


def double(x: float) -> float:
    return 2 * x


@pytest.fixture
def no_folder(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """As where neither the package's folder nor the home can be written."""

    def refuse(self: object) -> None:
        raise PermissionError("read-only")

    monkeypatch.setattr(caching._CacheLocator, "ensure_cache_path", refuse)
    room._warn_of_no_cache.cache_clear()
    yield
    room._warn_of_no_cache.cache_clear()


def test_what_is_compiled_is_told_and_what_is_there_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    # A function of a module of the package, as the optimiser's are; not kept on disk.
    fast = numba.njit(double)
    monkeypatch.setattr(double, "__module__", room.__name__)
    monkeypatch.setattr(room, "double", fast, raising=False)
    told: list[tuple[int, int]] = []
    with compiling(lambda begun, total: told.append((begun, total))):
        assert fast(1.5) == 3.0
        first = list(told)
        assert fast(2.5) == 5.0
    assert first
    assert told == first
    assert all(begun == 1 <= total for begun, total in first)
    assert fast(2) == 4  # a new signature, which nobody asks about any more
    assert told == first


@pytest.mark.usefixtures("no_folder")
def test_without_a_folder_to_write_loops_work_and_one_line_says_so(caplog: pytest.LogCaptureFixture) -> None:
    with pytest.raises(RuntimeError, match="cannot cache"):
        numba.njit(cache=True)(double)
    with caplog.at_level(logging.WARNING):
        first, second = compiled(double), compiled(double)
    assert first(1.5) == second(1.5) == 3.0
    assert len(caplog.messages) == 1
    assert "NUMBA_CACHE_DIR" in caplog.messages[0]
