"""One kernel executes all pages, and forgets between them what they have defined.

A kernel of its own for every page would start Python and load the same libraries a dozen times.
"""

from __future__ import annotations

from typing import Any

import nbformat
from jupyter_cache.executors.utils import ExecutionResult, single_nb_execution
from jupyter_client import AsyncKernelManager
from jupyter_core.utils import run_sync
from myst_nb.core.execute import direct
from sphinx.application import Sphinx

KERNEL = AsyncKernelManager()
FORGET = """%reset -f
__import__("os").chdir({folder!r})
__import__("matplotlib").rcdefaults()
"""


def executed(page: nbformat.NotebookNode, cwd: str, **how: Any) -> ExecutionResult:
    """Execute a page in its folder by the kernel that all share."""
    forget = nbformat.v4.new_code_cell(FORGET.format(folder=cwd))
    before = nbformat.v4.new_notebook(cells=[forget])
    for notebook in (before, page):
        result = single_nb_execution(notebook, cwd=cwd, km=KERNEL, **how)
        if result.err is not None:
            break
    return result


def _end(*_: object) -> None:
    if KERNEL.has_kernel:
        run_sync(KERNEL.shutdown_kernel)(now=True)


def setup(app: Sphinx) -> dict[str, bool]:
    """Let pages be executed so; the kernel ends with the build."""
    direct.single_nb_execution = executed
    app.connect("build-finished", _end)
    return {"parallel_read_safe": False}
