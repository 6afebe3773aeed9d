"""`oarlock live doctor`: why nothing comes, and what to try."""

import json
import os
import socket
import sys

import numpy as np
import pytest
from while_listening import datagrams, while_listening
from wire_samples import UNIT, json_lines, ngimu

from command_line import run
from oarlock.live.doctor import machine, network, permissions
from oarlock.live.doctor.check import NOTE, OK, PROBLEM
from oarlock.live.doctor.disk import disk
from oarlock.live.doctor.rig_checks import rig_checks
from oarlock.live.reading import Packet
from oarlock.live.rig import Feed, Rig, Source, streams_of
from oarlock.live.scan.listening import Hearing
from oarlock.live.transports.udp import free_port

ADDRESS = "10.0.0.7:5000"


def rig_of(model, streams, **keys):
    """Streams from devices of their own name, by JSON lines."""
    kinds = streams_of(model)
    source = Source("units", "lines", "udp", {"port": 9000})
    feeds = tuple(Feed(s, kinds[s][0], "units", s, kinds[s][1], 100.0) for s in streams)
    return Rig("sculler", None, {"units": source}, feeds, **keys)


def heard(rig, *several, late_ms=0.0):
    """The packets of devices, each with the time at which it came."""
    rng = np.random.default_rng(3)
    found = Hearing(rig.sources["units"], state="listens at port 9000")
    for data in several:
        for k, one in enumerate(data):
            arrival_ns = round(1e9 * (k / 100 + 1e-3 * rng.exponential(late_ms)))
            found.take(Packet("units", ADDRESS, "", arrival_ns, one))
    return [found]


def checks_of(model, rig, hearings):
    """State and text by what was looked at; findings on one thing are joined."""
    found = {}
    for check in rig_checks(rig, model, hearings, 2.0):
        state, text = found.get(check.about, (OK, ""))
        worst = max(state, check.state, key=[OK, NOTE, PROBLEM].index)
        found[check.about] = worst, " ".join([text, check.text, *check.tries])
    return found


def test_all_is_well_where_all_arrives(sculler):
    rig = rig_of(sculler, ("back", "seat"))
    sent = [json_lines("back", UNIT), json_lines("seat", {"value": 0.3})]
    found = checks_of(sculler, rig, heard(rig, *sent))
    assert {about: state for about, (state, _) in found.items()} == {
        "source units": OK,
        "stream back": OK,
        "stream seat": OK,
    }
    assert "100 Hz" in found["stream back"][1] and "400 packets" in found["source units"][1]


def test_a_silent_source_is_one_problem(sculler):
    rig = rig_of(sculler, ("back", "seat"))
    found = checks_of(sculler, rig, heard(rig))
    state, text = found["source units"]
    assert state == PROBLEM and "nothing arrived in 2 s" in text and "listens at port 9000" in text
    assert "set to send to the address" in text
    assert found["streams"][0] == PROBLEM and "back, seat" in found["streams"][1]


def test_a_device_with_another_name_is_suggested(sculler):
    rig = rig_of(sculler, ("r_forearm",))
    state, text = checks_of(sculler, rig, heard(rig, json_lines("r_forarm", UNIT)))["stream r_forearm"]
    assert state == PROBLEM and 'no device "r_forearm"' in text and 'Did you mean "r_forarm"?' in text


def test_a_device_that_feeds_nothing_is_named(sculler):
    rig = rig_of(sculler, ("back",))
    sent = [json_lines("back", UNIT), json_lines("stranger", UNIT)]
    state, text = checks_of(sculler, rig, heard(rig, *sent))["source units"]
    assert state == NOTE and "feed nothing: stranger (gyro, accel, mag)" in text


@pytest.mark.parametrize(
    ("stream", "values", "state", "expected"),
    [
        ("back", {"quat_wxyz": [1, 0, 0, 0]}, PROBLEM, "sends orientation, and not gyro, accel"),
        ("back", {"gyro_rad_s": [0, 0, 0]}, PROBLEM, "no accel"),
        ("back", {k: UNIT[k] for k in ("gyro_rad_s", "accel_m_s2")}, NOTE, "no mag"),
        ("back", UNIT | {"accel_m_s2": [0, 0, 1.0]}, NOTE, "multiples of gravity"),
        ("seat", {"place": 0.3}, PROBLEM, 'Write value = "..." with one of: place'),
        ("seat", {"value": 310.0}, NOTE, "Write scale and offset"),
        ("r_oar_phi", {"value": 60.0}, NOTE, "Write scale and offset"),
    ],
)
def test_values_that_cannot_be_used_are_explained(sculler, stream, values, state, expected):
    rig = rig_of(sculler, (stream,))
    found = checks_of(sculler, rig, heard(rig, json_lines(stream, values)))[f"stream {stream}"]
    assert found[0] == state and expected in found[1]


