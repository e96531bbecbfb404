"""Files and folders that appear only when they are complete, and that one process writes at a time."""

from __future__ import annotations

import csv
import errno
import os
import secrets
import shutil
import stat
import sys
import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from sledenv.machine.extras import needs

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl


@contextmanager
def replacing(file: str | os.PathLike[str], *suffixes: str) -> Iterator[Path]:
    """Give an empty file to write, and move it to its place when the block has ended without an error.

    Whatever ends the block early, an interrupt included, leaves nothing behind and ``file`` as it was.

    Parameters
    ----------
    file : str or path
        Its place, in a folder that exists. It is replaced if it exists.
    suffixes : str
        How its name may end.

    Raises
    ------
    OSError
        If the place has another suffix, or cannot be written.
    """
    place = Path(file)
    if place.suffix.lower() not in suffixes:
        raise OSError(f"{place}: must end in {' or '.join(suffixes)}")
    if place.is_dir():
        raise OSError(f"{place} is a folder: name a file in it")
    if not place.parent.is_dir():
        raise OSError(f"{place} cannot be written: there is no folder {place.parent}")
    scratch = place.with_name(f".{place.name}.{secrets.token_hex(6)}")
    try:
        scratch.touch(exist_ok=False)  # a link that somebody has left there is not followed
    except OSError as error:
        raise OSError(f"{place} cannot be written: {error.strerror}") from error
    try:
        yield scratch
        scratch.replace(place)
    except OSError as error:
        if error.filename is not None or error.errno is None:
            raise
        raise OSError(f"{place} was not written: {error.strerror}") from error  # Python names no file on a full disk
    finally:
        scratch.unlink(missing_ok=True)


@contextmanager
def publish(folder: str | Path, files: Collection[str]) -> Iterator[Path]:
    """Give an empty folder to write into, and move it to its place when the block has ended without an error.

    Whatever ends the block early, an interrupt included, leaves nothing behind and ``folder`` as it was.

    Parameters
    ----------
    folder : str or path
        Its place. It is replaced if it exists.
    files : collection of str
        What the block writes; a folder that holds anything else is not replaced.

    Raises
    ------
    OSError
        If the place is taken or cannot be written.
    """
    place = Path(folder).resolve()
    check_free(place, folder, files)
    home = next(parent for parent in place.parents if parent.exists())
    try:
        scratch = Path(tempfile.mkdtemp(prefix=f".{place.name}-", dir=home))
    except OSError as error:
        raise OSError(f"{folder} cannot be written: {error.strerror}") from error
    try:
        new, old = scratch / "new", scratch / "old"
        new.mkdir()
        yield new
        check_free(place, folder, files)
        place.parent.mkdir(parents=True, exist_ok=True)
        put(new, place, old)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)


def put(new: Path, place: Path, old: Path) -> None:
    """Move a folder to its place, and what has been there to ``old``; if that fails it is where it was."""
    if place.exists():
        place.rename(old)
    try:
        new.rename(place)
    except BaseException:
        if old.exists():
            old.rename(place)
        raise


@contextmanager
def alone(file: Path, *, wait: bool = True) -> Iterator[None]:
    """Hold the lock of a file, which is made if it is not there. It ends with the process, however that ends.

    Raises
    ------
    BlockingIOError
        If another process holds it and this one is not to wait.
    """
    with file.open("ab") as held:
        try:
            _lock(held, True, wait)
        except BlockingIOError:
            message = f"{file.parent}: another process writes there: wait until it has ended or choose another folder"
            raise BlockingIOError(message) from None
        try:
            yield
        finally:
            _lock(held, False, wait)  # a process that has been forked meanwhile would hold it on


if sys.platform == "win32":

    def _lock(file: IO[bytes], on: bool, wait: bool) -> None:
        while True:
            try:
                kind = msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK
                return msvcrt.locking(file.fileno(), kind if on else msvcrt.LK_UNLCK, 1)
            except OSError as error:
                if not wait and error.errno == errno.EACCES:
                    raise BlockingIOError from error
                if error.errno != errno.EDEADLOCK:  # which says that it has tried for ten seconds
                    return

else:

    def _lock(file: IO[bytes], on: bool, wait: bool) -> None:
        try:
            fcntl.flock(file, (fcntl.LOCK_EX if on else fcntl.LOCK_UN) | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            raise
        except OSError:  # some file systems have no locks
            pass


def check_regular(file: Path, most: int) -> None:
    """Check that a file ends: that it is neither a device nor a pipe nor a folder, and has at most so many bytes.

    Raises
    ------
    OSError, ValueError
        If it is not there or does not; the message does not name it.
    """
    found = file.stat()
    if not stat.S_ISREG(found.st_mode):
        raise OSError("must be a regular file, no folder, device or pipe")
    if found.st_size > most:
        raise ValueError(f"has {found.st_size} bytes: must have at most {most}")


def read_text(file: Path, most: int) -> str:
    """Return the text of a file in UTF-8 of at most so many bytes, without a byte order mark.

    Raises
    ------
    OSError, ValueError
        As :func:`check_regular`, or if it is no such text.
    """
    check_regular(file, most)
    with file.open("rb") as opened:
        content = opened.read(most + 1)  # a file of /proc has any number of bytes, and says 0
    if len(content) > most:
        raise ValueError(f"must have at most {most} bytes")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        raise ValueError(f"must be text in UTF-8, but byte {problem.start + 1} is not") from problem


def write_csv(file: Path, header: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table as comma-separated values; a float has all its digits, and text is :func:`no_formula`."""
    with file.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.writer(lines, lineterminator="\n")
        writer.writerow(map(no_formula, header))
        writer.writerows(map(no_formula, row) for row in rows)


def no_formula(cell: object) -> object:
    """Return a cell of a table; text that a spreadsheet would run as a formula has an apostrophe before it."""
    if isinstance(cell, str) and cell.lstrip().startswith(("=", "+", "-", "@")) and cell != "-":
        try:
            float(cell)
        except ValueError:
            return f"'{cell}"
    return cell


def write_table(file: Path, columns: Mapping[str, Sequence[object]], *, parquet: bool) -> None:
    """Write the columns of a table by their names, as comma-separated values or as a Parquet file.

    Raises
    ------
    ImportError
        Naming what Parquet needs.
    """
    if not parquet:
        return write_csv(file, list(columns), zip(*columns.values(), strict=True))
    with needs("analysis", "a Parquet file"):
        import pyarrow
        from pyarrow.parquet import write_table as write
    write(pyarrow.table(dict(columns)), file)


def check_free(place: Path, folder: str | Path, files: Collection[str]) -> None:
    """Raise an OSError unless a folder is not there yet or holds nothing but ``files``; messages call it ``folder``."""
    check_folder(folder)
    if not place.exists():
        return
    if place == Path.cwd():
        raise FileExistsError(f"{folder} is the current folder: choose another one")
    foreign = sorted(entry.name for entry in place.iterdir() if entry.name not in files)
    if foreign:
        raise FileExistsError(f"{folder} holds {foreign[0]!r}, which is not of this command: choose another folder")


def check_folder(folder: str | Path) -> None:
    """Raise an OSError where there is something that is no folder, or above it."""
    place = Path(folder).resolve()
    home = next(one for one in (place, *place.parents) if one.exists())
    if not home.is_dir():
        why = "is a file: choose another folder" if home == place else f"cannot be written: {home} is a file"
        raise NotADirectoryError(f"{folder} {why}")
