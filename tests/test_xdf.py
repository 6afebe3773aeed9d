"""XDF: values beside pyxdf's and beside a file written here chunk by chunk; clocks beside simulated truth."""

import shutil
import struct
from pathlib import Path

import numpy as np
import pytest

from local_data import local_folder
from oarlock.formats.devices.xdf import find_xdf, read_xdf
from oarlock.formats.devices.xdf_chunks import XdfStream, read_chunks
from oarlock.formats.devices.xdf_clock import on_the_recorders_clock
from oarlock.formats.listing import listed
from oarlock.recording.streams import ImuStream, ScalarStream
from refusals import assert_refused

SAMPLES = Path(__file__).parent / "data/xdf"
BOUNDARY = bytes.fromhex("43A546DCCBF5410FB30ED5467383CBE4")
FORMS = {"float32": "<f4", "double64": "<f8", "int8": "<i1", "int16": "<i2", "int32": "<i4", "int64": "<i8"}


def chunk(tag, content):
    """A chunk as the specification of XDF 1.0 has it."""
    body = struct.pack("<H", tag) + content
    length = struct.pack("<BB", 1, len(body)) if len(body) < 256 else struct.pack("<BI", 4, len(body))
    return length + body


def header(number, form, channels, rate_hz=0.0, name="Arm", kind="IMU"):
    told = "".join(
        f"<channel><label>{label}</label><unit>{unit}</unit></channel>" for label, unit in channels
    )
    text = (
        f"<?xml version='1.0'?><info><name>{name}</name><type>{kind}</type><channel_count>{len(channels)}"
        f"</channel_count><nominal_srate>{rate_hz}</nominal_srate><channel_format>{form}</channel_format>"
        f"<desc><channels>{told}</channels></desc></info>"
    )
    return chunk(2, struct.pack("<I", number) + text.encode())


def samples(number, form, stamps, values):
    rows = b""
    for stamp, row in zip(stamps, values, strict=True):
        rows += b"\0" if stamp is None else struct.pack("<Bd", 8, stamp)
        if form == "string":
            rows += b"".join(struct.pack("<BB", 1, len(cell.encode())) + cell.encode() for cell in row)
        else:
            rows += np.asarray(row, FORMS[form]).tobytes()
    return chunk(3, struct.pack("<IBB", number, 1, len(stamps)) + rows)


def offset(number, time_s, offset_s):
    return chunk(4, struct.pack("<Idd", number, time_s, offset_s))


def written(tmp_path, *chunks, name="trial.xdf"):
    file = tmp_path / name
    file.write_bytes(b"XDF:" + chunk(1, b"<info><version>1.0</version></info>") + b"".join(chunks))
    return file


IMU = [
    *(("AccX", "g"), ("AccY", "g"), ("AccZ", "g")),
    *(("GyroX", "deg/s"), ("GyroY", "deg/s"), ("GyroZ", "deg/s"), ("Battery", "V")),
]


def sample(name):
    return (local_folder("data/xdf_samples") if name == "clock_resets" else SAMPLES) / f"{name}.xdf"


@pytest.mark.parametrize("name", ["clock_resets", "empty_streams", "minimal"])
def test_chunks_are_those_that_pyxdf_reads(name):
    pyxdf = pytest.importorskip("pyxdf")
    file = sample(name)
    theirs, _ = pyxdf.load_xdf(file, synchronize_clocks=False, dejitter_timestamps=False, verbose=False)
    ours = read_chunks(file)
    assert ours.notes == ()
    assert [s.number for s in ours.streams] == [s["info"]["stream_id"] for s in theirs]
    for mine, other in zip(ours.streams, theirs, strict=True):
        assert (mine.name, mine.kind) == (other["info"]["name"][0], other["info"]["type"][0])
        assert mine.raw_time_s.tolist() == other["time_stamps"].tolist()
        assert mine.measured == list(zip(other["clock_times"], other["clock_values"], strict=True))
        if mine.is_text:
            assert mine.texts == [list(sample) for sample in other["time_series"]]
        elif mine.values:
            assert np.array_equal(np.concatenate(mine.values), other["time_series"])


