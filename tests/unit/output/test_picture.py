import numpy as np
import pytest

from pdhpc.output.fields import FieldWriter
from pdhpc.output.history import History
from pdhpc.output.picture import _Body, _Frame, _raster, draw


def run_folder(folder, comm, dim):
    axes = np.meshgrid(*[np.arange(n) + 0.5 for n in (20, 8, 6)[:dim]], indexing="ij")
    x = 1e-3 * np.stack([axis.ravel() for axis in axes], axis=1)
    n = len(x)
    writer = FieldWriter(comm, folder, {})
    writer.write_points(np.arange(n), x, np.ones(n), np.zeros(n))
    damage = (np.abs(x[:, 1] - 4e-3) < 1e-3) * 0.5
    writer.write_frame(3, 1e-6, {"damage": damage, "displacement": 1e-3 * x, "precrack": damage * (x[:, 0] < 5e-3)})
    history = History(folder / "history.csv", ["time [s]", "step", "kinetic_energy [J]", "tip.x [m]", "tip.speed [m/s]", "g.u [m]", "g.f [N]"], comm)
    for number in range(4):
        history.append(dict(zip(history.columns, [number * 1e-6, number, 2.0 * number, 0.01 * number, 100.0, number, number**2])))
    return x, damage


@pytest.mark.parametrize("dim", [2, 3])
def test_every_picture_that_there_is_data_for(tmp_path, comm, dim):
    run_folder(tmp_path, comm, dim)
    drawn = draw(tmp_path, [("load", "g.u [m]", "g.f [N]")])
    assert {path.name for path in drawn} == {"damage.png", "displacement.png", "deformed.png", "energies.png", "tip_tip.png", "curve_load.png"}
    assert all(path.read_bytes()[:4] == b"\x89PNG" and path.stat().st_size > 3000 for path in drawn)
    assert not list(tmp_path.glob("*.part*"))


def test_nothing_to_draw(tmp_path):
    assert draw(tmp_path) == []


def test_a_raster_has_one_pixel_per_particle_whatever_the_chunks(tmp_path, comm, monkeypatch):
    from pdhpc.output import picture

    x, damage = run_folder(tmp_path, comm, 2)
    image, extent = _raster(_Body(tmp_path), _Frame(tmp_path), "damage", (0, 1))
    assert image.shape == (8, 20) and np.array_equal(image.T.ravel(), damage)
    assert np.allclose(extent, (0.0, 0.02, 0.0, 0.008))
    monkeypatch.setattr(picture, "_CHUNK", 7)
    assert np.array_equal(_raster(_Body(tmp_path), _Frame(tmp_path), "damage", (0, 1))[0], image)
