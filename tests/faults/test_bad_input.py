"""Two hundred broken inputs in one process; on several ranks: tests/mpi/test_bad_input.py; tools/broken tries thousands."""
from tests.faults.broken import try_all


def test_broken_inputs_are_refused_in_one_sentence(comm, tmp_path):
    try_all(comm, 200, tmp_path)
