"""The outputs of a session: those of its rig file, and those of the command line."""

from __future__ import annotations

from typing import TYPE_CHECKING

from oarlock.live.outputs.datagrams import Datagrams, json_line, osc_bundle
from oarlock.live.outputs.output import Output, Way
from oarlock.live.outputs.table import Outputs, destination

if TYPE_CHECKING:
    from oarlock._core import Model


def outputs_of(model: Model, rate_hz: float | None, *wanted: Outputs) -> list[Output]:
    """An output for each destination.

    Args:
        model: of the body.
        rate_hz: of the estimates; None if unknown.
        wanted: their destinations; one that is named twice gets everything once.

    Raises:
        DataError: pylsl is missing.
    """
    pairs = dict.fromkeys(pair for one in wanted for pair in one.destinations())
    return [Output(_way(kind, text, model, rate_hz), model) for kind, text in pairs]


def _way(kind: str, text: str, model: Model, rate_hz: float | None) -> Way:
    if kind == "lsl":
        from oarlock.live.outputs.lsl import LslStreams

        return LslStreams(text, model, rate_hz)
    host, port = destination(text, kind)
    if kind == "osc":
        return Datagrams(f"OSC to {host}:{port}", host, port, osc_bundle)
    return Datagrams(f"JSON lines to {host}:{port}", host, port, json_line)
