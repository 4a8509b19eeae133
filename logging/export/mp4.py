"""A run as a film (MP4, H.264), in the time that it took or faster."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pushplan.logging.export.film.colours import FilmColours
from pushplan.logging.export.film.frames import Film
from pushplan.logging.export.film.scene import HEIGHT, WIDTH, FilmScene
from pushplan.logging.messages.recorded import RecordedRun
from pushplan.plans.result import Run
from pushplan.util.extras import optional
from pushplan.util.outputs.write import write_whole

PICTURES_PER_SECOND = 25

STILL = 4.0
"""Length of the film of a run in which nothing moves, s."""


def write_mp4(run: Run | RecordedRun, path: Path | str, *, rate: float = 1.0) -> None:
    """Write the film of an execution; of a run without one, the nearest path and the reason stand still.

    Args:
        run: What to show.
        path: The file.
        rate: Simulated seconds in each second of the film, > 0.

    Raises:
        MissingExtraError: When av is not installed.
        OutputError: When the file cannot be written.
    """
    av = optional("av", "a film", "av", "mp4")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "run.mp4"
        _encode(av, _pictures(run, rate), target)
        write_whole(path, target.read_bytes())


def _pictures(run: Run | RecordedRun, rate: float) -> Iterator[NDArray[np.uint8]]:
    execution = run.execution
    if execution is None or len(execution.t) == 0:
        still = FilmColours(FilmScene(run).picture_with_words())
        yield from (still.with_parts([]) for _ in range(round(STILL * PICTURES_PER_SECOND)))
        return
    film = Film(run, execution)
    colours = FilmColours(film.still)
    moving = film.pictures(PICTURES_PER_SECOND / rate, 0.0, float(execution.t[-1]))
    yield from map(colours.with_parts, moving)


def _encode(av: Any, pictures: Iterable[NDArray[np.uint8]], target: Path) -> None:
    """Encode pictures, yuv420p, to a file that players can start before they have read its end."""
    with av.open(str(target), "w", options={"movflags": "+faststart"}) as container:
        # Of flat colours that move little, slower presets and a finer search make no smaller film.
        how = {"crf": "20", "preset": "veryfast", "x264-params": "subme=1:ref=1:scenecut=0"}
        stream = container.add_stream("libx264", rate=Fraction(PICTURES_PER_SECOND), options=how)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.codec_context.thread_count = (
            1  # more take more time in all, and others may want the processors
        )
        for picture in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="yuv420p")))
        container.mux(stream.encode())
