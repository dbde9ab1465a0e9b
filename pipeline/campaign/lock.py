"""One writer of a campaign store at a time."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pipeline.console.errors import DataError


@contextmanager
def writing(store: str | Path) -> Iterator[None]:
    """Keep other processes from writing a store.

    The lock is the kernel's, on a hidden file beside the store: it ends with the process, however
    that ends.

    Parameters
    ----------
    store : str or Path
        It need not exist.

    Raises
    ------
    DataError
        If another process writes it, or the file cannot be made.
    """
    place = Path(store).resolve()  # one lock for a store with two names
    path = place.with_name(f".{place.name}.lock")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = _locked(path)
    except BlockingIOError:
        raise DataError(f"campaign.store = {store}: another process is writing it") from None
    except OSError as error:
        raise DataError(f"campaign.store = {store}: cannot be written ({error.strerror})") from None
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(file)


def _locked(path: Path) -> int:
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # whoever had it before may have removed the file between the two lines above
            if path.exists() and os.path.samestat(os.fstat(file), path.stat()):
                return file
        except BaseException:
            os.close(file)
            raise
        os.close(file)
