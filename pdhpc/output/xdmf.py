"""XDMF: the XML beside the HDF5 files that ParaView and meshio read."""
from xml.sax.saxutils import escape

_TYPES = {(): ("Scalar", ""), (3,): ("Vector", " 3"), (9,): ("Tensor", " 9")}


def xdmf_text(frames, total):
    """Return the XDMF of a temporal collection of particles.

    frames : [(name, step, time, {field: shape of a row})]; total : number of particles.
    """
    lines = [
        '<?xml version="1.0"?>',
        '<Xdmf Version="3.0">',
        "<Domain>",
        '<Grid Name="particles" GridType="Uniform">',
        *_mesh(total),
        "</Grid>",
        '<Grid Name="run" GridType="Collection" CollectionType="Temporal">',
    ]
    for name, _, time, fields in frames:
        lines += [f'<Grid Name="{name}" GridType="Uniform">', f'<Time Value="{time!r}"/>', *_mesh(total)]
        for field, shape in fields.items():
            kind, width = _TYPES[tuple(shape)]
            lines.append(f'<Attribute Name="{escape(field)}" AttributeType="{kind}" Center="Node">')
            lines += [_item(f"fields/frame_{name}.h5:/{field}", f"{total}{width}"), "</Attribute>"]
        lines.append("</Grid>")
    return "\n".join(lines + ["</Grid>", "</Domain>", "</Xdmf>", ""])


def _mesh(total):
    topology = f'<Topology TopologyType="Polyvertex" NumberOfElements="{total}" NodesPerElement="1">'
    return [
        topology, _item("fields/points.h5:/topology", f"{total} 1", "Int"), "</Topology>",
        '<Geometry GeometryType="XYZ">', _item("fields/points.h5:/position", f"{total} 3"), "</Geometry>",
    ]


def _item(path, dimensions, number="Float"):
    return f'<DataItem Format="HDF" NumberType="{number}" Precision="8" Dimensions="{dimensions}">{path}</DataItem>'
