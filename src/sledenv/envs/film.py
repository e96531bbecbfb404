"""Films: pictures written one after the other into a file that browsers play."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from sledenv.machine.extras import needs
from sledenv.machine.files import replacing


def write_film(pictures: Iterable[np.ndarray], path: str | os.PathLike[str], fps: int = 30) -> None:
    """Write pictures as a film in the format WebP, one after the other: none is kept but the one at hand.

    Parameters
    ----------
    pictures : iterable of ndarray of uint8, shape (height, width, 3)
        Such as ``env.unwrapped.film()``, or :func:`sledenv.envs.render.draw_film` of any descent.
    path : str or path
        Ends in ``.webp``. A file that is there is replaced once the film is whole.
    fps : int
        Pictures per second, >= 1.

    Raises
    ------
    ValueError
        For another ending, no picture, or a wrong rate.
    ImportError
        If Pillow is missing.
    """
    if Path(path).suffix != ".webp":
        raise ValueError(f"path = {str(path)!r}: must end in .webp")
    if isinstance(fps, bool) or not isinstance(fps, int) or fps < 1:
        raise ValueError(f"fps = {fps!r}: must be an integer >= 1")
    with needs("render", "write_film"):
        from PIL import Image
    images = map(Image.fromarray, pictures)
    first = next(images, None)
    if first is None:
        raise ValueError("pictures: there is none")
    with replacing(Path(path), ".webp") as scratch:
        times = {"duration": round(1000 / fps), "loop": 0}
        first.save(scratch, "WEBP", save_all=True, append_images=images, quality=60, method=2, **times)
