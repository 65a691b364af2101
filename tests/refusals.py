"""What is wrong is refused in one line."""

from contextlib import contextmanager

import pytest


@contextmanager
def one_line(error, said=None):
    """What is raised says so, in one line."""
    with pytest.raises(error, match=said) as caught:
        yield caught
    assert "\n" not in str(caught.value)
