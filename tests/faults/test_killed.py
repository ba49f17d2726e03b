"""Ranks that are killed, at ten random moments of runs of four methods; tools/soak does it as often as one likes, with more of them."""
import pytest

from tests.faults.soak import soak


@pytest.mark.parametrize("method, times", [("particles", 4), ("mts", 2), ("gfem", 2), ("newton", 2)])
def test_a_job_ends_with_any_of_its_ranks_and_goes_on_as_if_nothing_had_happened(method, times):
    soak(times, methods=(method,))
