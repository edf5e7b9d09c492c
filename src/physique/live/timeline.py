"""Where playback stands: seconds of the motion, as wall time goes by."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Timeline:
    """Playback of `duration` s at `speed` times real time; at the end it starts again, or stops."""

    duration: float
    time: float = 0.0
    speed: float = 1.0
    playing: bool = True
    repeat: bool = True

    def advance(self, seconds: float) -> None:
        """Go on by this much wall time."""
        if not self.playing:
            return
        self.time += seconds * self.speed
        if self.time <= self.duration:
            return
        if self.repeat and self.duration > 0.0:
            self.time %= self.duration
        else:
            self.time, self.playing = self.duration, False

    def seek(self, time: float) -> None:
        """Go to this time, as near as the motion has it."""
        self.time = min(max(time, 0.0), self.duration)

    def play(self) -> None:
        """Play; from the beginning if at the end."""
        if self.time >= self.duration:
            self.time = 0.0
        self.playing = True
