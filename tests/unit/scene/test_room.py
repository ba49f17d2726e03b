import pytest

from pdhpc.scene import room
from pdhpc.scene.read import parse_scene
from pdhpc.scene.room import check_room
from pdhpc.scene.schema import SceneError
from pdhpc.study.verify.case import plate


def test_what_cannot_fit_is_refused_before_anything_is_made(comm, monkeypatch):
    monkeypatch.setattr(room, "_physical_memory", lambda: 1_000_000)
    check_room(parse_scene(plate((100, 100)), "t"), comm)  # 10,000 particles of at least 73 bytes
    with pytest.raises(SceneError, match=r"^t: particles.spacing = 1 m, which makes about 1.5e\+04 particles or cells of at least 0.0011 GB in all; allowed is what fits into the 0.001 GB"):
        check_room(parse_scene(plate((150, 100)), "t"), comm)
    monkeypatch.setattr(room, "_physical_memory", lambda: 0)
    check_room(parse_scene(plate((150, 100)), "t"), comm)  # where nobody says how much there is, nothing is refused
