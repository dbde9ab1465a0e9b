"""The manifest of a store: size and digest of every file, so that no damage is taken for data.

Zarr's own checksums (CRC-32C of every chunk) tell a chunk that was changed, but not one that is
another campaign's, or is gone where nothing counts as zero; nor do they cover its metadata. The
manifest names every file of a store with its SHA-256, and has one of itself. The writer says there
which files it is about to change, changes them, and enters what they are; of a writer that was
killed in between these files alone are taken by their own checksums.
"""

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.console.output import SIGNATURE, digest, replacing

NAME = "status/manifest.json"
"""Within an array's folder: beside the arrays zarr would take it for one, and warn."""
ROOT = "zarr.json"
"""Names path and batch, so it has its own digest, and the manifest is the same wherever it lies."""
_FIRST = "status/"
_TRIES = 5
"""Looks at a store that another process writes to meanwhile."""


@dataclass(frozen=True)
class Manifest:
    """What a store's files are.

    Attributes
    ----------
    fingerprint : str
        Of the campaign.
    files : dict of str to str
        SHA-256 by path within the store.
    writing : list of str
        Files that were about to change when it was written.
    """

    fingerprint: str
    files: dict[str, str]
    writing: list[str]


@dataclass(frozen=True)
class Damage:
    """A file that is not as it was written.

    Attributes
    ----------
    file : str
        Path within the store.
    why : str
    """

    file: str
    why: str


def read(path: Path) -> Manifest | None:
    """Manifest of a store, None where there is none.

    Raises
    ------
    ValueError
        If it is not as it was written.
    """
    try:
        text = (path / NAME).read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeError):
        raise ValueError("cannot be read") from None
    try:
        whole = json.loads(text)
        said, content = whole["sha256"], whole["content"]
        if said != digest(content):
            raise ValueError
        return Manifest(**content)
    except (ValueError, KeyError, TypeError):
        raise ValueError("is not as it was written") from None


def seal(path: Path, fingerprint: str) -> None:
    """Enter all files of a store as they are."""
    files = {name: _digest((path / name).read_bytes()) for name in _names(path)}
    _write(path, Manifest(fingerprint, files, []))


def sign(path: Path) -> None:
    """Enter the digest of a store's root in its attributes."""
    file = path / ROOT
    about = json.loads(file.read_text(encoding="utf-8"))
    about["attributes"][SIGNATURE] = _root_digest(about)
    with replacing(file) as beside:
        beside.write_text(json.dumps(about, indent=2), encoding="utf-8")


def _root_digest(about: Any) -> str:
    rest = {key: value for key, value in about["attributes"].items() if key != SIGNATURE}
    return digest(about | {"attributes": rest})


def go_on(path: Path, fingerprint: str) -> None:
    """Enter what a writer that was killed left, or all of a store of before."""
    if read(path) is None:
        sign(path)
        seal(path, fingerprint)
    else:
        end(path)


def begin(path: Path, names: Iterable[str]) -> None:
    """Say which files are about to change."""
    about = _of_store(path)
    _write(path, Manifest(about.fingerprint, about.files, sorted({*about.writing, *names})))


def end(path: Path) -> None:
    """Enter what the files became that were about to change."""
    about = _of_store(path)
    files = dict(about.files)
    for name in about.writing:
        files.pop(name, None)
        if name != ROOT and (path / name).is_file():
            files[name] = _digest((path / name).read_bytes())
    _write(path, Manifest(about.fingerprint, files, []))


def load(path: Path) -> tuple[dict[str, bytes], list[Damage]]:
    """All files of a store, and those that are not as they were written.

    A process that writes to it meanwhile is no damage: a run counts from the moment its status
    says so, therefore that is read before its numbers are.

    Returns
    -------
    files : dict of str to bytes
        But for the manifest.
    damages : list of Damage
        None of a store without manifest.
    """
    files: dict[str, bytes] = {}
    found: list[Damage] = []
    for _ in range(_TRIES):
        before = _bytes(path / NAME)
        names = sorted([*_names(path), ROOT], key=lambda name: not name.startswith(_FIRST))
        files = {name: content for name in names if (content := _bytes(path / name)) is not None}
        try:
            about = read(path)
            found = _differences(files, about) if about else []
        except ValueError as error:
            found = [Damage(NAME, str(error))]
        if not found or _bytes(path / NAME) == before:
            break
    return files, found


def _differences(files: Mapping[str, bytes], about: Manifest) -> list[Damage]:
    trusted = {*about.writing}
    out = []
    if ROOT not in trusted:
        out += _of_root(files.get(ROOT), about.fingerprint)
    for name, written in about.files.items():
        if name in trusted:
            continue
        if name not in files:
            out.append(Damage(name, "is missing"))
        elif _digest(files[name]) != written:
            out.append(Damage(name, "is not as it was written"))
    known = {*about.files, *trusted, ROOT}
    return out + [Damage(name, "is no file of this store") for name in files if name not in known]


def _of_root(content: bytes | None, fingerprint: str) -> list[Damage]:
    if content is None:
        return [Damage(ROOT, "is missing")]
    try:
        found = json.loads(content)
        attributes = found["attributes"]
        if attributes[SIGNATURE] != _root_digest(found):
            return [Damage(ROOT, "is not as it was written")]
        if attributes["fingerprint"] != fingerprint:
            return [Damage(ROOT, "is another campaign's")]
    except (ValueError, KeyError, TypeError):
        return [Damage(ROOT, "is not as it was written")]
    return []


def _of_store(path: Path) -> Manifest:
    """Manifest of a store that is being written, which has one."""
    about = read(path)
    if about is None:
        raise ValueError(f"{path} has no manifest")
    return about


def _names(path: Path) -> list[str]:
    """Files of a store but for root and manifest, and what a writer that was killed left."""
    out, above = [], len(f"{path}/")
    for folder, _, files in os.walk(path):
        inside = f"{folder}/"[above:]
        out += [f"{inside}{file}" for file in files if ".partial" not in file]
    return sorted(name for name in out if name not in (NAME, ROOT))


def _bytes(file: Path) -> bytes | None:
    try:
        return file.read_bytes()
    except OSError:
        return None


def _write(path: Path, about: Manifest) -> None:
    content = vars(about) | {"files": dict(sorted(about.files.items()))}
    whole = {"sha256": digest(content), "content": content}
    with replacing(path / NAME) as file:
        file.write_text(json.dumps(whole, indent=1) + "\n", encoding="utf-8")


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
