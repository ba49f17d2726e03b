from pdhpc.observers import progress
from pdhpc.run import drive


class Steps:
    step = 0
    time = 0.0

    def advance(self):
        self.step += 1


def test_a_batch_log_gets_ten_plain_lines(capsys, monkeypatch):
    monkeypatch.setattr(progress, "_on_terminal", lambda: False)
    drive(Steps(), 1000, [progress.Progress(1000)], {})
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 10 and lines[-1].startswith("step 1000/1000")


def test_what_a_stepper_says_is_printed_every_step(capsys, monkeypatch):
    monkeypatch.setattr(progress, "_on_terminal", lambda: False)
    stepper = Steps()
    stepper.note = "residual 1e-7"
    drive(stepper, 30, [progress.Progress(30)], {})
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 30 and lines[0].endswith("  residual 1e-7")


def test_quiet_says_nothing(capsys):
    drive(Steps(), 50, [progress.Progress(50, quiet=True)], {})
    assert capsys.readouterr().out == ""


def test_a_terminal_gets_a_bar(capsys, monkeypatch):
    monkeypatch.setattr(progress, "_on_terminal", lambda: True)
    drive(Steps(), 50, [progress.Progress(50)], {})
    assert "50/50" in capsys.readouterr().out


def test_under_mpirun_the_launcher_s_output_decides(monkeypatch):
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    monkeypatch.setattr(progress.os, "readlink", lambda path: "/dev/pts/3")
    assert progress._on_terminal()
    monkeypatch.setattr(progress.os, "readlink", lambda path: "pipe:[12]")
    assert not progress._on_terminal()