@pytest.mark.parametrize("name", ["clock_resets", "empty_streams", "minimal"])
def test_clocks_agree_with_pyxdf(name):
    pyxdf = pytest.importorskip("pyxdf")
    theirs, _ = pyxdf.load_xdf(sample(name), dejitter_timestamps=False, verbose=False)
    for mine, other in zip(read_chunks(sample(name)).streams, theirs, strict=True):
        if len(mine.raw_time_s):
            found = on_the_recorders_clock(mine).time_s
            # Two robust fits of measurements whose noise is 0.1 ms.
            assert np.abs(found - other["time_stamps"]).max() < 1e-4


def test_minimal():
    recording = read_xdf(SAMPLES / "minimal.xdf")
    assert recording.names == ("SendDataC_1", "SendDataC_2", "SendDataC_3")
    # its nine samples, as the description of the file lists them
    assert recording["SendDataC_1"].value.tolist() == [192, 12, 13, 14, 15, 12, 13, 14, 15]
    assert np.abs(recording["SendDataC_1"].time_s - np.arange(9) / 10).max() < 1e-12
    events = recording.meta["events"]["SendDataString"]
    assert events["text"][1:] == ["Hello", "World", "from", "LSL"] * 2
    assert events["time_s"][0] == pytest.approx(0.1)
    assert "clock was not measured" in recording.meta["clock"]["found"][0]
    assert "No inertial unit was found" in recording.meta["source"]["notes"][0]


def test_empty_streams_are_named():
    recording = read_xdf(SAMPLES / "empty_streams.xdf")
    assert recording.names == ("Data_stream:_test_stream_0_counter_ch:00",)
    assert recording.streams[0].value.tolist() == list(range(10))
    notes = " ".join(recording.meta["source"]["notes"])
    assert notes.count("has no samples") == 2
    assert recording.meta["events"]["ctrl"]["text"] == ['{"state": 2}']


def test_a_reset_of_the_senders_clock():
    recording = read_xdf(sample("clock_resets"))
    assert len(recording) == 8
    stream = recording["BioSemi_1"]
    steps = np.diff(stream.time_s)
    # The sender was away for 273.5 s; within each part its stamps are at most 37 ms apart.
    assert (steps > 0.1).sum() == 1
    assert 273.5 < steps.max() < 273.6
    assert "another zero once" in " ".join(recording.meta["clock"]["found"])
    assert "no regular rate" in " ".join(recording.meta["clock"]["found"])


@pytest.mark.parametrize("form", FORMS)
def test_every_format_of_numbers(form, tmp_path):
    values = np.array([[1, -2], [3, 4], [-5, 100]])
    file = written(
        tmp_path,
        header(1, form, [("a", ""), ("b", "")], 10.0),
        samples(1, form, [5.0, None, 5.2], values),
    )
    recording = read_xdf(file)
    assert recording["Arm_a"].value.tolist() == [1.0, 3.0, -5.0]
    assert recording["Arm_b"].value.tolist() == [-2.0, 4.0, 100.0]
    assert np.abs(recording["Arm_a"].time_s - [0.0, 0.1, 0.2]).max() < 1e-12


def test_inertial_units_by_label_and_unit(tmp_path):
    values = [[0.0, 0.5, 1.0, 90.0, -180.0, 0.25, 3.7], [0.1, 0.5, 1.0, 90.0, -180.0, 0.25, 3.6]]
    file = written(tmp_path, header(7, "double64", IMU), samples(7, "double64", [1.0, 1.5], values))
    recording = read_xdf(file)
    assert recording.names == ("arm", "Arm_Battery")
    arm = recording["arm"]
    assert isinstance(arm, ImuStream)
    assert arm.accel_m_s2[1].tolist() == [0.1 * 9.80665, 0.5 * 9.80665, 9.80665]
    assert arm.gyro_rad_s[0].tolist() == [np.pi / 2, -np.pi, 0.25 * np.pi / 180.0]
    assert arm.time_s.tolist() == [0.0, 0.5]
    assert "recognised by its labels" in recording.meta["source"]["notes"][0]


def test_two_units_in_one_stream(tmp_path):
    channels = [(f"{side}_Gyro_{axis}", "rad/s") for side in ("left_wrist", "trunk") for axis in "XYZ"]
    file = written(tmp_path, header(1, "float32", channels), samples(1, "float32", [1.0], [range(6)]))
    recording = read_xdf(file)
    assert recording["left_wrist"].gyro_rad_s.tolist() == [[0.0, 1.0, 2.0]]
    assert recording["trunk"].gyro_rad_s.tolist() == [[3.0, 4.0, 5.0]]


