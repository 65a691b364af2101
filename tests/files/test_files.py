"""Files: written whole or not at all, read only if they end; what calls do with interrupts."""

import os
import signal
import stat
import threading
import time
from pathlib import Path

import pytest

from seqopt import _files as files
from seqopt._files import read_text, write_file
from seqopt.errors import FileError
from seqopt.exchange._files import require_apart, require_folder, write_folder
from seqopt.work import _answered, _ending

posix = pytest.mark.skipif(os.name != "posix", reason="links, modes and pipes are POSIX's")


def names(folder):
    """Everything in a folder, hidden files too."""
    return sorted(path.name for path in folder.rglob("*"))


@posix
def test_a_device_stays_a_device(tmp_path):
    """`--out /dev/null` replaced it, as root, by a file."""
    for path in (Path("/dev/null"), tmp_path / "null"):
        if path.parent == tmp_path:
            path.symlink_to("/dev/null")
        with pytest.raises(FileError, match="null: it is a device or pipe; name a regular file"):
            write_file(path, "x")
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileError, match="device or pipe"):
        write_file(tmp_path / "pipe", "x")
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


@pytest.mark.parametrize("length", [246, 255])
def test_a_long_name_is_a_name(tmp_path, length):
    path = tmp_path / ("x" * length)
    write_file(path, "text")
    assert read_text(path) == "text"
    with pytest.raises(FileError, match="too long"):
        write_file(tmp_path / ("x" * 256), "text")


@posix
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_what_does_not_end_is_not_read(tmp_path, kind):
    path = {"pipe": tmp_path / "pipe", "device": Path("/dev/zero"), "folder": tmp_path}[kind]
    if kind == "pipe":
        os.mkfifo(path)
    found = []

    def read():
        with pytest.raises(FileError, match="not a regular file"):
            read_text(path)
        found.append(kind)

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    thread.join(5)
    assert found == [kind]


def test_a_file_that_is_too_large_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "_LARGEST_INPUT", 10)
    path = tmp_path / "large"
    path.write_text("x" * 11, encoding="utf-8")
    with pytest.raises(FileError, match="more than 1e-05 MB; name a smaller one"):
        read_text(path)
    path.write_text("x" * 10, encoding="utf-8")
    assert read_text(path) == "x" * 10


def test_what_is_no_text_is_refused(tmp_path):
    (tmp_path / "bytes").write_bytes(b"\xff")
    with pytest.raises(FileError, match="not UTF-8 text"):
        read_text(tmp_path / "bytes")
    with pytest.raises(FileError, match="half a character"):
        write_file(tmp_path / "half", "\ud800")
    with pytest.raises(FileError, match="null"):
        read_text(tmp_path / "a\0b")
    assert names(tmp_path) == ["bytes"]


def test_outputs_and_inputs_are_apart(tmp_path):
    first, second = tmp_path / "a", tmp_path / "b"
    require_apart([first, second])
    with pytest.raises(FileError, match="a: two outputs go there"):
        require_apart([first, tmp_path / "." / "a"])
    with pytest.raises(FileError, match="a: it is the input"):
        require_apart([first], [first])
    first.touch()
    second.symlink_to(first)
    with pytest.raises(FileError, match="b: two outputs go there"):
        require_apart([first, second])


FILES = {"one": "1", "two": b"2", "three": "3"}


def broken_at(monkeypatch, count):
    """Let writing fail after some files."""
    stage = files._stage
    staged = []

    def fails(path, content):
        if len(staged) == count:
            raise OSError(28, "No space left on device")
        staged.append(path)
        return stage(path, content)

    monkeypatch.setattr(files, "_stage", fails)


@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize("count", [0, 1, 2])
def test_a_folder_appears_whole_or_not_at_all(tmp_path, monkeypatch, there, count):
    folder = tmp_path / "new" / "out"
    before = {"one": "old"}
    if there:
        write_folder(folder, before)
    broken_at(monkeypatch, count)
    with pytest.raises(FileError, match="No space left on device"):
        write_folder(folder, FILES)
    assert names(tmp_path) == (["new", "one", "out"] if there else ["new"])
    monkeypatch.undo()
    write_folder(folder, FILES)
    assert names(folder) == sorted(FILES)
    assert (folder / "one").read_text(encoding="utf-8") == "1"
    assert names(tmp_path) == sorted(["new", "out", *FILES])


def test_a_folder_that_cannot_be_is_refused_early(tmp_path):
    (tmp_path / "file").touch()
    require_folder(tmp_path / "new" / "out")
    with pytest.raises(FileError, match="file is not a folder"):
        require_folder(tmp_path / "file" / "out")
    assert names(tmp_path) == ["file"]


# interrupts are answered by calls, and raised by limits of time
def test_a_first_interrupt_is_a_call_and_a_second_one_ends():
    calls = []

    def work():
        with _answered(lambda: calls.append(1)):
            signal.raise_signal(signal.SIGINT)
            calls.append(2)
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert calls == [1, 2]
    with _answered(lambda: calls.append(3)):
        pass
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_signals_that_others_answer_are_left_to_them():
    came = []
    before = signal.signal(signal.SIGINT, lambda *_: came.append("theirs"))
    try:
        with _answered(lambda: came.append("ours")):
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert came == ["theirs"]


def wait():
    while True:
        time.sleep(0.001)


def test_what_takes_too_long_ends():
    with pytest.raises(TimeoutError), _ending(0.01):
        wait()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_what_takes_too_long_ends_where_interrupts_are_ignored():
    """As in a background job: an end comes, an interrupt does not."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with _ending(100.0):
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(TimeoutError), _ending(0.01):
            wait()
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.parametrize("seconds", [1e300, float("inf")])
def test_an_end_leaves_what_is_in_time_and_interrupts_of_others(seconds):
    with _ending(seconds):
        pass
    with pytest.raises(KeyboardInterrupt), _ending(seconds):
        signal.raise_signal(signal.SIGINT)
