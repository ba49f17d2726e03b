from pdhpc.observers.enrichment_output import EnrichmentOutput
from pdhpc.output.enrichment_file import read_enrichment


def test_written_at_the_end(pulled_plate, comm, tmp_path):
    _, stepper = pulled_plate(comm, "galerkin")
    stepper.advance()
    EnrichmentOutput(comm, tmp_path).finish(stepper)
    data, attributes = read_enrichment(tmp_path)
    assert attributes == {"step": 1, "time": 3.0, "scheme": "galerkin", "spacing": 1.0}
    assert len(data["vertices/id"]) == 13 * 7 and len(data["points/eta"]) == len(stepper.local.points.slots)
