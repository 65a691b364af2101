"""Small documents in the formats of others, as their packages write them."""

from tests.blocks import box

LOW, HIGH = box((2.0, 1.0, 0.5)), box((1.0, 1.0, 0.5), at=(0.25, 0.0, 0.5))
TOP = box((2.0, 1.0, 0.5), at=(0.0, 0.0, 1.0))
FACE = [[0.25, 0.0, 0.5], [1.25, 0.0, 0.5], [1.25, 1.0, 0.5], [0.25, 1.0, 0.5]]
UPPER = [[x, y, 1.0] for x, y, _ in FACE]


def mesh(shape, wrap="data"):
    """A mesh of COMPAS; ``wrap`` is the key under which its version keeps data."""
    vertex = {str(i): dict(zip("xyz", row, strict=True)) for i, row in enumerate(shape.vertices)}
    faces = {str(i): list(face) for i, face in enumerate(shape.faces)}
    held = {"vertex": vertex, "face": faces}
    return {"dtype": "compas_assembly.datastructures/Block", wrap: held} if wrap else held


def point(row):
    return {"dtype": "compas.geometry/Point", "data": row}


def assembly():
    """As compas_assembly 0.7 and compas_cra 0.8: three blocks, the lowest a support."""

    def interface(corners):
        data = {"points": corners, "size": 1.0, "frame": None}
        return {"dtype": "compas_assembly.datastructures/Interface", "data": data}

    nodes = {
        "0": {"block": mesh(LOW), "is_support": True},
        "4": {"block": mesh(HIGH)},
        "7": {"block": mesh(TOP)},
    }
    edges = {
        "0": {"4": {"interfaces": [interface(FACE)]}},
        "4": {"7": {"interfaces": [interface(list(map(point, UPPER)))]}},
        "7": {},
    }
    graph = {"dtype": "compas.datastructures/Graph", "data": {"node": nodes, "edge": edges}}
    data = {"attributes": {"name": "Assembly"}, "graph": graph}
    return {"dtype": "compas_assembly.datastructures/Assembly", "data": data}


def legacy():
    """As compas_assembly 0.2: blocks beside a graph, courses, a support that is a plane."""
    ground = {
        "vertex": {str(i): dict(zip("xyz", row, strict=True)) for i, row in enumerate(FLOOR)},
        "face": {"0": ["0", "1", "2", "3"]},
    }
    shapes = {"0": LOW, "1": HIGH, "2": TOP}
    blocks = {key: mesh(shape, "") for key, shape in shapes.items()} | {"9": ground}
    for block in blocks.values():
        block["face"] = {key: list(map(str, face)) for key, face in block["face"].items()}
    nodes = {
        "0": {"x": 1.0, "y": 0.5, "z": 0.25, "course": 1},
        "1": {"course": 2},
        "2": {"course": 3},
        "9": {"course": 0, "is_support": True, "is_placed": True},
    }
    edges = {
        "0": {"9": {"interface_points": FLOOR}, "1": {"interface_points": FACE}},
        "1": {"2": {"interface_points": UPPER, "interface_type": "face_face"}},
    }
    common = {"is_support": False, "course": None, "x": 0.0, "y": 0.0, "z": 0.0}
    return {"assembly": {"node": nodes, "edge": edges, "node_attributes": common}, "blocks": blocks}


FLOOR = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]]


def matrix(rows):
    """A transformation of COMPAS."""
    return {"dtype": "compas.geometry/Transformation", "data": {"matrix": [*rows, [0, 0, 0, 1]]}}


def element(guid, shape, **more):
    """A block of compas_dem."""
    held = {"geometry": mesh(shape), "material": "stone", "transformation": None, **more}
    return {"dtype": "compas_dem.elements/Block", "data": held, "guid": guid}


def nested():
    """As compas_dem 0.6: a block in a group, another parented to it, a third beside them."""

    def node(guid, *children):
        return {"name": "ElementNode", "element": guid, "children": list(children)}

    turned = matrix([[0, -1, 0, 3], [1, 0, 0, 0], [0, 0, 1, 1]])
    group = {"transformation": turned, "features": [], "name": "g", "material": None}
    tilted = matrix([[1, 0, 0, 0.25], [0, 0, -1, 0], [0, 1, 0, 0.5]])
    raised = matrix([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 7]])
    rows = [
        {"dtype": "compas_model.elements/Group", "data": group, "guid": "g"},
        element("a", box((2.0, 1.0, 0.5))),
        element("b", box((1.0, 1.0, 0.5)), transformation=tilted),
        element("c", box((2.0, 1.0, 0.5)), transformation=raised),
    ]
    data = {
        "transformation": matrix([[1e-3, 0, 0, 0], [0, 0, -1e-3, 0.02], [0, 1e-3, 0, 0]]),
        "elements": {row["guid"]: row for row in rows},
        "materials": {},
        "tree": {"root": {"children": [node("g", node("a", node("b"))), node("c")]}},
        "graph": {"node": {str(i): {"element": row["guid"]} for i, row in enumerate(rows)}},
    }
    return {"dtype": "compas_dem.models/BlockModel", "data": data}


def model(*, shift=None):
    """As compas_dem 0.6; a transformation shifts every block."""

    def contact(corners):
        data = {"points": list(map(point, corners)), "size": 1.0}
        return {"contacts": [{"dtype": "compas_dem.interactions/FrictionContact", "data": data}]}

    more = {"transformation": shift}
    supported = element("a", LOW, is_support=True, **more)
    rows = [supported, element("b", HIGH, **more), element("c", TOP, **more)]
    stone = {"dtype": "compas_dem.material/Stone", "data": {"density": 2000}, "guid": "stone"}
    graph = {
        "node": {"0": {"element": "a"}, "1": {"element": "b"}, "2": {"element": "c"}},
        "edge": {"0": {"1": contact(FACE)}, "1": {"2": contact(UPPER)}},
    }
    data = {
        "elements": {row["guid"]: row for row in rows},
        "materials": {"stone": stone},
        "graph": graph,
        "transformation": None,
    }
    return {"dtype": "compas_dem.models/BlockModel", "data": data}


def problem():
    """A problem of compas_dem about the model, with stiff joints."""
    joint = {"dtype": "compas_dem.interactions/JointModel", "data": {"kn": 10e10, "kt": 10e7}}
    properties = {"data": {"contact_model": None, "joint_model": joint}}
    data = {"model": model(), "contact_properties": properties, "boundary_conditions": {}}
    return {"dtype": "compas_dem.problem/Problem", "data": data}


DOCUMENTS = {
    "assembly": assembly(),
    "legacy": legacy(),
    "model": model(),
    "nested": nested(),
    "problem": problem(),
    "meshes": [mesh(LOW), [mesh(HIGH, "value")], mesh(TOP)],
}
BOXES = "x,y,z,length,width,height,yaw,support\n1,.5,.25,2,1,.5,0,1\n.75,.5,.75,1,1,.5,90,\n"


def obj(*shapes):
    """Wavefront OBJ of shapes, an object each."""
    out, before = [], 1
    for i, shape in enumerate(shapes):
        out += [f"o block_{i}", *(f"v {x} {y} {z}" for x, y, z in shape.vertices)]
        out += ["f " + " ".join(f"{before + v}//1" for v in face) for face in shape.faces]
        before += len(shape.vertices)
    return "\n".join(out) + "\n"
