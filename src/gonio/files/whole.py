"""A file is written whole or not at all.

    with writing("vase.exr") as temporary:
        codec.save(temporary)

The block writes a temporary file beside the target; it takes the target's name when the block has ended well and is
removed otherwise (also by Ctrl-C), so that nobody ever reads half a file and a failure leaves the old one standing.
Not here: folders, and safety against power cuts (nothing is flushed to the disc).
"""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from ..errors import FileError


@contextlib.contextmanager
def writing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yields the path of an empty file beside `path`, with the same suffix, that becomes `path` when the block ends.

    An existing file is replaced and its permissions are kept; a symbolic link is followed. Raises `FileError` where
    `path` is a folder or a device, its folder does not exist, or the system refuses to write there.
    """
    target = writable(path)
    temporary = target.with_name(f".gonio-{secrets.token_hex(8)}{target.suffix}")
    try:
        # Not tempfile: its files are readable by the owner only, and would stay so under the final name.
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
        if target.exists():
            temporary.chmod(target.stat().st_mode)
        yield temporary
        temporary.replace(target)
    except OSError as error:
        if error.filename not in (None, str(temporary), temporary):
            raise  # the block failed at another file, and its message names that one
        raise FileError(f"{path} cannot be written: {error.strerror or error}.") from error
    finally:
        temporary.unlink(missing_ok=True)


def writable(path: str | os.PathLike[str], suffix: str = "") -> Path:
    """The file that writing to `path` would make or replace, links followed. Raises `FileError` as `writing` does, and
    where the name has another suffix than the one that is asked for."""
    if suffix and Path(path).suffix.lower() != suffix:
        raise FileError(f"{path}: end its name in {suffix}.")
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise FileError(f"{path} is a folder. Give the name of a file to write.")
    if not target.parent.is_dir():
        raise FileError(f"{path}: the folder {target.parent} does not exist. Make it first.")
    if target.exists() and not target.is_file():
        raise FileError(f"{path} is not a regular file. Give the name of a file to write.")
    if target.exists() and not os.access(target, os.W_OK):
        raise FileError(f"{path} is write-protected. Change its permissions or give another name.")
    return target
