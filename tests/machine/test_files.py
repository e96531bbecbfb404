"""Files that appear only when they are complete, and tables as comma-separated values."""

from __future__ import annotations

import csv
import errno
import secrets
from pathlib import Path

import pytest

from sledenv.machine.files import publish, put, replacing, write_csv


@pytest.mark.parametrize("text", ["=1+1", "+1+cmd|' /C calc'!A0", "-2-3", "@SUM(A1)", "\t=1+1", " =1", "=", "--1"])
def test_text_that_a_spreadsheet_would_run_is_told_as_text(text: str, tmp_path: Path) -> None:
    """Oracle: the apostrophe that spreadsheets take for "this is text", in a header as in a row."""
    write_csv(tmp_path / "table.csv", ("name", text), [(text, 1.0)])
    with (tmp_path / "table.csv").open(newline="") as file:
        assert list(csv.reader(file)) == [["name", f"'{text}"], [f"'{text}", "1.0"]]


@pytest.mark.parametrize("value", ["-0.5", "-", "+1e-3", "-inf", "a=b", "", "sled", -1.5, 0.1 + 0.2, 3, None])
def test_everything_else_is_written_as_it_is(value: object, tmp_path: Path) -> None:
    write_csv(tmp_path / "table.csv", ("name", "value"), [("row", value)])
    text = "" if value is None else str(value)
    assert (tmp_path / "table.csv").read_bytes() == f"name,value\nrow,{text}\n".encode()


def test_a_file_is_not_written_through_a_link_that_somebody_has_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the file that the link leads to; the name is drawn, and only a test knows it before."""
    monkeypatch.setattr(secrets, "token_hex", lambda _: "known")
    (tmp_path / "theirs").write_text("theirs")
    (tmp_path / ".mine.yaml.known").symlink_to(tmp_path / "theirs")
    with (
        pytest.raises(OSError, match="cannot be written: File exists"),
        replacing(tmp_path / "mine.yaml", ".yaml") as part,
    ):
        part.write_text("mine")
    assert (tmp_path / "theirs").read_text() == "theirs"


def write(place: Path, text: str, error: type[BaseException] | None = None) -> None:
    with publish(place, ["a.txt"]) as new:
        (new / "a.txt").write_text(text)
        if error:
            raise error


def test_a_folder_appears_when_it_is_complete_and_replaces_one_of_its_kind(tmp_path: Path) -> None:
    place = tmp_path / "deep" / "out"
    for text in ("first", "second"):
        write(place, text)
        assert (place / "a.txt").read_text() == text
    with pytest.raises(KeyboardInterrupt):
        write(place, "half", KeyboardInterrupt)
    (place / "b.txt").write_text("mine")
    with pytest.raises(FileExistsError, match=r"holds 'b\.txt', which is not of this command"):
        write(place, "third")
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a.txt", "b.txt", "deep", "out"]
    assert (place / "a.txt").read_text() == "second"


def test_a_folder_that_cannot_be_moved_to_its_place_leaves_the_one_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: what was there, as if the disk had failed between the two moves."""
    new, place, old = (tmp_path / name for name in ("new", "place", "old"))
    for folder in (new, place):
        folder.mkdir()
        (folder / "which").write_text(folder.name, encoding="utf-8")
    rename = Path.rename

    def failing(path: Path, target: Path) -> Path:
        if path == new:
            raise OSError("no more room")
        return rename(path, target)

    monkeypatch.setattr(Path, "rename", failing)
    with pytest.raises(OSError, match="no more room"):
        put(new, place, old)
    assert [(place / "which").read_text(encoding="utf-8"), old.exists()] == ["place", False]
    monkeypatch.undo()
    put(new, place, old)
    assert [(one / "which").read_text(encoding="utf-8") for one in (place, old)] == ["new", "place"]


def test_a_full_disk_is_told_with_the_file_that_was_not_written(tmp_path: Path) -> None:
    """Oracle: the message, and the file as it was; Python names no file where writing fails."""
    (tmp_path / "mine.yaml").write_text("before")
    full = pytest.raises(OSError, match=r"mine\.yaml was not written: No space left on device")
    with full, replacing(tmp_path / "mine.yaml", ".yaml"):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("mine.yaml", "before")]
