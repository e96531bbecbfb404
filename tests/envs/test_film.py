"""Films as files: whole, picture by picture, and what is no film."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from sledenv.envs.film import write_film


def test_a_film_is_written_picture_by_picture(tmp_path: Path) -> None:
    """Oracle: number, size and time of the pictures in the file; no picture but the one at hand is drawn."""
    drawn = 0

    def pictures() -> Iterator[np.ndarray]:
        nonlocal drawn
        for shade in range(0, 200, 10):
            drawn += 1
            yield np.full((90, 160, 3), shade, np.uint8)

    file = tmp_path / "film.webp"
    write_film(pictures(), file, fps=10)
    assert drawn == 20
    assert list(tmp_path.iterdir()) == [file]
    with Image.open(file) as film:
        assert getattr(film, "n_frames", 1) == 20
        assert (film.size, film.info["loop"]) == ((160, 90), 0)
        film.load()
        assert film.info["duration"] == 100


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"path": "film.avi"}, r"film.avi'?: must end in .webp"),
        ({"fps": 0}, "fps = 0: must be an integer >= 1"),
        ({"fps": True}, "fps = True: must be an integer >= 1"),
        ({"pictures": []}, "pictures: there is none"),
    ],
)
def test_what_is_no_film_is_named(given: dict[str, Any], message: str, tmp_path: Path) -> None:
    own = {"pictures": [np.zeros((90, 160, 3), np.uint8)], "path": "film.webp"} | given
    with pytest.raises(ValueError, match=message):
        write_film(**own | {"path": tmp_path / own["path"]})
    assert list(tmp_path.iterdir()) == []
