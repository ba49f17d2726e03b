import numpy as np
import pytest

from pdhpc.geometry import table_file
from pdhpc.geometry.table_file import TableFile


def read(folder, text, dim=2):
    path = folder / "points.txt"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    file = TableFile(path, dim)
    parts = list(file.pieces())
    return [np.concatenate(each) for each in zip(*parts)] + [file]


def test_blanks_commas_and_comments(tmp_path):
    points, volume, block, file = read(tmp_path, "# x y volume block\n\n0.1, 0.2, 3e-3, 7\n\t1  2 4 -1 # the last one\r\n0.1,0.3 5 7")
    assert points.tolist() == [[0.1, 0.2], [1.0, 2.0], [0.1, 0.3]] and volume.tolist() == [3e-3, 4.0, 5.0] and block.tolist() == [7, -1, 7]
    assert file.count == 3 and file.blocks == {7, -1}


def test_three_dimensions_and_the_last_bit(tmp_path):
    place = [0.1 + 0.2, 1 / 3, np.nextafter(1.0, 2.0)]
    points, _, _, _ = read(tmp_path, "\ufeff" + " ".join(map(repr, place)) + " 1 1\n", 3)
    assert points.tolist() == [place]


def test_pieces_join_at_any_byte(tmp_path, monkeypatch):
    rows = np.random.default_rng(0).random((200, 2)).tolist()
    text = "".join(f"{x!r}, {y!r} 1 {k}\n# {k}\n" for k, (x, y) in enumerate(rows))
    for size in (64, 97, 4096):
        monkeypatch.setattr(table_file, "_BLOCK", size)
        points, _, block, _ = read(tmp_path, text)
        assert points.tolist() == rows and block.tolist() == list(range(200))


@pytest.mark.parametrize("text, words", [
    ("", "has no rows"), ("# nothing\n\n", "has no rows"), ("0 0 1 1\n0 0 1\n", "3 columns in line 2; in 2D a row has 4: x, y, volume, block"),
    ("# a\n0 0 0 1 1\n", "5 columns in line 2"), ("0 0 1 1\n0 zero 1 1\n", "no numbers .* in line 2: 0 zero 1 1"), ("nan 0 1 1", "not finite in line 1"),
    ("0 inf 1 1", "not finite in line 1"), ("0 0 0 1", "the volume 0 m.3 in line 1"), ("0 0 1 1\n\n0 0 -2 1", "the volume -2 m.3 in line 3"), ("0 0 1 1.5", "the block 1.5"),
    ("0 0 1 1e300", "the block 1e.300"), ("0,,1,1\n", "3 columns in line 1"), (b"\x80\x81", "not a text"), (b"0 0 1 1\n" * 9 + b"\0\0\n", "1 column in line 10"),
    ("0 0 1 1 " * 20_000, "longer than 65536"), ("__import__('os').getcwd() 0 1 1", "no numbers"),
])
def test_broken_tables(tmp_path, text, words):
    with pytest.raises(ValueError, match=words) as caught:
        read(tmp_path, text)
    assert str(caught.value).startswith("the table ") and "points.txt" in str(caught.value) and "\n" not in str(caught.value)


def test_lines_are_counted_across_pieces(tmp_path, monkeypatch):
    monkeypatch.setattr(table_file, "_BLOCK", 64)
    with pytest.raises(ValueError, match="not finite in line 78"):
        read(tmp_path, "0 0 1 1\n" * 77 + "0 nan 1 1\n")


def test_no_file(tmp_path):
    for path in (tmp_path / "none.txt", tmp_path):
        with pytest.raises(ValueError, match="there is no table"):
            next(TableFile(path, 2).pieces())