def test_rates_and_losses_are_compared_with_what_the_rig_expects(sculler):
    rig = rig_of(sculler, ("back", "l_forearm"))
    lossy = [one for k, one in enumerate(json_lines("l_forearm", UNIT)) if k % 10]
    found = checks_of(sculler, rig, heard(rig, json_lines("back", UNIT, rate_hz=50.0), lossy))
    assert found["stream back"][0] == NOTE and "50 Hz, and rate_hz says 100" in found["stream back"][1]
    state, text = found["stream l_forearm"]
    assert state == NOTE and "9.5 % lost" in text  # the first of twenty is not known to be missing


def test_readings_that_come_later_than_estimates_wait_are_told(sculler):
    rig = rig_of(sculler, ("back",), wait_s=0.03)
    found = checks_of(sculler, rig, heard(rig, json_lines("back", UNIT), late_ms=20.0))
    assert found["stream back"][0] == NOTE and "wait_ms" in found["stream back"][1]
    patient = rig_of(sculler, ("back",), wait_s=0.5)
    assert (
        checks_of(sculler, patient, heard(patient, json_lines("back", UNIT), late_ms=20.0))["stream back"][0]
        == OK
    )


def test_the_format_that_fits_is_suggested(sculler):
    rig = rig_of(sculler, ("back",))
    state, text = checks_of(sculler, rig, heard(rig, ngimu()))["source units"]
    assert state == PROBLEM and 'write format = "ngimu"' in text


def test_messages_that_cannot_be_decoded_and_an_empty_battery_are_told(sculler):
    rig = rig_of(sculler, ("back",))
    found = checks_of(
        sculler, rig, heard(rig, json_lines("back", {**UNIT, "battery_percent": 7}), [b'{"device": "ba'] * 20)
    )
    state, text = found["source units"]
    assert state == NOTE and "20 messages (9 %)" in text and "back: battery 7 %" in text


def write_rig(file, port, streams=("back",)):
    feeds = "".join(f'[streams.{s}]\nsource = "units"\ndevice = "{s}"\nrate_hz = 100\n' for s in streams)
    head = 'format = 1\nmodel = "sculler"\n[sources.units]\nformat = "lines"\ntransport = "udp"\n'
    file.write_text(f"{head}port = {port}\n{feeds}")
    return file


def test_the_verb_says_whether_a_session_can_begin(tmp_path, monkeypatch):
    port = free_port()
    rig = write_rig(tmp_path / "rig.toml", port)
    while_listening(monkeypatch, datagrams(port, json_lines("back", UNIT)))
    said = run("live", "doctor", rig, "--out", tmp_path).stdout
    assert f"oarlock live run {rig}" in " ".join(said.split()) and "100 Hz" in said
    while_listening(monkeypatch)
    said = run("live", "doctor", rig, "--out", tmp_path, status=1).stdout
    assert "nothing arrived" in said and "prevent a session" in said
    told = json.loads(run("live", "doctor", rig, "--json", "--out", tmp_path, status=1).stdout)
    assert told["problems"] == sum(check["state"] == "problem" for check in told["checks"]) == 2


def test_a_port_that_another_program_has_is_a_problem(tmp_path, monkeypatch):
    while_listening(monkeypatch)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("0.0.0.0", 0))
        port = one.getsockname()[1]
        rig = write_rig(tmp_path / "rig.toml", port)
        said = " ".join(run("live", "doctor", rig, "--out", tmp_path, status=1).stdout.split())
        assert f"UDP port {port}: address already in use" in said and "End that program" in said
        assert network.holder(free_port()) == ""
        if sys.platform == "linux":
            assert network.holder(port).startswith(f"process {os.getpid()} (")


