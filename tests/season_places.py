"""Places of seasons for tests: a folder, memory, and a server on 127.0.0.1 that speaks S3."""

from __future__ import annotations

import functools
import logging
import secrets
from pathlib import Path
from typing import Any

import pytest

PAGE = "25"
"""Names in a page of a listing; S3 has 1000."""
KINDS = ("disk", "memory", "s3")


@functools.cache
def server() -> str:
    """Address of the server, which runs until this process ends."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MOTO_S3_DEFAULT_MAX_KEYS", PAGE)
        from moto.server import ThreadedMotoServer

        logging.getLogger("werkzeug").setLevel(logging.ERROR)
        running = ThreadedMotoServer(port=0, verbose=False)
        running.start()
    return f"http://127.0.0.1:{running.get_host_and_port()[1]}"


def use_server(patch: pytest.MonkeyPatch) -> Any:
    """The server is what the environment names; returns its client."""
    keys = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test"}
    where = {"AWS_REGION": "us-east-1", "AWS_DEFAULT_REGION": "us-east-1", "AWS_ENDPOINT_URL": server()}
    for name, value in {**keys, **where, "MOTO_S3_DEFAULT_MAX_KEYS": PAGE}.items():
        patch.setenv(name, value)
    import boto3

    return boto3.client("s3")


def new_bucket(patch: pytest.MonkeyPatch, versions: bool = False) -> tuple[Any, str]:
    """A client and the name of a new bucket."""
    client, bucket = use_server(patch), f"club-{secrets.token_hex(6)}"
    client.create_bucket(Bucket=bucket)
    if versions:
        client.put_bucket_versioning(Bucket=bucket, VersioningConfiguration={"Status": "Enabled"})
    return client, bucket


def new_address(kind: str, folder: Path, patch: pytest.MonkeyPatch) -> str:
    """Address of an empty place of a kind."""
    patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    patch.setenv("XDG_STATE_HOME", str(folder / "state"))
    if kind == "disk":
        return str(folder / "season")
    if kind == "memory":
        pytest.importorskip("obstore")
        return f"memory://{secrets.token_hex(6)}"
    for package in ("obstore", "moto", "boto3"):
        pytest.importorskip(package)
    return f"s3://{new_bucket(patch)[1]}/of/club"
