"""Whether datagrams can reach this machine: its addresses, its ports, who has them, firewalls."""

from __future__ import annotations

import contextlib
import platform
import socket
from collections.abc import Collection, Iterator
from pathlib import Path

from oarlock.live.doctor.check import NOTE, OK, Diagnosis, prevents
from oarlock.live.transports.udp import BUFFER_BYTES

_WAIT_S = 5.0
_OUTSIDE = ("192.0.2.1", 9)  # documentation address (RFC 5737); choosing a route sends nothing
_FEW_BYTES = 256 << 10


def network(ports: Collection[int], rig_ports: Collection[int]) -> Iterator[Diagnosis]:
    """Checks of addresses and UDP ports.

    Args:
        ports: to be tried.
        rig_ports: those of the rig: without them there is no session.
    """
    address = own_address()
    if address is None:
        text = "this machine is in no network; only its own programs can send to it"
        yield Diagnosis("network", NOTE, text, ("Join the sensors' Wi-Fi.",))
    else:
        yield Diagnosis("network", OK, f"this machine is {address}: sensors must send there")
    found = {port: _port(port, address, port in rig_ports) for port in sorted(ports)}
    yield from (check for check in found.values() if check is not None)
    free = ", ".join(str(port) for port, check in found.items() if check is None)
    if free:
        yield Diagnosis("network", OK, f"UDP port {free}: free, and a datagram to oneself arrives")
    yield _buffer()
    yield firewall(ports)


def own_address() -> str | None:
    """The address of this machine in its network; None without one."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one, contextlib.suppress(OSError):
        one.connect(_OUTSIDE)
        return str(one.getsockname()[0])
    return None


def _port(port: int, address: str | None, is_needed: bool) -> Diagnosis | None:
    """What is wrong with a port; None if nothing is."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        try:
            one.bind(("0.0.0.0", port))
        except OSError as error:
            return _taken(port, error.strerror or str(error), is_needed)
        for to in filter(None, ("127.0.0.1", address)):
            if not _arrives(one, to, port):
                text = f"UDP port {port}: a datagram to {to} did not arrive"
                return Diagnosis("network", prevents(is_needed), text, (_allow(port),))
    return None


def _taken(port: int, why: str, is_needed: bool) -> Diagnosis:
    who = holder(port)
    text = f"UDP port {port}: {why.lower()}" + (f"; {who} listens there" if who else "")
    tries = (
        "End that program; it may be a session that still runs.",
        f"Or let the sensors send to another port, and write that in place of {port}.",
    )
    return Diagnosis("network", prevents(is_needed), text, tries)


def _arrives(bound: socket.socket, to: str, port: int) -> bool:
    bound.settimeout(_WAIT_S)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender, contextlib.suppress(OSError):
        sender.sendto(b"oarlock doctor", (to, port))
        own = sender.getsockname()[1]
        while True:  # sensors may send to this port, too
            data, origin = bound.recvfrom(65_536)
            if data == b"oarlock doctor" and origin[1] == own:
                return True
    return False


def holder(port: int) -> str:
    """The program that listens at a UDP port, as Linux tells it; "" if it does not."""
    inodes = set()
    with contextlib.suppress(OSError):
        for line in Path("/proc/net/udp").read_text(encoding="ascii").splitlines()[1:]:
            cells = line.split()
            if int(cells[1].rpartition(":")[2], 16) == port:
                inodes.add(f"socket:[{cells[9]}]")
    for process in Path("/proc").glob("[0-9]*") if inodes else ():
        with contextlib.suppress(OSError):
            if any(str(link.readlink()) in inodes for link in (process / "fd").iterdir()):
                words = (process / "cmdline").read_bytes().decode("utf-8", "replace").replace("\0", " ")
                return f"process {process.name} ({words.strip()[:60]})"
    return ""


def _buffer() -> Diagnosis:
    """How much the kernel keeps while the tracker is busy."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        with contextlib.suppress(OSError):
            one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        granted = one.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
    text = f"the kernel keeps up to {granted / 1e6:.1f} MB of datagrams while this program is busy"
    if granted >= _FEW_BYTES:
        return Diagnosis("network", OK, text)
    tries = (f"sudo sysctl -w net.core.rmem_max={BUFFER_BYTES}",) if platform.system() == "Linux" else ()
    return Diagnosis("network", NOTE, text, tries)


def firewall(ports: Collection[int]) -> Diagnosis:
    """Which firewall there is, and how it lets sensors through."""
    ask = tuple(_allow(port) for port in sorted(ports)[:3])
    name = _firewall_name()
    if not name:
        return Diagnosis(
            "firewall", OK, "neither ufw nor firewalld is on; sudo nft list ruleset shows other rules"
        )
    return Diagnosis("firewall", NOTE, f"{name} may drop what sensors send; if nothing arrives:", ask)


def _firewall_name() -> str:
    if platform.system() != "Linux":
        return f"the firewall of {platform.system().replace('Darwin', 'macOS')}"
    with contextlib.suppress(OSError):
        if "ENABLED=yes" in Path("/etc/ufw/ufw.conf").read_text(encoding="utf-8"):
            return "ufw"
    return "firewalld" if Path("/run/firewalld").exists() else ""


def _allow(port: int) -> str:
    """How a firewall is told to let a port through."""
    system, name = platform.system(), _firewall_name()
    if system == "Darwin":
        return "System Settings, Network, Firewall, Options: allow incoming connections of Python"
    if system == "Windows":
        rule = f'name="oarlock {port}" dir=in action=allow protocol=UDP localport={port}'
        return f"netsh advfirewall firewall add rule {rule}"
    if name == "firewalld":
        return f"sudo firewall-cmd --add-port={port}/udp"
    return f"sudo ufw allow {port}/udp" if name == "ufw" else "sudo nft list ruleset    shows what drops it"
