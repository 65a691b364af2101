"""What a person sees: progress that goes away, lines that fit, colors that are not needed."""

from __future__ import annotations

import io
import os
import re
import sys
import threading

import pytest

from seqopt._cli import watcher
from seqopt._cli.terminal import complain, show_text
from seqopt._cli.watcher import Watcher
from seqopt.work.progress import Stage

posix = pytest.mark.skipif(os.name != "posix", reason="terminals are POSIX's")


class Screen(io.StringIO):
    """A stream that says that it is a terminal."""

    def isatty(self):
        return True


def on_screen(monkeypatch):
    """A terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")
    stream = Screen()
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr(sys, "stdout", stream)
    return stream


@pytest.fixture
def patient(monkeypatch):
    """A watcher that shows at once what it was told, and often."""
    monkeypatch.setattr(watcher, "PATIENCE", 0.0)
    monkeypatch.setattr(watcher, "TICK", 0.01)


def left_on(text):
    """The line that a terminal shows in the end."""
    line = ""
    for part in re.split(r"(\r|\033\[K)", text):
        if part == "\r":
            at = 0
        elif part == "\033[K":
            line = line[:at]
        else:
            line = line[: at if line else 0] + part + line[len(part) :]
    return line.strip()


def test_a_stage_shows_share_and_time_left_and_fits_the_terminal(monkeypatch):
    on_screen(monkeypatch)
    tell = Watcher()
    tell(Stage("responses", 0.25, 12.0))
    assert tell.line() == "responses … 25 %, 12 s left"
    tell("writing the plan")
    assert tell.line() == "writing the plan … 0 s so far"
    tell("b" * 300 + "\033[2J")
    assert len(tell.line()) <= 80
    tell("b\033[2J")
    assert "\033" not in tell.line()


def test_the_time_left_of_a_stage_is_that_of_its_own_work(monkeypatch):
    on_screen(monkeypatch)
    now = [100.0]
    monkeypatch.setattr(watcher.time, "perf_counter", lambda: now[0])
    tell = Watcher()
    for now[0], told, said in (
        (110.0, Stage("steps", 0.0), "10 s so far"),
        (120.0, "between", "20 s so far"),
        (120.0, Stage("steps", 0.25), "25 %, 30 s left"),
        (121.0, Stage("steps", 0.1), "21 s so far"),  # it begins anew
        (122.0, Stage("steps", 0.5), "50 %, 1 s left"),
    ):
        tell(told)
        assert said in tell.line()


class Seen(Screen):
    """A terminal, and a mark of when something was shown on it."""

    def __init__(self):
        super().__init__()
        self.shown = threading.Event()

    def write(self, text):
        if "responses" in text:
            self.shown.set()
        return super().write(text)


class Cell(Seen):
    """Standard error as a notebook has it."""

    pub_thread = None

    def isatty(self):
        return False


@pytest.mark.parametrize("kind", [Seen, Cell])
def test_it_is_shown_now_and_then_and_goes_away_also_with_an_error(patient, monkeypatch, kind):
    monkeypatch.setattr(sys, "stderr", stream := kind())

    def fail():
        with Watcher() as tell:
            for share in range(2000):
                tell(Stage("responses", share / 2000, 12.0))
            assert stream.shown.wait(60)
            raise ValueError("spoilt")

    with pytest.raises(ValueError, match="spoilt"):
        fail()
    assert 0 < stream.getvalue().count("responses") < 1000  # not for each of what it was told
    assert left_on(stream.getvalue()) == ""


def test_long_lines_are_wrapped_for_people_only(monkeypatch):
    screen = on_screen(monkeypatch)
    complain("seqopt: error: " + "word " * 40)
    complain("engine: " + "word " * 40)
    show_text("word " * 40)
    seen = re.sub(r"\033\[[0-9;]*[mK]", "", screen.getvalue())
    assert max(map(len, seen.splitlines())) <= 80
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    complain("seqopt: error: " + "word " * 40)
    assert sys.stderr.getvalue().count("\n") == 1