def test_without_a_unit_of_measurement_channels_stay_plain(tmp_path):
    channels = [(f"Acc{axis}", "") for axis in "XYZ"]
    file = written(tmp_path, header(1, "float32", channels), samples(1, "float32", [1.0], [range(3)]))
    recording = read_xdf(file)
    assert all(isinstance(stream, ScalarStream) for stream in recording)
    assert "has no unit of measurement" in recording.meta["source"]["notes"][0]


def simulated(raw, measured, rate_hz):
    stream = XdfStream(1, "imu", "IMU", rate_hz, (), "float32", measured=measured)
    stream.stamps, stream.offsets_before = [raw], [0]
    return stream


def measurements(random, outliers):
    """Every 5 s; late answers make a twentieth of them 50 ms wrong."""
    return [
        (
            t,
            500.0
            + 20e-6 * (t - 100.0)
            + random.normal(0, 1e-4)
            + 0.05 * (outliers and random.random() < 0.05),
        )
        for t in np.arange(100.0, 300.0, 5.0)
    ]


@pytest.mark.parametrize("jitter", ["packets", "noise"])
def test_offset_drift_and_jitter_are_found(jitter):
    random = np.random.default_rng(3)
    sent_s = 100.0 + np.arange(20_000) / 100.2  # a nominal rate of 100 Hz that is 0.2 % off
    late_s = (
        np.repeat(random.exponential(5e-3, 2000), 10)
        if jitter == "packets"
        else random.normal(0, 2e-3, 20_000)
    )
    clock = on_the_recorders_clock(simulated(sent_s + late_s, measurements(random, True), 100.0))
    error_s = clock.time_s - (sent_s + 500.0 + 20e-6 * (sent_s - 100.0) + late_s.mean())
    assert clock.drift_ppm == pytest.approx(20.0, abs=1.0)
    assert clock.jitter_s == pytest.approx(float(np.std(late_s)), rel=0.05)
    # The mean of delays that are not symmetric is not known; the statistical error of the slope is 2 ppm, 0.4 ms here.
    assert np.abs(error_s - np.median(error_s)).max() < 1e-3
    assert np.abs(np.median(error_s)) < 2e-3
    assert (clock.gaps, clock.moved, clock.wanders) == (0, 0, False)


def test_lost_samples_shift_nothing():
    random = np.random.default_rng(4)
    sent_s = 100.0 + np.arange(20_000) / 100.0
    kept = np.ones(20_000, dtype=bool)
    for start, count in ((3000, 1), (3500, 20), (9000, 500), (15_000, 3)):
        kept[start : start + count] = False
    raw = (sent_s + random.normal(0, 1e-3, 20_000))[kept]
    clock = on_the_recorders_clock(simulated(raw, [], 100.0))
    assert clock.gaps == 4
    assert np.abs(clock.time_s - sent_s[kept]).max() < 5e-4


def test_a_sender_without_a_regular_clock_keeps_its_stamps():
    random = np.random.default_rng(5)
    raw = 100.0 + np.cumsum(0.01 + np.abs(random.normal(0, 1e-3, 5000)))
    clock = on_the_recorders_clock(simulated(raw, [], 100.0))
    assert clock.wanders
    assert clock.time_s.tolist() == raw.tolist()


def test_clocks_whose_ranges_overlap_after_a_reset():
    """Started again after 200 s, the sender counts through the same seconds once more."""
    first, second = (np.arange(20_000) / 100.0 for _ in range(2))
    stream = XdfStream(1, "imu", "IMU", 100.0, (), "float32")
    for k, part in enumerate((first, second)):
        for j in range(40):
            stream.measured.append((5.0 * j, 1000.0 + 300.0 * k))
            stream.stamps.append(part[500 * j : 500 * (j + 1)])
            stream.offsets_before.append(len(stream.measured))
    clock = on_the_recorders_clock(stream)
    assert clock.resets == 1
    assert np.abs(clock.time_s - np.concatenate([first + 1000.0, second + 1300.0])).max() < 1e-9


