"""Outputs: complete or absent, through links and pipes, without destroying anything; all outputs of all commands."""

import errno
import os
import socket
import stat
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import Captured, Patch
from output_options import OPTIONS, words

from pushplan.cli.main import main
from pushplan.errors import OutputError
from pushplan.util.files import Output, check_output, write_pieces, write_whole


def names(folder: Path) -> list[str]:
    return sorted(found.name for found in folder.iterdir())


def test_nothing_is_written_after_a_failed_write(tmp_path: Path, monkeypatch: Patch) -> None:
    """Later writes must not continue after the gap."""
    file = Output(tmp_path / "a")
    file.write(b"sound")
    write = os.write

    def half(descriptor: int, data: bytes) -> int:
        write(descriptor, bytes(data)[:2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "write", half)
    with pytest.raises(OutputError, match="No space left on device"):
        file.write(b"broken")
    monkeypatch.setattr(os, "write", write)
    with pytest.raises(OutputError, match="No space left on device"):
        file.write(b"more")
    file.close()
    assert file.partial.read_bytes() == b"sound"


def test_a_link_stays_and_its_target_is_written(tmp_path: Path) -> None:
    """Also through two links, and if the target does not exist yet."""
    (tmp_path / "there").mkdir()
    link, over = tmp_path / "link", tmp_path / "over"
    link.symlink_to("there/file")
    over.symlink_to(link)
    for path, data in ((link, b"first"), (over, b"second")):
        write_whole(path, data)
        assert (tmp_path / "there" / "file").read_bytes() == data
        assert link.is_symlink()
        assert over.is_symlink()
    assert names(tmp_path / "there") == ["file"]


def test_a_link_that_leads_nowhere_or_to_itself_is_refused(tmp_path: Path) -> None:
    loop, nowhere = tmp_path / "loop", tmp_path / "nowhere"
    loop.symlink_to(loop)
    nowhere.symlink_to(tmp_path / "no" / "file")
    with pytest.raises(OutputError, match=r"loop: Too many levels of symbolic links"):
        check_output(loop)
    with pytest.raises(OutputError, match=r"nowhere: there is no folder .*no$"):
        check_output(nowhere)


def test_a_pipe_gets_the_bytes_and_stays_a_pipe(tmp_path: Path) -> None:
    pipe, got = tmp_path / "pipe", list[bytes]()
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()))
    reader.start()
    for _ in range(1000):  # the reader counts once it blocks in its call
        try:
            write_pieces(pipe, [b"x" * 100_000, b"y"])
            break
        except OutputError:
            threading.Event().wait(0.01)
    reader.join(10.0)
    assert got == [b"x" * 100_000 + b"y"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    assert names(tmp_path) == ["pipe"]


def test_a_pipe_without_a_reader_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OutputError, match="this pipe has no reader; start the reader first"):
        write_whole(tmp_path / "pipe", b"")


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(os.path.relpath(path))  # the names of sockets must be short


@pytest.mark.parametrize(
    ("make", "expected"), [(Path.mkdir, "this is a folder; name a file in it"), (_socket, "this is a socket")]
)
def test_unwritable_targets_are_refused_also_behind_a_link(
    make: Callable[[Path], None], expected: str, tmp_path: Path, monkeypatch: Patch
) -> None:
    monkeypatch.chdir(tmp_path)
    thing, link = tmp_path / "thing", tmp_path / "link"
    make(thing)
    link.symlink_to(thing)
    before = os.lstat(thing).st_ino
    for path in (thing, link):
        with pytest.raises(OutputError, match=expected):
            write_whole(path, b"data")
    assert os.lstat(thing).st_ino == before
    assert names(tmp_path) == ["link", "thing"]


def test_the_file_of_standard_output_is_not_replaced(tmp_path: Path) -> None:
    path, saved = tmp_path / "out.txt", os.dup(1)
    try:
        with path.open("w") as file:
            os.dup2(file.fileno(), 1)
        for name in (path, Path("/dev/stdout")):
            with pytest.raises(OutputError, match="the command's own output goes to this file"):
                check_output(name)
    finally:
        os.dup2(saved, 1)
        os.close(saved)


def test_a_new_file_replaces_nothing_not_even_a_link_to_nowhere(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("nowhere")
    (tmp_path / "file").write_bytes(b"precious")
    for name in ("link", "file"):
        with pytest.raises(OutputError, match="this file exists already"):
            write_whole(tmp_path / name, b"data", new=True)
    file = Output(tmp_path / "late", new=True)
    (tmp_path / "late").write_bytes(b"precious")
    with pytest.raises(OutputError, match="File exists"):
        file.publish()
    file.discard()
    write_whole(tmp_path / "new", b"data", new=True)
    assert names(tmp_path) == ["file", "late", "link", "new"]
    assert (tmp_path / "late").read_bytes() == b"precious"


def test_one_process_at_a_time_writes_a_file(tmp_path: Path) -> None:
    file = Output(tmp_path / "a")
    with pytest.raises(OutputError, match="another process is writing it"):
        Output(tmp_path / "a")
    file.discard()
    assert names(tmp_path) == []


EVERY = pytest.mark.parametrize(("command", "option", "suffix"), OPTIONS)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    assert main(["plan", "one-box", "--first", "-o", str(path)]) == 0
    return path


@pytest.fixture(autouse=True)
def _short_films(monkeypatch: Patch) -> None:
    monkeypatch.setattr("pushplan.logging.film.PICTURES_PER_SECOND", 1)


@EVERY
@pytest.mark.parametrize("full", [False, True])
def test_a_folder_or_a_full_disk_ends_in_a_clear_error_and_leaves_nothing(
    full: bool,
    command: str,
    option: str,
    suffix: str,
    log: Path,
    tmp_path: Path,
    monkeypatch: Patch,
    capsys: Captured,
) -> None:
    """For every command: a folder is refused before the work, and an incomplete file is not published."""
    pytest.importorskip({"mp4": "av", "ros2": "rosbags"}.get(option, "json"))
    path, write = tmp_path / f"there{suffix}", os.write
    if not full:
        path.mkdir()

    def refuse(descriptor: int, data: bytes) -> int:
        if os.readlink(f"/proc/self/fd/{descriptor}").startswith(str(tmp_path)):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(descriptor, data)

    monkeypatch.setattr(os, "write", refuse if full else write)
    assert main(words(command, option, path, log)) == 2
    out, error = capsys.readouterr()
    assert ("No space left on device" if full else "this is a folder") in error or "exists already" in error
    assert full or "solved" not in out
    assert os.listdir(tmp_path) == ([] if full else [path.name])
    assert full or not os.listdir(path)
