"""Tables with a digest: what comes back is what was written, and nothing that was changed comes back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from sledenv.machine.checksummed import read_checksummed, write_checksummed


def table() -> pd.DataFrame:
    """Every kind of column that is kept, and words about them."""
    rng = np.random.default_rng(0)
    columns: dict[str, Any] = {
        "status": pd.Categorical.from_codes(rng.integers(2, size=40), ["finish", "jammed", "tumbled"]),
        "stage": np.where(rng.random(40) < 0.5, "trained", "before"),
        "reward": np.where(rng.random(40) < 0.2, -np.nan, rng.normal(size=40)),
        "rebounds": rng.integers(9, size=40),
        "on_bound": rng.random(40) < 0.5,
    }
    found = pd.DataFrame(columns)
    found.attrs = {"suite": "tiny", "curve": [[1.0, 2.5, float("nan")]]}
    return found


@pytest.fixture
def file(tmp_path: Path) -> Path:
    place = tmp_path / "one.parquet"
    write_checksummed(table(), place)
    return place


def test_what_is_read_is_what_was_written(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Oracle: the table; a table without rows; there is no file."""
    found = read_checksummed(file, "judging")
    assert found is not None
    pd.testing.assert_frame_equal(found, table(), check_exact=True)
    assert (found.attrs["suite"], list(found.attrs)) == ("tiny", ["suite", "curve"])
    write_checksummed(table().iloc[:0], file)
    assert read_checksummed(file, "judging") is not None
    file.unlink()
    assert read_checksummed(file, "judging") is None
    assert caplog.messages == []


def changed(how: str, place: Path) -> None:
    """Change a file, or put another one in its place."""
    found = pd.read_parquet(place)
    match how:
        case "edited":
            found.loc[3, "rebounds"] += 1
            found.to_parquet(place, index=False)
        case "told otherwise":
            found.attrs["suite"] = "full"
            found.to_parquet(place, index=False)
        case "renamed":
            write_checksummed(table(), place.with_name("two.parquet"))
            place.with_name("two.parquet").replace(place)
        case "without digest":
            table().to_parquet(place, index=False)
        case "cut":
            place.write_bytes(place.read_bytes()[:-100])
        case "emptied":
            place.write_bytes(b"")


@pytest.mark.parametrize("how", ["edited", "told otherwise", "renamed", "without digest", "cut", "emptied"])
def test_what_was_changed_is_named_and_not_read(how: str, file: Path, caplog: pytest.LogCaptureFixture) -> None:
    changed(how, file)
    assert read_checksummed(file, "judging") is None
    assert caplog.messages == [f"sledenv: judging again, because it is not as it was left: {file}"]


@pytest.mark.parametrize("count", [80, pytest.param(600, marks=pytest.mark.slow)])
def test_flipped_bits_are_seen_or_change_no_value(count: int, file: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Oracle: the table, wherever of some bits one is turned; none ends in an error.

    A category that no row has, such as "tumbled" here, is no value.
    """
    caplog.set_level("ERROR", logger="sledenv")
    whole, rng = file.read_bytes(), np.random.default_rng(0)
    seen = 0
    for bit in rng.choice(8 * len(whole), count, replace=False).tolist():
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        file.write_bytes(damaged)
        found = read_checksummed(file, "judging")
        seen += found is None
        if found is not None:
            words = {"status": str, "stage": str}
            pd.testing.assert_frame_equal(found.astype(words), table().astype(words), check_exact=True)
    assert seen > count // 2