def test_a_rig_file_that_is_wrong_is_a_problem(tmp_path, monkeypatch):
    while_listening(monkeypatch)
    rig = write_rig(tmp_path / "rig.toml", 9000, ("bakc",))
    said = " ".join(run("live", "doctor", rig, "--out", tmp_path, status=1).stdout.split())
    assert 'Did you mean "back"?' in said


def test_without_a_rig_it_looks_at_this_machine(tmp_path):
    done = json.loads(run("live", "doctor", "--json", "--out", tmp_path).stdout)
    assert {"versions", "clock", "disk", "network", "firewall"} <= {
        check["about"] for check in done["checks"]
    }
    assert done["problems"] == 0


def test_a_missing_extra_is_a_problem_only_for_a_rig_that_needs_it(monkeypatch):
    def missing(name):
        raise machine.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(machine.metadata, "version", missing)
    found = {check.tries: check.state for check in machine.versions({"ble"}) if check.tries}
    assert found[("pip install 'oarlock[ble]'",)] == PROBLEM
    assert found[("pip install 'oarlock[lsl]'",)] == NOTE


def test_a_disk_without_room_or_without_permission_is_a_problem(tmp_path, monkeypatch):
    assert {check.state for check in disk(tmp_path / "new" / "folder")} <= {OK, NOTE}
    monkeypatch.setattr(
        "oarlock.live.doctor.disk.shutil.disk_usage", lambda place: type("U", (), {"free": 10**6})()
    )
    room, _ = disk(tmp_path)
    assert room.state == PROBLEM and "--out" in room.tries[0]

    def refuse(dir):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("oarlock.live.doctor.disk.tempfile.TemporaryFile", refuse)
    assert disk(tmp_path)[1].state == PROBLEM


@pytest.mark.parametrize(
    ("system", "name", "expected"),
    [
        ("Windows", "", "netsh advfirewall"),
        ("Darwin", "", "System Settings"),
        ("Linux", "ufw", "sudo ufw allow 9000/udp"),
        ("Linux", "firewalld", "sudo firewall-cmd --add-port=9000/udp"),
    ],
)
def test_each_system_has_its_own_firewall(monkeypatch, system, name, expected):
    monkeypatch.setattr(network.platform, "system", lambda: system)
    if name:
        monkeypatch.setattr(network, "_firewall_name", lambda: name)
    check = network.firewall([9000])
    assert check.state == NOTE and expected in check.tries[0]


def test_a_line_that_this_user_may_not_open_is_explained(tmp_path, monkeypatch):
    monkeypatch.setattr(permissions.platform, "system", lambda: "Linux")
    monkeypatch.setattr(permissions, "_LINES", ())
    monkeypatch.setattr(permissions, "_bluetooth", lambda is_needed: ())
    line = tmp_path / "ttyUSB0"

    def check():
        (found,) = permissions.permissions([str(line)], False)
        return found

    assert check().state == PROBLEM and "is not there" in check().text
    line.write_text("")
    assert check().state == OK
    monkeypatch.setattr(permissions.os, "access", lambda path, mode: False)
    assert check().state == PROBLEM and "sudo usermod -aG" in check().tries[0]


def test_bluetooth_is_looked_at_from_adapter_to_switch(tmp_path, monkeypatch):
    monkeypatch.setattr(permissions.platform, "system", lambda: "Linux")
    monkeypatch.setattr(permissions, "_LINES", ())
    for name in ("_ADAPTERS", "_SWITCHES", "_BUS"):
        monkeypatch.setattr(permissions, name, tmp_path / name)

    def check(is_needed=True):
        (found,) = permissions.permissions([], is_needed)
        return found.state, found.text

    assert check() == (PROBLEM, "this machine has no Bluetooth adapter") and check(False)[0] == NOTE
    (tmp_path / "_ADAPTERS" / "hci0").mkdir(parents=True)
    assert check() == (PROBLEM, "adapter hci0, but no Bluetooth service")
    (tmp_path / "_BUS").touch()
    switch = tmp_path / "_SWITCHES" / "rfkill0"
    switch.mkdir(parents=True)
    for name, text in (("type", "bluetooth"), ("soft", "1"), ("hard", "0")):
        (switch / name).write_text(f"{text}\n")
    assert check() == (PROBLEM, "Bluetooth is switched off")
    (switch / "soft").write_text("0\n")
    assert check() == (OK, "adapter hci0")
