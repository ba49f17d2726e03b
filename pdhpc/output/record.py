"""The output folder and its small files: claimed once, written whole or not at all."""
import contextlib
import errno
import json
import math
import os
import re
import shutil
from pathlib import Path

import numpy as np

OWN_FILES = ("run.json", "run.log", "history.csv", "fields.h5", "fields.xdmf", "enrichment.h5")
OWN_FOLDERS = ("fields", "checkpoint")
PICTURES = "*.png"
_WRITTEN = re.compile(r"(points|frame_\d+|step_\d+)\.h5(\.part)?")  # in OWN_FOLDERS
_LOCKED = ".lock"


class OutputError(RuntimeError):
    """Output that cannot be written or read: one sentence with the path and the reason. exit_code 2 marks a folder the user must not reuse."""

    exit_code = 1


def refusal(sentence):
    """Return the OutputError of a folder or a file that must not be used as it is: exit_code 2."""
    error = OutputError(sentence)
    error.exit_code = 2
    return error


def reason(error):
    """Return the system's word on an error, or the first line of the library's."""
    if isinstance(error, KeyError):
        word = str(error.args[0])
        return word if " " in word else f"{word} is missing"
    lines = str(error).splitlines()
    return getattr(error, "strerror", None) or (lines[0].split(": time =")[0] if lines else type(error).__name__)


@contextlib.contextmanager
def unreadable(refuse, *known):
    """Raise what refuse(reason) makes of all that h5py, json and numpy raise at damaged files; an OutputError, and `known` ones, stay what they are."""
    try:
        yield
    except (OutputError, *known):
        raise
    except (OSError, RuntimeError, KeyError, ValueError, IndexError, TypeError, AttributeError, OverflowError, MemoryError) as error:
        raise refuse(reason(error)) from error


def check_directory(path, overwrite):
    """Raise an OutputError unless a run may be written to `path`; change nothing."""
    path = Path(path)
    if path.exists() and not path.is_dir():
        raise refusal(f"{path}: is a file; allowed is a folder, or a name that does not exist yet")
    held = [name for name in OWN_FILES + OWN_FOLDERS if (path / name).exists()]
    if held and not overwrite:
        raise refusal(f"{path}: holds another run ({held[0]}); allowed is an empty or new folder, or --overwrite")
    existing = next(folder for folder in [path, *path.absolute().parents] if folder.exists())
    if not existing.is_dir():
        raise refusal(f"{path}: {existing} is a file; allowed is a path below folders")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise refusal(f"{path}: {existing} is not writable; allowed is a folder you may write to")


class Lock:
    """A folder that only one job writes to: held by rank 0, let go by the system when its process ends, however that happens.

    warning : None, or what to say where the file system knows no locks.
    """

    def __init__(self):
        self._held, self.warning = None, None

    def take(self, path):
        """Lock a folder, which is created if it is not there.

        Raises
        ------
        OutputError: another job holds it, or the folder cannot be made; exit_code 2.
        """
        try:
            Path(path).mkdir(parents=True, exist_ok=True)
            try:
                self._hold(path, os.O_RDONLY)
            except OSError as error:
                if error.errno != errno.EBADF:
                    raise
                self.release()
                self._hold(Path(path) / _LOCKED, os.O_RDWR | os.O_CREAT)  # on NFS only what is open for writing can be locked
        except BlockingIOError:
            self.release()
            raise refusal(f"{path}: another job writes to it now; allowed is another folder, or to wait for its end") from None
        except OSError as error:
            if self._held is None:
                raise refusal(f"{path}: cannot be used as output folder ({error.strerror})") from error
            self.warning = f"{path}: this file system knows no locks ({error.strerror}): nothing keeps a second job from writing there"

    def _hold(self, path, flags):
        import fcntl

        self._held = os.open(path, flags)
        fcntl.flock(self._held, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def release(self):
        """Let the folder go."""
        if self._held is not None:
            os.close(self._held)
            self._held = None


def claim_directory(path, overwrite):
    """Make `path` an empty run folder: create it, or, with overwrite, remove the files a former run wrote there and nothing else."""
    check_directory(path, overwrite)
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
        for name in OWN_FILES:
            for file in (name, name + ".part"):
                (path / file).unlink(missing_ok=True)
        for picture in path.glob(PICTURES):
            if picture.is_file() and (picture.stem in _drawn() or picture.stem.startswith(("curve_", "tip_"))):
                picture.unlink()
        for name in OWN_FOLDERS:
            folder = path / name
            if folder.is_symlink():
                folder.unlink()
            elif folder.is_dir():
                for file in folder.iterdir():
                    if _WRITTEN.fullmatch(file.name):
                        file.unlink()
                if not any(folder.iterdir()):
                    shutil.rmtree(folder)
    except OSError as error:
        raise refusal(f"{path}: cannot be used as output folder ({error.strerror})") from error


def _drawn():
    """Names of the pictures that pdhpc draws."""
    return ("damage", "deformed", "displacement", "energies", "enrichment", "fracture", "patches", "stress", "tip")


def part_name(path):
    """Return the name that a file has until it is complete. Local."""
    return path.with_name(f"{path.stem}.part{path.suffix}" if path.suffix == ".png" else f"{path.name}.part")


def part_of(path):
    """Return part_name, where what stands there is removed, as it may be a link to another place. Local.

    Raises
    ------
    OSError.
    """
    part = part_name(path)
    part.unlink(missing_ok=True)
    return part


def write_text(path, text):
    """Replace a file by `text` in one step: readers see the old content or the new, never a part."""
    path = Path(path)
    try:
        part = part_of(path)
        with open(part, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror})") from error


def write_json(path, data):
    """Replace a JSON file in one step, see `plain`."""
    write_text(path, json.dumps(plain(data), indent=2, allow_nan=False) + "\n")


def note_failure(directory, error, **state):
    """Let the run.json of a run that goes on say that it failed, if it can be read and written; state : what else is known now. Local."""
    path = Path(directory) / "run.json"
    with contextlib.suppress(OSError, ValueError, OutputError):
        record = json.loads(path.read_text(encoding="utf-8"))
        write_json(path, {**record, "status": "failed", "error": f"{type(error).__name__}: {error}", **state})


def plain(value):
    """Return a value as JSON can hold it: numpy values plain ones, NaN null, infinities the texts "inf" and "-inf"."""
    if isinstance(value, dict):
        return {str(key): plain(each) for key, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(each) for each in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None if math.isnan(value) else ("inf" if value > 0 else "-inf")
    return value
