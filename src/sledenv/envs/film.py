"""Films: pictures written one after the other into a file that browsers play."""

from __future__ import annotations

import importlib
import importlib.util
import itertools
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
from gymnasium.error import DependencyNotInstalled

from sledenv.machine.files import replacing


def write_film(pictures: Iterable[np.ndarray], path: str | os.PathLike[str], fps: int = 30) -> None:
    """Write pictures as a film, one after the other: none is kept but the one at hand.

    Parameters
    ----------
    pictures : iterable of ndarray of uint8, shape (height, width, 3)
        Such as ``env.unwrapped.film()``, or :meth:`sledenv.envs.render.DescentRenderer.film` of any descent.
    path : str or path
        Where to: ``.webp``, which browsers play, needs Pillow; ``.mp4`` needs imageio-ffmpeg, which comes with moviepy.
        A file that is there is replaced once the film is whole.
    fps : int
        Pictures a second, >= 1.

    Raises
    ------
    ValueError
        For another ending, no picture, or a wrong rate.
    gymnasium.error.DependencyNotInstalled
        If what writes the film is missing.
    """
    place = Path(path)
    if place.suffix not in _WRITERS:
        raise ValueError(f"path = {str(path)!r}: must end in {' or '.join(_WRITERS)}")
    if isinstance(fps, bool) or not isinstance(fps, int) or fps < 1:
        raise ValueError(f"fps = {fps!r}: must be an integer >= 1")
    module, package, write = _WRITERS[place.suffix]
    if importlib.util.find_spec(module) is None:
        raise DependencyNotInstalled(f"a film {place.suffix} needs {package}: pip install {package}")
    rest = iter(pictures)
    first = next(rest, None)
    if first is None:
        raise ValueError("pictures: there is none")
    with replacing(place, *_WRITERS) as scratch:
        write(itertools.chain([first], rest), first.shape, scratch, fps)


def _write_webp(pictures: Iterator[np.ndarray], shape: tuple[int, ...], file: Path, fps: int) -> None:
    from PIL import Image

    images = map(Image.fromarray, pictures)
    next(images).save(file, "WEBP", save_all=True, append_images=images, duration=round(1000 / fps), method=0)


def _write_mp4(pictures: Iterator[np.ndarray], shape: tuple[int, ...], file: Path, fps: int) -> None:
    imageio_ffmpeg = importlib.import_module("imageio_ffmpeg")
    options = ["-f", "mp4"]  # which the name of the unfinished file does not say
    writer = imageio_ffmpeg.write_frames(file, (shape[1], shape[0]), fps=fps, output_params=options)
    writer.send(None)
    try:
        for picture in pictures:
            writer.send(np.ascontiguousarray(picture))
    finally:
        writer.close()


_WRITERS = {  # module, package and writer of each kind of film
    ".webp": ("PIL", "pillow", _write_webp),
    ".mp4": ("imageio_ffmpeg", "imageio-ffmpeg", _write_mp4),
}
