"""Free schedules of small builds by a graph of labeled robots, whose states are solved alone."""

from functools import partial

import networkx as nx
import numpy as np

from seqopt.engines.interface import Want
from seqopt.errors import MechanismError
from seqopt.problem.criteria import WorstRatio
from seqopt.problem.requirements import LIMIT_TOLERANCE
from seqopt.responses.quantities import CHOSEN_BY, lengths
from seqopt.sequence.rules import Payload
from seqopt.sequence.steps import StepKind
from tests.plain_rules import PlainBook

FOUR = ("F_largest", "M_sup", "T_max", "D_max")
ONES = WorstRatio("ones", (("F_largest", 100.0), ("M_sup", 10.0), ("T_max", 30.0), ("D_max", 1e-5)))


def responses(engine, bricks, grips):
    """The four worst responses of a state, solved alone; None where something is loose."""
    held = [node for node in grips if node is not None]
    props = rigid_props(engine.network.scene, bricks, held)
    try:
        fields = engine.solve(bricks, np.array([held + props], dtype=int).reshape(1, -1), Want.ALL)
    except MechanismError:
        return None
    forces = lengths(fields.grip_force)[0, : len(held)]
    worst = [CHOSEN_BY[name].of(engine.network, fields)[0] for name in FOUR[1:]]
    return np.array([max(forces, default=0.0), *worst]), dict(zip(held, forces, strict=True))


def rigid_props(scene, bricks, held):
    """The nodes of rigid props that hold: of bricks that stand, until the whole is let go."""
    if bricks == len(scene.bricks) and not held:
        return []
    stand = [node for brick in scene.placed[:bricks] for node in brick.nodes]
    return [prop.node for prop in scene.props if prop.node in stand]


def allowed(engine, rules, bricks, grips):
    """The four worst responses of a state; None where it is loose or a payload is exceeded."""
    if not bricks:
        return np.zeros(4)
    found = responses(engine, bricks, grips)
    if found is None:
        return None
    worst, forces = found
    for robot, node in zip(engine.network.scene.robots, grips, strict=True):
        kept = rules.payload is Payload.KEPT and node is not None
        if kept and forces[node] > robot.payload * (1 + LIMIT_TOLERANCE):
            return None
    return worst


def distance(scene, first, second):
    """How far two nodes are apart."""
    return float(np.linalg.norm(np.subtract(*map(scene.node_position, (first, second)))))


def whole_graph(engine, rules, *, last=False, allow=None):
    """Every labeled state with its four responses, the steps between them, start and ends.

    A state may also say which node each robot held last; steps then say how far robots go. Which
    states are allowed may be said by a function of brick count and grips, as of `allowed`.
    """
    allow = partial(allowed, engine, rules) if allow is None else allow
    book, scene = PlainBook(engine.network, rules), engine.network.scene
    none = (None,) * len(scene.robots)
    bricks, held, regrips = book.start
    stays = rules.begin.stays if rules.begin and rules.begin.stays else none
    lasts = tuple(h if h is not None else s for h, s in zip(held, stays, strict=True))
    count = regrips if rules.regrips is not None else 0
    start = (bricks, held, count, lasts if last else none)
    graph = nx.DiGraph([("ends", "end")], regrip=0.0)
    graph.add_node(start, worst=np.zeros(4))
    work, known = [start], {}
    while work:
        state = work.pop()
        for kind, bricks, grips, regrips in book.follow(*state[:3]):
            held = tuple(
                new if new is not None else old for new, old in zip(grips, state[3], strict=True)
            )
            count = regrips if rules.regrips is not None else 0
            after = (bricks, grips, count, held if last else none)
            if after not in graph:
                if (bricks, grips) not in known:
                    known[bricks, grips] = allow(bricks, grips)
                worst = known[bricks, grips]
                if worst is None:
                    continue
                graph.add_node(after, worst=worst)
                work.append(after)
                if book.ends(bricks, grips):
                    graph.add_edge(after, "end", regrip=0.0, way=0.0)
            way = sum(
                distance(scene, *pair)
                for pair in zip(state[3], held, strict=True)
                if None not in pair
            )
            graph.add_edge(state, after, regrip=float(kind is StepKind.REPOSITION), way=way)
    graph.remove_node("ends")
    return graph, start


def least_peak(graph, start, costs):
    """The least worst cost of any path, by trying every value that occurs."""
    for value in sorted({*costs.values()}):
        kept = [n for n in graph if n == "end" or costs[n] <= value * (1 + 1e-9)]
        if start in kept and nx.has_path(graph.subgraph(kept), start, "end"):
            return value, graph.subgraph(kept)
    return None


def peaks(graph):
    scales = np.array([scale for _, scale in ONES.limits])
    return {n: float((d["worst"] / scales).max()) for n, d in graph.nodes(data=True) if n != "end"}


def best_values(engine, rules, aim):
    """What goals take of the best plan, one after the other; None where there is none."""
    graph, start = whole_graph(engine, rules, last="travel" in aim)
    costs = peaks(graph)
    if start not in graph or not nx.has_path(graph, start, "end"):
        return None
    out = []
    for goal in aim.split(","):
        if goal == "minmax":
            value, graph = least_peak(graph, start, costs)
        else:
            value, graph = shortest(graph, start, partial(cost, graph, costs, goal))
        out.append(value)
    return tuple(out)


def cost(graph, costs, goal, _, after, data):
    """What a goal that is a sum takes of a step."""
    if after == "end":
        return 0.0
    if goal in ("sum", "sum(T_max)"):
        return costs[after] if goal == "sum" else float(graph.nodes[after]["worst"][2])
    return {"steps": 1.0, "regrips": data["regrip"], "travel": data["way"]}[goal]


def shortest(graph, start, weight):
    """The least sum of costs to the end, and the steps on paths of that sum."""
    before = nx.single_source_dijkstra_path_length(graph, start, weight=weight)
    back = graph.reverse()
    after = nx.single_source_dijkstra_path_length(
        back, "end", weight=lambda b, a, data: weight(a, b, data)
    )
    most = after[start] * (1 + 1e-9)
    tight = [
        (a, b)
        for a, b, data in graph.edges(data=True)
        if before.get(a, np.inf) + weight(a, b, data) + after.get(b, np.inf) <= most
    ]
    return after[start], graph.edge_subgraph(tight)
