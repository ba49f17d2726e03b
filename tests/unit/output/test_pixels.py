import numpy as np

from pdhpc.output import pixels
from pdhpc.output.pixels import Body, Frame, pixels_of, show_damage
from tests.unit.output.test_picture import run_folder


def test_one_pixel_per_particle_whatever_the_chunks(tmp_path, comm, monkeypatch):
    x, damage = run_folder(tmp_path, comm, 2)
    image, extent = pixels_of(Body(tmp_path), Frame(tmp_path), "damage", (0, 1))
    assert image.shape == (8, 20) and np.array_equal(image.T.ravel(), damage)
    assert np.allclose(extent, (0.0, 0.02, 0.0, 0.008))
    monkeypatch.setattr(pixels, "_CHUNK", 7)
    assert np.array_equal(pixels_of(Body(tmp_path), Frame(tmp_path), "damage", (0, 1))[0], image)


def test_what_is_whole_may_be_left_out(tmp_path, comm):
    """Half of the particles within 1 mm of the middle line are damaged by 0.5, those left of 5 mm before the run: 2 rows of 20."""
    from matplotlib.figure import Figure

    run_folder(tmp_path, comm, 2)
    axes = Figure().subplots()
    shown = [np.ma.filled(show_damage(axes, Body(tmp_path), Frame(tmp_path), (0, 1), 1e3, least).get_array(), np.nan) for least in (None, 0.01)]
    assert np.isfinite(shown[0]).all() and np.isfinite(shown[1]).sum() == 40 and np.nanmin(shown[1]) == 0.5
    cut = axes.images[1].get_array()[..., 3]
    assert (cut > 0).sum() == 2 * 5


def test_particles_off_a_lattice_cover_the_body(tmp_path, comm):
    """Points shaken by a fifth of their distance: lattice lines lie close together, and squares by volume fill the plate without the hole left open."""
    import json

    from pdhpc.output.fields import FieldWriter

    grid = np.stack(np.meshgrid(np.arange(40.0), np.arange(20.0), indexing="ij"), axis=-1).reshape(-1, 2)
    grid = grid[np.hypot(*(grid - [20.0, 10.0]).T) > 4.0]
    points = 1e-3 * (grid + np.random.default_rng(0).uniform(-0.2, 0.2, grid.shape))
    (tmp_path / "run.json").write_text(json.dumps({"scene": {"particles": {"thickness": 0.01}}}))
    writer = FieldWriter(comm, tmp_path, {})
    writer.write_points(np.arange(len(points)), points, np.full(len(points), 1e-6 * 0.01), np.zeros(len(points)))
    writer.write_frame(0, 0.0, {"damage": np.linspace(0.1, 1.0, len(points))})
    body = Body(tmp_path)
    assert not body.on_lattice and 1e-3 < body.spacing < 2e-3 and next(body.side_chunks()).shape == (len(points),)
    image, extent = pixels_of(body, Frame(tmp_path), "damage", (0, 1))
    held = np.isfinite(image)
    assert held.mean() > 0.9 and not held[image.shape[0] // 2, image.shape[1] // 2] and np.nanmax(image) == 1.0 and np.nanmin(image) < 0.15
