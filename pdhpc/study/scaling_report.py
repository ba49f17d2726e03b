"""The report of a scaling study: a table, and pictures of efficiency and of where the time goes."""
from pathlib import Path

from pdhpc.study.scaling import PHASES, efficiencies

_COLOURS = {"force": "#2f6f9f", "exchange": "#c8553d", "wait": "#e0a458", "integrate": "#5b8e55", "contact": "#8a6fae", "other": "#b8b8b8"}


def report(study, rows, directory):
    """Print the table of a study and draw efficiency.png and phases.png into `directory`; return their paths."""
    from rich.console import Console
    from rich.table import Table

    table = Table("ranks", "particles", "ms a step", "efficiency", *PHASES, "other", "imbalance", "kB sent", box=None, padding=(0, 2, 0, 0))
    measured = efficiencies(rows)
    for ranks, step, efficiency, shares in measured:
        row = next(row for row in rows if row["ranks"] == ranks)
        cells = [f"{shares[name]:.1%}" for name in PHASES] + [f"{max(0.0, 1 - sum(shares.values())):.1%}"]
        table.add_row(
            str(ranks), f"{row['particles']:,}", f"{step * 1e3:.4g}", f"{efficiency:.1%}", *cells, f"{row['bond_imbalance'] - 1:.1%}",
            f"{row['bytes_per_step'] / 1e3:.4g}",
        )
    console = Console()
    (console if console.is_terminal else Console(width=200)).print(table)
    return [_draw_efficiency(study, measured, Path(directory)), _draw_phases(study, measured, Path(directory))]


def report_prediction(study, rows, dim, ratio, name, directory):
    """Print what the calibrated model predicts for a machine, and draw prediction.png; return its path."""
    from rich.console import Console
    from rich.table import Table

    from pdhpc.study.predictor import IGNORED, calibrate, curves, read_machine

    machine = read_machine(name)
    cost, _ = calibrate(rows, dim, ratio)
    strong, weak = curves(dim, ratio, machine, cost)
    table = Table("particles", "ranks", "ms a step", "million particle-steps/s", "efficiency", "messages", box=None, padding=(0, 2, 0, 0))
    for size, points in strong.items():
        for point in points[:: max(1, len(points) // 4)]:
            efficiency = points[0].seconds / (point.seconds * point.ranks)
            cells = f"{point.seconds * 1e3:.4g}", f"{point.rate / 1e6:.4g}", f"{efficiency:.0%}", f"{point.messages / point.seconds:.0%}"
            table.add_row(f"{size:.0e}", f"{point.ranks:,}", *cells)
    console = Console()
    console.print(f"predicted for {machine.name} ({machine.source})")
    (console if console.is_terminal else Console(width=200)).print(table)
    console.print(f"ignored: {IGNORED}")
    figure, axes = _figure(study)
    for size, points in strong.items():
        axes.plot([p.ranks for p in points], [points[0].seconds / (p.seconds * p.ranks) for p in points], "-", label=f"strong, {size:.0e} particles")
    for size, points in weak.items():
        axes.plot([p.ranks for p in points], [points[0].seconds / p.seconds for p in points], "--", label=f"weak, {size:.0e} a rank")
    axes.set(xlabel="ranks", ylabel="efficiency (predicted)", xscale="log", ylim=(0, 1.1), title=machine.name)
    return _save(figure, axes, Path(directory) / "prediction.png")


def _draw_efficiency(study, measured, directory):
    """Efficiency over ranks, with the ideal."""
    figure, axes = _figure(study)
    ranks = [row[0] for row in measured]
    axes.plot(ranks, [row[2] for row in measured], "o-", color=_COLOURS["force"], label="measured")
    axes.axhline(1.0, color="#888888", linewidth=1, label="ideal")
    axes.set(xlabel="ranks", ylabel=f"{study.kind} efficiency", xscale="log", ylim=(0, 1.1 * max(1.0, max(row[2] for row in measured))))
    axes.set_xticks(ranks, [str(count) for count in ranks])
    axes.minorticks_off()
    return _save(figure, axes, directory / "efficiency.png")


def _draw_phases(study, measured, directory):
    """Where the time of a step goes, stacked, per number of ranks."""
    figure, axes = _figure(study)
    labels, below = [str(row[0]) for row in measured], [0.0] * len(measured)
    for name in (*PHASES, "other"):
        shares = [row[3][name] if name in row[3] else max(0.0, 1 - sum(row[3].values())) for row in measured]
        heights = [share * row[1] * 1e3 for share, row in zip(shares, measured)]
        axes.bar(labels, heights, bottom=below, color=_COLOURS[name], label=name)
        below = [a + b for a, b in zip(below, heights)]
    axes.set(xlabel="ranks", ylabel="milliseconds a step")
    return _save(figure, axes, directory / "phases.png")


def _figure(study):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
    axes.set_title(study.title or study.scene)
    return figure, axes


def _save(figure, axes, path):
    import matplotlib.pyplot as plt

    axes.legend(frameon=False)
    figure.savefig(path, dpi=120, metadata={"Software": "pdhpc"})
    plt.close(figure)
    return path
