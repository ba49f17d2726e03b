import logging
import os
from types import SimpleNamespace

import pytest

from pdhpc.output.log import LOG, NAME, RunLog, show_log
from pdhpc.output.record import OutputError


def test_lines_are_kept_behind_those_that_are_there(tmp_path, comm):
    for line in ("first", "second"):
        log = RunLog(comm, tmp_path)
        LOG.info(line)
        LOG.debug("not kept")
        log.close()
    LOG.info("after the end")
    lines = (tmp_path / NAME).read_text().splitlines()
    assert [line.split("  ")[1].strip() for line in lines] == ["INFO", "INFO"] and [line.split("  ")[-1] for line in lines] == ["first", "second"]


def test_ranks_above_0_say_only_what_ends_the_job(tmp_path):
    rank = SimpleNamespace(rank=1, bcast=lambda value, root=0: (None, None))
    log = RunLog(rank, tmp_path)
    LOG.error("of all ranks")
    assert not (tmp_path / NAME).exists()
    LOG.critical("of this rank")
    log.close()
    assert (tmp_path / NAME).read_text().endswith("CRITICAL  of this rank\n")


def test_lines_that_are_lost_stop_nothing_and_are_told(tmp_path, comm, capsys):
    """/dev/full is a disk without room."""
    os.symlink("/dev/full", tmp_path / NAME)
    log = RunLog(comm, tmp_path)
    assert log.warnings() == []
    LOG.info("lost")
    assert log.warnings() == [f"{tmp_path / NAME}: lines are missing (No space left on device)"]
    log.close()
    assert capsys.readouterr().err == ""


def test_a_log_that_cannot_be_written(tmp_path, comm):
    with pytest.raises(OutputError, match=r"nowhere/run.log: cannot be written \(No such file or directory\)"):
        RunLog(comm, tmp_path / "nowhere")


def test_a_shown_log_is_printed(capsys):
    before, level = list(LOG.handlers), LOG.level
    show_log()
    try:
        LOG.debug("a word")
    finally:
        for handler in set(LOG.handlers) - set(before):
            LOG.removeHandler(handler)
        LOG.setLevel(level)
    assert capsys.readouterr().out.endswith("  DEBUG     a word\n") and logging.getLogger("pdhpc") is LOG
