"""Cells of CSV files that begin with a name: made so that no program takes them for a formula."""

from __future__ import annotations

import pandas as pd

FORMULA = ("=", "+", "-", "@")
MARK = "'"


def harmless(text: str) -> str:
    """Return a cell that spreadsheets show as it is.

    Parameters
    ----------
    text : str
        That begins with a name, of a robot for example.

    Returns
    -------
    str
        After an apostrophe where a formula could begin; `plain` takes it away again.

    Examples
    --------
    >>> harmless("=cmd_node"), harmless("rob1_node"), plain(harmless("'=x"))
    ("'=cmd_node", 'rob1_node', "'=x")
    """
    return MARK + text if text.lstrip(MARK).startswith(FORMULA) else text


def plain(text: str) -> str:
    """Return what a cell said before `harmless`."""
    return text[1:] if text.startswith(MARK) and harmless(text) != text else text


def harmless_table(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table whose columns and texts are `harmless`; numbers stay as they are."""
    texts = [k for k, kind in enumerate(table.dtypes) if not pd.api.types.is_numeric_dtype(kind)]
    columns = [table.iloc[:, k] for k in range(table.shape[1])]
    for k in texts:
        columns[k] = columns[k].map(lambda v: harmless(v) if isinstance(v, str) else v)
    out = pd.concat(columns, axis=1) if columns else table
    return out.rename(columns=lambda name: harmless(name) if isinstance(name, str) else name)
