"""Files that commands write: whole, never in the place of something that is no file."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest
from patience import PATIENCE_S

from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.shared.write_files import write_whole


def test_a_file_is_replaced_and_nothing_is_left_next_to_it(tmp_path: Path):
    path = tmp_path / "a.fsnplan"
    for data in (b"first", b"second"):
        write_whole(str(path), data, overwrite=True)
        assert path.read_bytes() == data
    assert os.listdir(tmp_path) == ["a.fsnplan"]


def test_a_link_stays_a_link(tmp_path: Path):
    (tmp_path / "data").mkdir()
    path = tmp_path / "data" / "a.fsnplan"
    link = tmp_path / "link"
    link.symlink_to(path)
    write_whole(str(link), b"new", overwrite=True)
    assert link.is_symlink()
    assert path.read_bytes() == b"new"


def test_a_device_file_is_written_to_and_not_replaced(tmp_path: Path):
    # as /dev/null, which root could replace
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got: list[bytes] = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()), daemon=True)
    reader.start()
    write_whole(str(pipe), b"plan", overwrite=False)
    assert pipe.is_fifo()
    reader.join(PATIENCE_S)
    assert got == [b"plan"]


@pytest.mark.parametrize("name", ["folder", "file/a", "missing/a"])
def test_unwritable_parts_are_named(tmp_path: Path, name: str):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").touch()
    path = tmp_path / name
    with pytest.raises(EnvironmentFault, match=f"cannot write .*{name}: "):
        write_whole(str(path), b"plan", overwrite=True)
    assert sorted(os.listdir(tmp_path)) == ["file", "folder"]
