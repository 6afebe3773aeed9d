"""Files of one athlete under a key of its own: AES-GCM of whole files; without the key they are unreadable.

A sealed file begins with `MAGIC` and the name of its key, which is made of the key. Hashes are of the sealed files, so
`check` needs no key. What stays readable: commit records with their texts, results and tables.
"""

from __future__ import annotations

import hashlib
import os
import secrets
from pathlib import Path
from typing import Any

from oarlock.storage.errors import DataError
from oarlock.storage.toml import TomlTable, write_toml

MAGIC = b"oarlock sealed 1\n"
KEYS_VARIABLE = "OARLOCK_SEASON_KEYS"
"""Names the folder of keys, which lies outside the season."""
_NAME, _NONCE = 16, 12
_FORMAT = 1


def is_sealed(contents: bytes) -> bool:
    """Whether these are the bytes of a sealed file."""
    return contents.startswith(MAGIC)


class Key:
    """The key of an athlete's files.

    Args:
        secret: 32 random bytes.
    """

    def __init__(self, secret: bytes) -> None:
        self.secret = secret
        self.name = hashlib.sha256(b"oarlock key\0" + secret).hexdigest()[:_NAME]

    def sealed(self, contents: bytes) -> bytes:
        """The contents under this key."""
        nonce = secrets.token_bytes(_NONCE)
        head = MAGIC + self.name.encode()
        return head + nonce + bytes(_aes(self.secret).encrypt(nonce, contents, head))

    def opened(self, contents: bytes, where: str) -> bytes:
        """What was sealed.

        Raises:
            DataError: it was sealed under another key, or has changed since.
        """
        from cryptography.exceptions import InvalidTag

        size = len(MAGIC) + _NAME
        head, nonce, body = contents[:size], contents[size : size + _NONCE], contents[size + _NONCE :]
        if (name := key_name(contents)) != self.name:
            raise DataError(f"{where}: is encrypted with the key {name}; the key given is {self.name}")
        try:
            return bytes(_aes(self.secret).decrypt(nonce, body, head))
        except (InvalidTag, ValueError):
            raise DataError(
                f"{where}: is encrypted and was changed afterwards; restore it from a backup"
            ) from None

    def write(self, folder: Path) -> Path:
        """Write the key into a folder, readable for its owner alone.

        Raises:
            DataError: it cannot be written.
        """
        file = folder / f"{self.name}.toml"
        write_toml(file, {"format": _FORMAT, "key": self.secret.hex()})
        file.chmod(0o600)
        return file

    @classmethod
    def read(cls, file: Path) -> Key:
        """The key of a file.

        Raises:
            DataError: there is none, or it is damaged.
        """
        table = TomlTable.read(file)
        table.check_format(_FORMAT)
        try:
            secret = bytes.fromhex(table.string("key"))
        except ValueError:
            secret = b""
        if len(secret) != 32:
            raise DataError(f"{file}: is not a key; expected 64 hexadecimal digits")
        return cls(secret)


def new_key() -> Key:
    """A random key.

    Raises:
        DataError: `cryptography` is not installed.
    """
    _aes(secret := os.urandom(32))
    return Key(secret)


def keys_folder() -> Path | None:
    """The folder of keys that the environment names; None without one."""
    return Path(found) if (found := os.environ.get(KEYS_VARIABLE)) else None


def key_called(name: str, where: str) -> Key:
    """A key of the folder of keys.

    Raises:
        DataError: it is not there.
    """
    folder = keys_folder()
    file = None if folder is None else folder / f"{name}.toml"
    if file is None or not file.exists():
        raise DataError(
            f"{where}: is encrypted, and its key {name} was not found. Set {KEYS_VARIABLE} to the folder that contains "
            f"{name}.toml. Without the key nobody can read the file."
        )
    return Key.read(file)


def opened(contents: bytes, where: str) -> bytes:
    """The contents of a file of a recording, sealed or not; the key is in the folder that the environment names.

    Raises:
        DataError: the key is not there, or the file has changed.
    """
    return key_called(key_name(contents), where).opened(contents, where) if is_sealed(contents) else contents


def key_name(contents: bytes) -> str:
    """The name of the key under which a file is sealed."""
    return contents[len(MAGIC) : len(MAGIC) + _NAME].decode("ascii", "replace")


def _aes(secret: bytes) -> Any:
    try:
        from cryptography.hazmat.primitives.ciphers.aead import AESGCM
    except ImportError:
        raise DataError('sealed files need one more package: pip install "oarlock[season]"') from None
    return AESGCM(secret)
