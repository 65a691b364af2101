"""A page that shows builds: one file, offline, with a step viewer in three dimensions."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Sequence
from hashlib import sha256
from html import escape
from importlib import resources

import numpy as np
import pandas as pd

from seqopt.engines.interface import Engine
from seqopt.errors import ProblemError
from seqopt.report.page_data import Build, Scatter, build_data, size_of, structure_data
from seqopt.responses.quantities import number_text

RESPONSES = {
    "F_largest": "largest grip force, N",
    "M_sup_Nm": "largest support moment, N m",
    "F_max_N": "largest tension in an edge, N",
    "D_max_1e-3mm": "largest displacement, 1e-3 mm",
}
PARTS = {"style": "viewer.css", "three": "three.js", "charts": "charts.js", "viewer": "viewer.js"}
MOST = 6_000_000  # numbers of fields in a page: about 8 MB
LEFT_OUT = "Displacements and axial forces of some builds are left out: there are too many steps."


def report_page(
    engine: Engine,
    builds: Sequence[Build],
    sentence: str,
    tables: Sequence[tuple[str, pd.DataFrame]] = (),
    scatter: Scatter | None = None,
) -> str:
    """Return a page that shows builds of one scene, as HTML that needs nothing else.

    Parameters
    ----------
    engine : Engine
        Of the scene; computes the fields that are drawn.
    builds : sequence of Build
        The first is shown first.
    sentence : str
        What there is to see, in a sentence.
    tables : sequence of (str, pandas.DataFrame), optional
        Captions and tables; a row whose first cell names a build shows it.
    scatter : Scatter, optional
        A chart with a point for each of some builds.

    Returns
    -------
    str
        Without some fields where there are more than `MOST` numbers; it says so.

    Raises
    ------
    ProblemError
        If there is no build.

    Examples
    --------
    >>> import seqopt
    >>> from seqopt.report.page_data import Build
    >>> network = seqopt.build_network(seqopt.load_scene("arch25"))
    >>> engine, steps = seqopt.make_engine("compliance", network), seqopt.sequential(network)
    >>> build = Build("sequential", steps, seqopt.analyze(engine, steps))
    >>> len(report_page(engine, [build], "Two robots take turns.")) > 5e5
    True
    """
    return _filled(
        title=f"{escape(engine.network.scene.name)}, step by step",
        sentence=escape(sentence),
        tables="".join(_table(caption, table) for caption, table in tables),
        data=_json(_data(engine, builds, scatter)),
    )


def _policy(style: str, **scripts: str) -> str:
    """Return what a browser may run and load of the page: its own scripts and style, no other."""
    own = " ".join(map(_hashed, scripts.values()))
    return (
        f"default-src 'none'; script-src {own}; style-src {_hashed(style)}; img-src data: blob:; "
        "base-uri 'none'; form-action 'none'"
    )


def _hashed(text: str) -> str:
    """Return a part of the page as its policy names it."""
    return f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'"


def _json(data: object) -> str:
    """Return JSON that cannot end the script that it stands in."""
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")


def _filled(**parts: str) -> str:
    """Return the page with its parts in their places, and the policy that lets its own run."""
    own = {part: _asset(name) for part, name in PARTS.items()}
    page = _asset("page.html")
    for name, content in {"policy": _policy(**own), **parts, **own}.items():
        page = page.replace(f"<!-- {name} -->", content, 1)
    return page


def _data(engine: Engine, builds: Sequence[Build], scatter: Scatter | None) -> dict[str, object]:
    """Return what the viewer reads, fields for as many builds as there is room for."""
    if not builds:
        raise ProblemError("a report of nothing; give at least one build")
    network = engine.network
    ends = np.cumsum([size_of(network, build) for build in builds])
    return {
        "structure": structure_data(network),
        "builds": [
            build_data(engine, build, fields=bool(end <= MOST))
            for build, end in zip(builds, ends, strict=True)
        ],
        "responses": RESPONSES,
        "scatter": None if scatter is None else scatter.data(),
        "note": LEFT_OUT if ends[-1] > MOST else "",
    }


def _asset(name: str) -> str:
    return resources.files("seqopt").joinpath(f"data/viewer/{name}").read_text(encoding="utf-8")


def _table(caption: str, table: pd.DataFrame) -> str:
    """Return a table as HTML, numbers with four digits."""
    body = table.to_html(
        index=False, border=0, na_rep="", float_format=number_text, classes="wide"
    ).replace(' style="text-align: right;"', "")  # as the page does itself
    return f'<figure class="table"><figcaption>{escape(caption)}</figcaption>{body}</figure>'
