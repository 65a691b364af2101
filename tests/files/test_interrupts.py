"""Interrupts are answered by calls, and raised by limits of time."""

from __future__ import annotations

import signal
import time

import pytest

from seqopt.work.progress import answered, ending


def test_a_first_interrupt_is_a_call_and_a_second_one_ends():
    calls = []

    def work():
        with answered(lambda: calls.append(1)):
            signal.raise_signal(signal.SIGINT)
            calls.append(2)
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        work()
    assert calls == [1, 2]
    with answered(lambda: calls.append(3)):
        pass
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_signals_that_others_answer_are_left_to_them():
    came = []
    before = signal.signal(signal.SIGINT, lambda *_: came.append("theirs"))
    try:
        with answered(lambda: came.append("ours")):
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert came == ["theirs"]


def wait():
    while True:
        time.sleep(0.001)


def test_what_takes_too_long_ends():
    with pytest.raises(TimeoutError), ending(0.01):
        wait()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_what_takes_too_long_ends_where_interrupts_are_ignored():
    """As in a background job: an end comes, an interrupt does not."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with ending(100.0):
            signal.raise_signal(signal.SIGINT)
        with pytest.raises(TimeoutError), ending(0.01):
            wait()
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.mark.parametrize("seconds", [1e300, float("inf")])
def test_an_end_leaves_what_is_in_time_and_interrupts_of_others(seconds):
    with ending(seconds):
        pass
    with pytest.raises(KeyboardInterrupt), ending(seconds):
        signal.raise_signal(signal.SIGINT)
