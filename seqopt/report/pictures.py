"""Pictures that scenes and networks draw of themselves (extra ``plot``)."""

from __future__ import annotations

from numbers import Integral

from matplotlib.figure import Figure

from seqopt.errors import StepError
from seqopt.network.build import build_network
from seqopt.network.network import Network
from seqopt.report.canvas import VIEW, new_panels
from seqopt.report.draw import draw_bricks
from seqopt.report.network_picture import draw_network
from seqopt.report.style import WIDTH, styled
from seqopt.scene.checks import short
from seqopt.scene.scene import Scene

NUMBERED = 30  # bricks up to which the nodes of a network are numbered


@styled
def scene_picture(scene: Scene, bricks: int | None = None, width: float = WIDTH) -> Figure:
    """Return a picture of a scene, or of its first bricks.

    Parameters
    ----------
    scene : Scene
    bricks : int, optional
        How many, in build order; all by default. The others are drawn pale.
    width : float, optional
        Of the figure, inches.
    """
    network = build_network(scene)
    count = _bricks(scene, bricks)
    figure, (axes,) = new_panels(scene, 1, width)
    if count < len(scene.bricks):
        draw_bricks(axes, network, len(scene.bricks), VIEW, alpha=0.15)
    draw_bricks(axes, network, count, VIEW)
    axes.set_title(f"{scene.name}: {count} of {len(scene.bricks)} bricks")
    return figure


@styled
def network_picture(network: Network, bricks: int | None = None, width: float = WIDTH) -> Figure:
    """Return a picture of a network, or of its part of the first bricks.

    Parameters
    ----------
    network : Network
    bricks : int, optional
        How many, in build order; all by default.
    width : float, optional
        Of the figure, inches.

    Returns
    -------
    matplotlib.figure.Figure
        Nodes that robots may hold carry their numbers where there are few.
    """
    count = _bricks(network.scene, bricks)
    figure, (axes,) = new_panels(network.scene, 1, width, 0.5)
    draw_network(axes, network, count, VIEW, numbers=count <= NUMBERED and width >= WIDTH)
    axes.set_title(
        f"network of {network.scene.name}, {count} bricks\n"
        "filled circles can be held, open ones are joints, squares are supports",
    )
    return figure


def _bricks(scene: Scene, bricks: int | None) -> int:
    """Return how many bricks are drawn, if there are as many."""
    most = len(scene.bricks)
    if bricks is None:
        return most
    if not isinstance(bricks, Integral) or not 1 <= bricks <= most:
        raise StepError(f"{short(bricks)} bricks: scene {scene.name} has 1 to {most}")
    return bricks
