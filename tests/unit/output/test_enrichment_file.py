import numpy as np
import pytest

from pdhpc.output.enrichment_file import NAME, read_enrichment, write_enrichment
from pdhpc.output.record import OutputError


def test_what_is_written_is_read(comm, tmp_path):
    data = {"points/eta": np.arange(6.0).reshape(3, 2), "entries/row": np.empty(0, np.int64)}
    write_enrichment(comm, tmp_path, data, {"scheme": "galerkin", "step": 7, "spacing": 0.5})
    found, attributes = read_enrichment(tmp_path)
    assert sorted(found) == sorted(data) and all(np.array_equal(found[name], data[name]) for name in data)
    assert attributes == {"scheme": "galerkin", "step": 7, "spacing": 0.5} and [path.name for path in tmp_path.iterdir()] == [NAME]


def test_a_folder_that_is_not_there(comm, tmp_path):
    with pytest.raises(OutputError, match="cannot be written"):
        write_enrichment(comm, tmp_path / "nowhere", {"a": np.zeros(1)}, {})
