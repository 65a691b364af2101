"""What a person sees: progress that goes away, lines that fit, colors that are not needed."""

from __future__ import annotations

import io
import os
import re
import sys
import threading

import pytest

from seqopt._cli import watcher
from seqopt._cli.terminal import columns, complain, show_text, wrapped
from seqopt._cli.watcher import Watcher
from seqopt.work.progress import Stage, with_progress, within

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
    """A watcher that shows what it is told at once, and has no clock of its own."""
    monkeypatch.setattr(watcher, "PATIENCE", 0.0)
    monkeypatch.setattr(watcher, "TICK", 60.0)


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


def test_a_stage_shows_share_and_time_left_and_goes_away(patient, monkeypatch):
    screen = on_screen(monkeypatch)
    with Watcher() as tell:
        tell(Stage("responses", 0.25, 12.0))
        shown = screen.getvalue()
        assert re.search(r"responses:  25 % \|.{20}\| about 12 s left", shown)
        tell("writing the plan")
        assert "writing the plan … 0 s so far" in screen.getvalue()
    assert left_on(screen.getvalue()) == ""
    assert left_on(shown) != ""


def test_it_fits_the_terminal_whatever_it_is_told(patient, monkeypatch):
    screen = on_screen(monkeypatch)
    with Watcher() as tell:
        tell(Stage("a" * 300, 0.5, 7200.0))
        tell("b" * 300 + "\033[2J")
    lines = re.split(r"[\r\n]", screen.getvalue())
    assert max(len(line) for line in lines) <= 80
    assert "\033[2J" not in screen.getvalue()


def test_nothing_is_shown_in_the_first_second_nor_where_nobody_looks(monkeypatch):
    screen = on_screen(monkeypatch)
    with Watcher() as tell:
        tell(Stage("responses", 0.25, 12.0))
    assert screen.getvalue() == ""
    monkeypatch.setattr(watcher, "PATIENCE", 0.0)
    with Watcher(shows=False) as tell:
        tell(Stage("responses", 0.25, 12.0))
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    with Watcher() as tell:
        tell(Stage("responses", 0.25, 12.0))
    assert sys.stderr.getvalue() == screen.getvalue() == ""


def test_an_error_clears_what_is_shown(patient, monkeypatch):
    screen = on_screen(monkeypatch)

    def fail():
        with Watcher() as tell:
            tell(Stage("responses", 0.25, 12.0))
            raise ValueError("spoilt")

    with pytest.raises(ValueError, match="spoilt"):
        fail()
    assert left_on(screen.getvalue()) == ""


def test_the_time_left_of_a_stage_is_that_of_its_own_work(patient, monkeypatch):
    screen = on_screen(monkeypatch)
    now = [100.0]
    monkeypatch.setattr(watcher.time, "perf_counter", lambda: now[0])
    with Watcher() as tell:
        now[0] = 110.0
        tell(Stage("steps", 0.0))
        now[0] = 120.0
        tell("between")
        tell(Stage("steps", 0.25))
        assert "about 30 s left" in screen.getvalue()
        now[0] = 121.0
        tell(Stage("steps", 0.1))  # it begins anew
        now[0] = 122.0
        tell(Stage("steps", 0.5))
        assert "about 1 s left" in screen.getvalue()


def test_items_and_times_are_told_as_stages():
    said = []
    assert [*with_progress("steps", "ab", said.append)] == ["a", "b"]
    assert [(stage.what, stage.share) for stage in said] == [("steps", 0.0), ("steps", 0.5)]
    assert [*with_progress("steps", "ab", None)] == ["a", "b"]
    within(said.append, float("inf"))("words")
    assert said[-1] == "words"
    within(said.append, 60.0)("words")
    assert (said[-1].what, said[-1].left) == ("words", pytest.approx(60.0, abs=1.0))


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


@pytest.mark.parametrize(("width", "found"), [("80", 80), ("20", 40), ("300", 100)])
def test_columns_are_those_of_the_terminal_within_reason(monkeypatch, width, found):
    monkeypatch.setenv("COLUMNS", width)
    assert columns() == found
    lines = wrapped("word " * 100, first="- ").splitlines()
    assert max(map(len, lines)) <= found
    assert all(line.startswith("  ") for line in lines[1:])


class Cell(io.StringIO):
    """Standard error as a notebook has it, and a mark of when something was shown."""

    pub_thread = None

    def __init__(self):
        super().__init__()
        self.shown = threading.Event()

    def write(self, text):
        if "responses" in text:
            self.shown.set()
        return super().write(text)


def test_a_notebook_is_told_now_and_then(monkeypatch):
    monkeypatch.setattr(watcher, "PATIENCE", 0.0)
    monkeypatch.setattr(watcher, "TICK", 0.05)
    stream = Cell()
    monkeypatch.setattr(sys, "stderr", stream)
    with Watcher() as tell:
        for share in range(2000):
            tell(Stage("responses", share / 2000, 12.0))
        assert stream.shown.wait(60)
    assert stream.getvalue().count("responses:") < 1000  # not for each of what it was told
    assert left_on(stream.getvalue()) == ""