def test_equal_and_earlier_stamps_of_irregular_streams_are_moved(tmp_path):
    channels = [("a", "")]
    file = written(
        tmp_path,
        header(1, "float32", channels),
        samples(1, "float32", [1.0, 1.0, 0.9, 2.0], [[1], [2], [3], [4]]),
    )
    stream = (recording := read_xdf(file))["Arm_a"]
    assert stream.value.tolist() == [1.0, 2.0, 3.0, 4.0]
    assert np.allclose(stream.time_s, [0.0, 1e-6, 2e-6, 1.0], atol=1e-9)
    assert "2 stamps" in recording.meta["clock"]["found"][0]


def test_damage_is_passed_over_up_to_the_next_boundary(tmp_path):
    channels = [("a", "")]
    good = [samples(1, "float32", [float(k)], [[k]]) for k in range(4)]
    broken = b"\x07" + b"\0" * 40
    file = written(tmp_path, header(1, "float32", channels), good[0], broken, chunk(5, BOUNDARY), good[3])
    recording = read_xdf(file)
    assert recording["Arm_a"].value.tolist() == [0.0, 3.0]
    assert "cannot be read" in recording.meta["source"]["notes"][0]
    file.write_bytes(file.read_bytes()[:-3])
    assert read_xdf(file)["Arm_a"].value.tolist() == [0.0]


def test_impossible_stamps_are_damage(tmp_path):
    parts = [samples(1, "float32", [stamp], [[k]]) for k, stamp in enumerate((1.0, 1e300, float("inf"), 2.0))]
    recording = read_xdf(written(tmp_path, header(1, "float32", [("a", "")]), *parts, offset(1, 1.0, 1e200)))
    assert recording["Arm_a"].value.tolist() == [0.0, 3.0]
    assert recording["Arm_a"].time_s.tolist() == [0.0, 1.0]
    assert "a stamp is 1e+300 s" in recording.meta["source"]["notes"][0]


def test_announced_counts_are_compared_with_the_bytes(tmp_path):
    """0.1 MB announced 44 GB of samples, and the headers of 0.5 MB took 2.4 GB."""
    many = header(1, "double64", [("a", "")] * 1500, 100.0)
    announced = chunk(3, struct.pack("<IBI", 1, 4, 90_000) + bytes(100_000))
    file = written(tmp_path, many, announced, samples(1, "double64", [1.0], [[1.0] * 1500]))
    assert len(read_xdf(file)) == 1500
    assert "announces 90000 samples in 100000 bytes" in read_xdf(file).meta["source"]["notes"][0]
    file = written(
        tmp_path,
        header(1, "int8", [("a", "")]),
        samples(1, "int8", [1.0], [[1]]),
        header(2, "int8", [("b", "")] * 2000),
    )
    assert (
        "it has 2000 channels after 1 others; at most 2000 are read"
        in read_xdf(file).meta["source"]["notes"][0]
    )


def test_a_clock_with_more_resets_than_a_session_has_counts_as_not_measured():
    stream = XdfStream(1, "a", "IMU", 0.0, (), "int8", [np.arange(500.0)], offsets_before=[500])
    stream.measured = [(k * 7919.0 % 500.0, 0.001 * k) for k in range(500)]
    clock = on_the_recorders_clock(stream)
    assert clock.resets == 0 and np.isnan(clock.offset_s) and np.array_equal(clock.time_s, stream.raw_time_s)


def test_what_is_refused(tmp_path):
    file = tmp_path / "trial.xdf"
    for content, words in (
        (b"", ("is no XDF file",)),
        (b"\xef\xbb\xbfXDF:", ("is no XDF file",)),
        (b"\x1f\x8b\x08", ("is compressed", "gunzip")),
        (b"XDF:", ("has no stream",)),
    ):
        file.write_bytes(content)
        assert_refused(lambda: read_xdf(file), "trial.xdf", *words)
    text = [header(1, "string", [("m", "")], name="Markers"), samples(1, "string", [1.0], [["go"]])]
    assert_refused(lambda: read_xdf(written(tmp_path, *text)), "no stream of numbers, only Markers")
    assert_refused(lambda: read_xdf(written(tmp_path, text[0])), "none of its 1 streams has a sample")
    assert_refused(lambda: read_xdf(tmp_path / "nowhere"), "cannot be read")


def test_found_by_content(tmp_path):
    shutil.copy(SAMPLES / "minimal.xdf", tmp_path / "renamed.bin")
    (found,) = find_xdf(listed(tmp_path))
    assert (found.path, found.name) == (tmp_path / "renamed.bin", "renamed")
