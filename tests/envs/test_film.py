"""Films as files: whole, picture by picture, and what is no film."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from sledenv.envs.film import write_film


@pytest.mark.parametrize("ending", [".webp", ".mp4"])
def test_a_film_is_written_picture_by_picture(ending: str, tmp_path: Path) -> None:
    """Oracle: the number and size of the pictures in the file; no picture but the one at hand is drawn."""
    pytest.importorskip({".webp": "PIL", ".mp4": "imageio_ffmpeg"}[ending])
    drawn = 0

    def pictures() -> Iterator[np.ndarray]:
        nonlocal drawn
        for shade in range(0, 200, 10):
            drawn += 1
            yield np.full((90, 160, 3), shade, np.uint8)

    file = tmp_path / f"film{ending}"
    write_film(pictures(), file, fps=10)
    assert drawn == 20
    assert [path.name for path in tmp_path.iterdir()] == [file.name]
    if ending == ".webp":
        from PIL import Image

        with Image.open(file) as film:
            assert (film.n_frames, film.size) == (20, (160, 90))
    else:
        import imageio_ffmpeg

        assert imageio_ffmpeg.count_frames_and_secs(str(file)) == (20, 2.0)


def test_what_is_no_film_is_named(tmp_path: Path) -> None:
    picture = np.zeros((90, 160, 3), np.uint8)
    with pytest.raises(ValueError, match=r"film.avi'?: must end in .webp or .mp4"):
        write_film([picture], tmp_path / "film.avi")
    with pytest.raises(ValueError, match="fps = 0: must be an integer >= 1"):
        write_film([picture], tmp_path / "film.webp", fps=0)
    with pytest.raises(ValueError, match="pictures: there is none"):
        write_film([], tmp_path / "film.webp")
    assert list(tmp_path.iterdir()) == []
