"""Ranks that are killed, at ten random moments; tools/soak does it a hundred times."""
from tests.faults.soak import soak


def test_a_job_ends_with_any_of_its_ranks_and_goes_on_as_if_nothing_had_happened():
    soak(10)
