"""Videos of runs: MP4 (H.264), drawn in software, without a display."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path

from physique.errors import InputError
from physique.extras import require
from physique.render.raster import Image
from physique.render.sampling import RATE, frames_at
from physique.render.scene import stage_runs
from physique.runs.run import Run
from physique.store import PathLike, write_atomic

_QUALITY = 20  # x264's constant rate factor: 18 to 23 look like the original
_BT709 = 1  # the colours of high-definition video, in FFmpeg's numbers


def write_video(
    path: PathLike,
    runs: Sequence[Run],
    *,
    source: bool = False,
    capsules: bool = False,
    rate: float | None = None,
    size: tuple[int, int] | None = None,
) -> Path:
    """Film runs side by side, at true speed, as an MP4 file; see `scene.stage_runs`.

    rate: pictures a second, 25 if left out, at most those of the run; the nearest frames are taken.
    size: (width, height), even numbers of pixels.
    Raises InputError where PyAV is missing, for a run without a skin, for a rate or size that
    cannot be, or where the file cannot be written.
    """
    require("av", "video")
    if size is not None and (size[0] % 2 or size[1] % 2):
        raise InputError("size", f"{size[0]} x {size[1]}", "even numbers of pixels", "add one pixel")
    scene = stage_runs(runs, size, source=source, capsules=capsules)
    rate = min(RATE if rate is None else rate, scene.fps)
    frames = frames_at(scene.frames, scene.fps, rate).tolist()
    return encode(path, scene.pictures(frames), scene.size, rate)


def encode(path: PathLike, pictures: Iterable[Image], size: tuple[int, int], rate: float) -> Path:
    """Write pictures (h, w, 3) as an MP4 file.

    size: (w, h), even numbers. rate: pictures a second. Raises InputError where PyAV is missing or
    the file cannot be written.
    """
    av = require("av", "video")
    path = Path(path)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "video.mp4"
        # The index comes first, so that players on the web need not wait for the end.
        with av.open(str(copy), "w", options={"movflags": "faststart"}) as container:
            stream = container.add_stream("libx264", rate=Fraction(rate).limit_denominator(1000))
            stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
            stream.options = {"crf": str(_QUALITY), "preset": "veryfast"}
            context = stream.codec_context
            context.colorspace = context.color_primaries = context.color_trc = _BT709
            context.thread_count = 1  # the same bits on any machine
            for picture in pictures:
                frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
                frame = frame.reformat(format="yuv420p", dst_colorspace="ITU709")
                container.mux(stream.encode(frame))
            container.mux(stream.encode())
        write_atomic(path, copy.read_bytes())
    return path
