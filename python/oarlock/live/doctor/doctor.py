"""All checks of this machine and of a rig, in order."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

from oarlock.live.doctor.check import OK, PROBLEM, Diagnosis
from oarlock.live.doctor.disk import disk
from oarlock.live.doctor.machine import clocks, versions
from oarlock.live.doctor.network import network
from oarlock.live.doctor.permissions import permissions
from oarlock.live.doctor.rig_checks import rig_checks
from oarlock.live.rig import Rig, Source
from oarlock.live.scan.listening import hear
from oarlock.storage.errors import DataError

if TYPE_CHECKING:
    from oarlock._core import Model

_USUAL_PORTS = (8000, 9000)


async def machine_checks(rig: Rig | None, folder: Path) -> list[Diagnosis]:
    """Of this machine.

    Args:
        rig: what is needed; None for a look at all.
        folder: where sessions are recorded.
    """
    sources: Collection[Source] = () if rig is None else rig.sources.values()
    ports = {
        port for one in sources if one.transport == "udp" and isinstance(port := one.options.get("port"), int)
    }
    transports = {one.transport for one in sources}
    lines = [str(one.options.get("device", "")) for one in sources if one.transport == "serial"]
    return [
        *versions(transports),
        await clocks(),
        *disk(folder),
        *network(ports if rig is not None else _USUAL_PORTS, ports),
        *permissions(lines, "ble" in transports),
    ]


def read_rig(file: Path) -> tuple[Rig | None, Model | None, list[Diagnosis]]:
    """A rig and its model, and what is wrong with the file; None for what cannot be read."""
    import oarlock

    try:
        rig = Rig.load(file)
        model = oarlock.load_model(rig.model)
        if rig.calibration is not None:
            oarlock.load_calibration(rig.calibration)
    except (DataError, oarlock.ModelError) as error:
        return None, None, [Diagnosis("rig", PROBLEM, str(error), ("Correct the file, and run this again.",))]
    used = ", with a calibration" if rig.calibration is not None else "; mounts are those of the model"
    text = f"{len(rig.feeds)} streams of {len(rig.sources)} sources for the model {model.name}{used}"
    return rig, model, [Diagnosis("rig", OK, text)]


async def arrival_checks(rig: Rig, model: Model, seconds: float) -> list[Diagnosis]:
    """Of what a rig's sources deliver within some seconds."""
    hearings = await hear(rig.sources.values(), seconds)
    return rig_checks(rig, model, hearings, seconds)
