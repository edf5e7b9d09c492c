"""Playback: time that goes by, stops, and starts again."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from physique.live.timeline import Timeline

durations = st.floats(0.01, 100.0)
waits = st.lists(st.floats(0.0, 30.0), max_size=8)


@given(durations, st.sampled_from([0.1, 1.0, 2.0]), waits)
def test_it_repeats(duration: float, speed: float, seconds: list[float]) -> None:
    line = Timeline(duration, speed=speed)
    for wait in seconds:
        line.advance(wait)
        assert 0.0 <= line.time <= duration
    whole = speed * sum(seconds) - line.time
    assert whole / duration == pytest.approx(round(whole / duration), abs=1e-6 * (1 + whole))
    assert line.playing


@given(durations, waits)
def test_without_repeat_it_stops_at_the_end(duration: float, seconds: list[float]) -> None:
    line = Timeline(duration, repeat=False)
    for wait in seconds:
        line.advance(wait)
    assert line.time == pytest.approx(min(duration, sum(seconds)))
    assert line.playing == (sum(seconds) <= duration)


def test_it_pauses_seeks_and_plays_from_the_beginning() -> None:
    line = Timeline(2.0, playing=False)
    line.advance(1.0)
    assert line.time == 0.0
    line.seek(5.0)
    assert line.time == 2.0
    line.play()
    assert (line.time, line.playing) == (0.0, True)
    line.seek(-1.0)
    assert line.time == 0.0
