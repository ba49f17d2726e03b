from xml.etree import ElementTree

from pdhpc.output.xdmf import xdmf_text


def test_one_grid_per_frame_with_its_fields():
    tree = ElementTree.fromstring(xdmf_text([("000001", 1, 0.1, {"damage": (), "displacement": (3,), "stress": (9,)}), ("000002", 2, 0.2, {})], 7))
    collection = tree.find("Domain/Grid[@CollectionType='Temporal']")
    assert [grid.find("Time").get("Value") for grid in collection] == ["0.1", "0.2"]
    attributes = {a.get("Name"): (a.get("AttributeType"), a.find("DataItem").get("Dimensions"), a.find("DataItem").text) for a in collection[0].iter("Attribute")}
    assert attributes["displacement"] == ("Vector", "7 3", "fields/frame_000001.h5:/displacement")
    assert attributes["damage"] == ("Scalar", "7", "fields/frame_000001.h5:/damage") and attributes["stress"][0] == "Tensor"


def test_meshes_show_their_cells():
    for kind, name, corners in (("quad", "Quadrilateral", 4), ("hexahedron", "Hexahedron", 8), ("triangle", "Triangle", 3), ("tetra", "Tetrahedron", 4)):
        grid = ElementTree.fromstring(xdmf_text([("000001", 1, 0.1, {})], 9, kind, 4)).find("Domain/Grid[@CollectionType='Temporal']/Grid")
        topology = grid.find("Topology")
        assert (topology.get("TopologyType"), topology.get("NumberOfElements"), topology.find("DataItem").get("Dimensions")) == (name, "4", f"4 {corners}")
