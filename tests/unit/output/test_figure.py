import json
from types import SimpleNamespace

import numpy as np

from pdhpc.output.figure import figure_of, length_unit, planes_of, rounded, time_text, title_of

BODY = SimpleNamespace(lower=np.zeros(3), upper=np.array([2.0, 1.0, 0.5]), spacing=0.0, dim=3)


def test_three_planes_in_the_proportions_of_the_body():
    figure, axes = figure_of(BODY, planes_of(BODY))
    assert planes_of(BODY) == [(0, 1), (0, 2), (1, 2)] and len(axes) == 3 and figure.get_size_inches()[0] == 9.0
    assert length_unit(BODY) == ("m", 1.0)


def test_numbers_in_words(tmp_path):
    assert [rounded(x) for x in (1.0, 4.9, 5.1, 19.0, 0.03)] == [1.0, 2.0, 5.0, 10.0, 0.02]
    assert [time_text(t) for t in (0.0, 2.0, 3e-3, 4e-6, 5e-9)] == ["0 s", "2 s", "3 ms", "4 µs", "5 ns"]
    assert title_of(tmp_path) == tmp_path.name
    (tmp_path / "run.json").write_text(json.dumps({"title": "A plate"}))
    assert title_of(tmp_path) == "A plate"
