from pdhpc.observers.enrichment_output import EnrichmentOutput
from pdhpc.output.enrichment_file import read_enrichment


def test_written_at_the_end(pulled_plate, comm, tmp_path):
    _, stepper = pulled_plate(comm, "galerkin")
    stepper.advance()
    EnrichmentOutput(comm, tmp_path).finish(stepper)
    data, attributes = read_enrichment(tmp_path)
    assert (attributes["step"], attributes["time"], attributes["scheme"], attributes["tolerance"]) == (1, 3.0, "galerkin", 0.02)
    assert len(data["vertices/id"]) == 13 * 7 and len(data["cells/patch"]) == 12 * 6 and len(data["raster/displacement"]) > 1000
