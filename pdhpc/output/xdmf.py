"""XDMF: the XML beside the HDF5 files that ParaView and meshio read."""
from xml.sax.saxutils import escape

_TYPES = {(): ("Scalar", ""), (3,): ("Vector", " 3"), (9,): ("Tensor", " 9")}


_CELLS = {"triangle": ("Triangle", 3), "quad": ("Quadrilateral", 4), "tetra": ("Tetrahedron", 4), "hexahedron": ("Hexahedron", 8)}


def xdmf_text(frames, total, kind=None, cells=0):
    """Return the XDMF of a temporal collection of particles, or of a mesh.

    frames : [(name, step, time, {field: shape of a row})]; total : number of particles or vertices; kind : of the cells of a mesh, None for particles;
    cells : their number.
    """
    mesh = _mesh(total, kind, cells)
    lines = [
        '<?xml version="1.0"?>',
        '<Xdmf Version="3.0">',
        "<Domain>",
        f'<Grid Name="{"mesh" if kind else "particles"}" GridType="Uniform">',
        *mesh,
        "</Grid>",
        '<Grid Name="run" GridType="Collection" CollectionType="Temporal">',
    ]
    for name, _, time, fields in frames:
        lines += [f'<Grid Name="{name}" GridType="Uniform">', f'<Time Value="{time!r}"/>', *mesh]
        for field, shape in fields.items():
            kind, width = _TYPES[tuple(shape)]
            lines.append(f'<Attribute Name="{escape(field)}" AttributeType="{kind}" Center="Node">')
            lines += [_item(f"fields/frame_{name}.h5:/{field}", f"{total}{width}"), "</Attribute>"]
        lines.append("</Grid>")
    return "\n".join(lines + ["</Grid>", "</Domain>", "</Xdmf>", ""])


def _mesh(total, kind, cells):
    if kind is None:
        heading = f'<Topology TopologyType="Polyvertex" NumberOfElements="{total}" NodesPerElement="1">'
        topology = heading, _item("fields/points.h5:/topology", f"{total} 1", "Int")
    else:
        name, corners = _CELLS[kind]
        topology = f'<Topology TopologyType="{name}" NumberOfElements="{cells}">', _item("fields/points.h5:/cells", f"{cells} {corners}", "Int")
    return [
        *topology, "</Topology>",
        '<Geometry GeometryType="XYZ">', _item("fields/points.h5:/position", f"{total} 3"), "</Geometry>",
    ]


def _item(path, dimensions, number="Float"):
    return f'<DataItem Format="HDF" NumberType="{number}" Precision="8" Dimensions="{dimensions}">{path}</DataItem>'
