"""A file is written whole or not at all."""

import os
import stat
import sys

import pytest

from gonio.errors import FileError
from gonio.files.whole import writing

posix = pytest.mark.skipif(sys.platform == "win32", reason="POSIX permissions")


def test_the_target_appears_when_the_block_ends(tmp_path):
    target = tmp_path / "image.exr"
    with writing(target) as temporary:
        temporary.write_bytes(b"whole")
        assert not target.exists()
        assert temporary.parent == target.parent and temporary.suffix == ".exr"
    assert target.read_bytes() == b"whole"
    assert [p.name for p in tmp_path.iterdir()] == ["image.exr"]


@pytest.mark.parametrize("failure", [RuntimeError, KeyboardInterrupt, FileError])
def test_a_failure_keeps_the_old_file_and_leaves_nothing_else(tmp_path, failure):
    target = tmp_path / "image.exr"
    target.write_bytes(b"old")
    with pytest.raises(failure), writing(target) as temporary:
        temporary.write_bytes(b"half")
        raise failure
    assert target.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["image.exr"]


def test_a_block_that_removes_its_file_is_refused(tmp_path):
    with pytest.raises(FileError, match=r"a\.exr cannot be written"), writing(tmp_path / "a.exr") as temporary:
        temporary.unlink()


def test_a_full_disc_is_named_after_the_target(tmp_path):
    with pytest.raises(FileError, match=r"a\.exr cannot be written: No space left"), writing(tmp_path / "a.exr"):
        raise OSError(28, "No space left on device")


def test_an_error_at_another_file_keeps_its_own_name(tmp_path):
    with pytest.raises(FileNotFoundError, match="other"), writing(tmp_path / "a.exr"):
        (tmp_path / "other").read_bytes()


@posix
def test_permissions_are_those_of_any_new_file_or_of_the_file_replaced(tmp_path):
    plain, target = tmp_path / "plain", tmp_path / "target"
    plain.touch()
    with writing(target):
        pass
    assert target.stat().st_mode == plain.stat().st_mode
    target.chmod(0o640)
    with writing(target):
        pass
    assert stat.S_IMODE(target.stat().st_mode) == 0o640


@posix
def test_a_symbolic_link_is_followed(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    link.symlink_to(target)
    with writing(link) as temporary:
        temporary.write_bytes(b"through")
    assert link.is_symlink() and target.read_bytes() == b"through"


def test_folders_and_missing_folders_are_refused(tmp_path):
    with pytest.raises(FileError, match="is a folder"), writing(tmp_path):
        pass
    with pytest.raises(FileError, match=r"does not exist\. Make it first"), writing(tmp_path / "none" / "a.exr"):
        pass


@posix
def test_pipes_and_devices_are_never_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileError, match="not a regular file"), writing(tmp_path / "pipe"):
        pass


@posix
@pytest.mark.skipif(hasattr(os, "geteuid") and os.geteuid() == 0, reason="root may write anywhere")
def test_protected_files_and_folders_are_refused(tmp_path):
    target = tmp_path / "a.exr"
    target.touch()
    target.chmod(0o444)
    with pytest.raises(FileError, match="write-protected"), writing(target):
        pass
    tmp_path.chmod(0o555)
    with pytest.raises(FileError, match="cannot be written: Permission denied"), writing(tmp_path / "b.exr"):
        pass
    tmp_path.chmod(0o755)
