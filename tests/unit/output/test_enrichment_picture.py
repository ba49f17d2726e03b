import numpy as np

from pdhpc.output.enrichment_file import write_enrichment
from pdhpc.output.enrichment_picture import draw_enrichment

VERTICES = {
    "vertices/id": np.arange(4),
    "vertices/position": np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]]),
    "vertices/displacement": np.zeros((4, 2)),
    "vertices/patch": np.array([1, 1, 0, 0], np.int8),
    "vertices/enriched": np.array([[1, 1], [0, 1], [0, 0], [0, 0]], np.int8),
}
ATTRIBUTES = {"scheme": "galerkin", "time": 1.0, "step": 3, "spacing": 0.5}


def test_nothing_to_draw(tmp_path):
    assert draw_enrichment(tmp_path) is None


def test_vertices_alone(comm, tmp_path):
    write_enrichment(comm, tmp_path, VERTICES, ATTRIBUTES)
    assert draw_enrichment(tmp_path).stat().st_size > 5000 and not list(tmp_path.glob("*.part*"))


def test_functions_and_mass_matrix(comm, tmp_path):
    """Two unknowns that see each other, one function on four points."""
    position = np.array([[0.25, 0.25], [0.25, 0.75], [0.75, 0.25], [0.75, 0.75]])
    data = {"points/position": position, "points/eta": position, "points/functions": position[:, :1],
            "functions/vertex": np.array([1]), "functions/component": np.array([1]),
            "unknowns/number": np.array([5, 3]), "unknowns/component": np.zeros(2, int),
            "unknowns/enriched": np.array([0, 1]), "unknowns/vertex": np.array([1, 1]),
            "entries/row": np.array([5, 5, 3, 3]), "entries/column": np.array([5, 3, 5, 3])}
    write_enrichment(comm, tmp_path, VERTICES, ATTRIBUTES)
    alone = draw_enrichment(tmp_path).stat().st_size
    write_enrichment(comm, tmp_path, {**VERTICES, **data}, ATTRIBUTES)
    assert draw_enrichment(tmp_path).stat().st_size > 1.5 * alone
