"""Pictures of a network: nodes, edges and the forces in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D

from seqopt.arrays import Floats, Ints
from seqopt.network.network import Network, PartKind
from seqopt.report.labels import aside
from seqopt.report.style import BLUE, SMALL, VERMILION
from seqopt.report.view import HALO, View, frame

INK, TENSION, COMPRESSION = "#2b2b2b", VERMILION, BLUE
THIN, THICK = 1.2, 7.0  # points: edges without force, and with the largest
SPARE = 0.3  # share of a node's area where the colors of edges count


def draw_network(  # noqa: PLR0913  # what is drawn, and how, each by its name
    axes: Axes,
    network: Network,
    bricks: int,
    view: View,
    *,
    displacement: Floats | None = None,
    magnify: float = 1.0,
    edge_force: Floats | None = None,
    largest_force: float | None = None,
    numbers: bool = False,
) -> None:
    """Draw nodes and edges of the first bricks, in place or moved.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        To draw on.
    network : Network
        Of the scene.
    bricks : int
        How many, in build order.
    view : View
        From where.
    displacement : (N, 3) float, optional
        Of every node, m.
    magnify : float
        How many times larger the motion is drawn.
    edge_force : (E,) float, optional
        Axial force, tension positive, N: colors the edges and sets their widths; `force_key` says
        how.
    largest_force : float, optional
        Force that is drawn widest, N; by default the largest of ``edge_force``.
    numbers : bool
        Whether to write the numbers of the nodes that robots may hold.
    """
    nodes, edges = network.count_nodes(bricks), network.count_edges(bricks)
    points = network.node_position[:nodes].copy()
    if displacement is not None:
        points += magnify * displacement
    seen = points @ view.axes()[:2].T
    segments = list(seen[network.edge_nodes[:edges]])
    axes.add_collection(_lines(segments, edge_force, largest_force))
    _draw_nodes(axes, network.node_kind[:nodes], seen, 1.0 if edge_force is None else SPARE)
    if numbers:
        _write_numbers(axes, network, seen, segments)
    frame(axes)


def _write_numbers(axes: Axes, network: Network, seen: Floats, segments: Sequence[Floats]) -> None:
    """Write the numbers of the nodes that robots may hold beside what is seen (N, 2)."""
    inner = np.flatnonzero(network.node_kind[: len(seen)] == PartKind.INNER.value)
    for i, shift in zip(inner, aside(seen[inner], segments), strict=True):
        axes.annotate(
            str(network.node_name[i]),
            seen[i],
            shift,
            textcoords="offset points",
            fontsize=SMALL,
            ha="center",
            va="center",
            path_effects=HALO,
            zorder=4,
        )


def _lines(
    segments: list[Floats], edge_force: Floats | None, largest: float | None
) -> LineCollection:
    """Return edges (E) of (2, 2), colored by their forces (E,) if given."""
    if edge_force is None:
        return LineCollection(segments, colors=INK, linewidths=1.2)
    size = largest or np.abs(edge_force).max() or 1.0
    colors = [TENSION if force > 0 else COMPRESSION for force in edge_force]
    widths = THIN + (THICK - THIN) * np.abs(edge_force) / size
    return LineCollection(segments, colors=colors, linewidths=widths.tolist())


def force_key(largest_force: float) -> list[Line2D]:
    """Return the entries of a legend for the color and the width of edges.

    Parameters
    ----------
    largest_force : float
        Force that is drawn widest, N.

    Returns
    -------
    list of matplotlib.lines.Line2D
    """
    kinds = [
        Line2D([], [], color=color, lw=THICK / 2, label=name)
        for color, name in ((TENSION, "tension"), (COMPRESSION, "compression"))
    ]
    return kinds + [
        Line2D(
            [],
            [],
            color=INK,
            lw=THIN + (THICK - THIN) * share,
            label=f"{share * largest_force:.0f} N",
        )
        for share in (0.1, 0.5, 1.0)
    ]


def _draw_nodes(axes: Axes, kind: Ints, seen: Floats, size_by: float) -> None:
    """Draw nodes of given kinds (N,) where they are seen (N, 2)."""
    for which, marker, size, face in (
        (PartKind.INNER, "o", 9, INK),
        (PartKind.JOINT, "o", 12, "white"),
        (PartKind.BASE, "s", 36, INK),
    ):
        at = seen[kind == which]
        axes.scatter(
            at[:, 0],
            at[:, 1],
            s=size_by * size,
            marker=marker,
            c=face,
            edgecolors=INK,
            zorder=3,
            linewidths=0.7,
        )
