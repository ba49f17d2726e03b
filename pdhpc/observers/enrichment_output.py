"""The enriched space at the end of a run, written for its picture."""
from pdhpc.gfem.display import displayed
from pdhpc.output.enrichment_file import write_enrichment
from pdhpc.run import Observer


class EnrichmentOutput(Observer):
    """Write enrichment.h5 when the run is over."""

    def __init__(self, comm, directory):
        self.comm, self.directory = comm, directory

    def finish(self, stepper):
        """Write what the space of the last step looks like. Collective."""
        write_enrichment(self.comm, self.directory, *displayed(self.comm, stepper))
