"""Every page that is executed can be downloaded, as a notebook and as a script.

Both are made from the page when the site is built. Checks that the page makes of itself are left
out, cells that need more than an installation (tag ``site-only``) too; links become words, and a
line says what to install.
"""

from __future__ import annotations

import ast
import copy
import re
from pathlib import Path

import jupytext
import nbformat
from myst_nb.core.read import is_myst_markdown_notebook, read_myst_markdown_notebook
from sphinx.application import Sphinx

FOLDER = "_downloads"
EXTRAS = "plot"  # where a page does not say
DISPLAY = """
from itertools import count

number = count(1)


def display(value):
    \"\"\"Print a value; write a figure to a file of its own.\"\"\"
    if hasattr(value, "savefig"):
        name = f"figure{next(number)}.png"
        value.savefig(name, dpi=150)
        print("written to", name)
    elif value is not None:
        print(value)
"""
_LINK = re.compile(r"\[([^\]]+)\]\((?!https?:)[^)]+\)")
_PICTURE = re.compile(r"!\[([^\]]*)\]\([^)]+\)")
_ROLE = re.compile(r"\{[a-z:-]+\}`([^`<]+?)(?:\s*<[^`>]*>)?`")


def notebook(text: str, stated: dict[str, str]) -> nbformat.NotebookNode:
    """Return a page of MyST as a notebook that needs nothing of the site.

    Parameters
    ----------
    text
        The page's source.
    stated
        What stands for ``{{ name }}`` in it.
    """
    page = read_myst_markdown_notebook(text)
    extras = page.metadata.get("extras", EXTRAS)
    cells = [_plain(cell, stated) for cell in page.cells if not _is_check(cell)]
    needs = f'It needs seqopt with extras: in the folder of seqopt, `pip install ".[{extras}]"`.'
    opening, mark, rest = cells[0].source.partition("\n## ")
    cells[0].source = f"{opening.strip()}\n\n{needs}\n{mark}{rest}"
    told = nbformat.v4.new_notebook(cells=cells)
    told.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3"}
    return told


def _is_check(cell: nbformat.NotebookNode) -> bool:
    return "remove-cell" in cell.metadata.get("tags", []) and "assert" in cell.source


def _plain(cell: nbformat.NotebookNode, stated: dict[str, str]) -> nbformat.NotebookNode:
    """Return a new cell without anything that only the site understands."""
    if "site-only" in cell.metadata.get("tags", []):
        return nbformat.v4.new_markdown_cell("*(The documentation has stored results here.)*")
    if cell.cell_type == "code":
        return nbformat.v4.new_code_cell(cell.source.strip())
    source = re.sub(r"\{\{ (\w+) \}\}", lambda found: stated[found[1]], cell.source)
    source = _PICTURE.sub(r"*(In the documentation there is a picture here. \1.)*", source)
    return nbformat.v4.new_markdown_cell(_ROLE.sub(r"\1", _LINK.sub(r"\1", source)).strip())


def script(told: nbformat.NotebookNode) -> str:
    """Return a notebook as a Python script that shows what the notebook shows.

    Words are comments. The value at the end of a cell is printed; a figure is written to a file.
    """
    told = copy.deepcopy(told)
    for cell in told.cells:
        if cell.cell_type == "code":
            cell.source = _displayed(cell.source)
    if any("\ndisplay(" in f"\n{cell.source}" for cell in told.cells):
        told.cells.insert(1, nbformat.v4.new_code_cell(DISPLAY.strip()))
    bare = {"jupytext": {"notebook_metadata_filter": "-all", "cell_metadata_filter": "-all"}}
    plain = nbformat.from_dict({**told, "metadata": {**told.metadata, **bare}})
    return jupytext.writes(plain, fmt="py:percent")


def _displayed(code: str) -> str:
    """Return code whose last line, if it is a value, is displayed."""
    last = ast.parse(code).body[-1]
    if not isinstance(last, ast.Expr) or ast.unparse(last).startswith(("print(", "plt.show(")):
        return code
    lines = code.splitlines()
    value = "\n".join(lines[last.lineno - 1 : last.end_lineno])
    if isinstance(last.value, ast.Tuple):
        value = f"({value})"
    return "\n".join([*lines[: last.lineno - 1], f"display({value})"])


def _source(app: Sphinx, name: str) -> str | None:
    """Return the source of a page that is executed."""
    path = Path(app.env.doc2path(name))
    text = path.read_text(encoding="utf-8")
    return text if is_myst_markdown_notebook(text) else None


def _write(app: Sphinx, error: Exception | None) -> None:
    """Write notebook and script of every executed page that tells something."""
    if error is not None or app.builder.format != "html":
        return
    for name in sorted(app.env.metadata):
        if not _offered(app, name) or (text := _source(app, name)) is None:
            continue
        told = notebook(text, app.config.myst_substitutions)
        target = Path(app.outdir, _address(name))
        target.parent.mkdir(parents=True, exist_ok=True)
        nbformat.write(told, target.with_suffix(".ipynb"))
        target.with_suffix(".py").write_text(script(told), encoding="utf-8")


def _address(name: str) -> str:
    """Return where the download of a page lies, but for its suffix.

    A script in the name of the package that it imports would hide that package.
    """
    folder, _, page = name.rpartition("/")
    return f"{FOLDER}/{folder}/seqopt_{page}"


def _offered(app: Sphinx, name: str) -> bool:
    return name.startswith(("tutorials/", "guides/")) and name in app.env.metadata


def _link(app: Sphinx, pagename: str, _: str, context: dict, __: object) -> None:
    """Put links to notebook and script under the title of an executed page."""
    if "body" not in context or not _offered(app, pagename) or _source(app, pagename) is None:
        return
    root = "../" * pagename.count("/") + _address(pagename)
    extras = app.env.metadata[pagename].get("extras", EXTRAS)
    links = (
        f'<p class="downloads">Download this page as a <a href="{root}.ipynb" download>notebook</a>'
        f' or a <a href="{root}.py" download>script</a>. Either needs seqopt with extras: '
        f'<code>pip install ".[{extras}]"</code> in the folder of seqopt.</p>'
    )
    context["body"] = context["body"].replace("</h1>", f"</h1>{links}", 1)


def setup(app: Sphinx) -> dict[str, bool]:
    """Write downloads when the site has been built, and link to them."""
    app.connect("build-finished", _write)
    app.connect("html-page-context", _link)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
