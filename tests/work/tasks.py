"""What workers do in tests: in a module of its own, which they load in no time."""

import os
import signal
import sys
import threading
import time

import numpy as np

from seqopt.errors import SolverError


def square(number):
    time.sleep(0.01 * (number % 3))  # later ones may be ready first
    return number * number


def square_or_fail(number):
    if number in (3, 5):
        time.sleep(0.1 * (number == 3))  # the later error comes first
        raise SolverError(f"no square of {number}")
    return number * number


def die_once(folder, number):
    """End the process as the system does where memory is short, the first time."""
    mark = folder / f"died at {number}"
    if number in (2, 7) and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


class Fatal(np.ndarray):
    """An answer that ends its process while it is sent."""

    def __reduce__(self):
        sender = threading.get_ident()
        threading.Thread(target=end_while_sending, args=(sender,), daemon=True).start()
        return self.view(np.ndarray).__reduce__()


def end_while_sending(sender):
    """End the process as soon as a thread writes to a pipe."""
    while sys._current_frames()[sender].f_code.co_name != "_send":
        time.sleep(0.001)
    os.kill(os.getpid(), signal.SIGKILL)


def die_while_sending(folder, number):
    """End the process the first time, amid an answer of 16 MB, for which a pipe has no room."""
    mark = folder / f"died at {number}"
    answer = np.full(2_000_000, float(number))
    if number == 1 and not mark.exists():
        mark.touch()
        return answer.view(Fatal)
    return answer


def own_error(number):
    class OddError(Exception):
        """One that cannot be sent."""

    raise OddError(number)
