"""`Model.describe`: typed parts, the same data as JSON, and the values of a calibration."""

from __future__ import annotations

import json
from dataclasses import FrozenInstanceError, fields, is_dataclass
from inspect import cleandoc
from typing import Any, get_type_hints

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import oarlock
from oarlock import Calibration, DataError
from oarlock.model import ImuDescription, ModelDescription
from oarlock.model import description as parts
from oarlock.model.shipped_files import model_names

SENSORS = """
[[sensor]]
name = "reach"
kind = "range"
frame_a = "root"
point_a = [0.0, 0.1, 0.0]
frame_b = "r_hand"
std_m = 0.02
[[sensor]]
name = "place"
kind = "position"
frame = "r_hand"
std_m = 0.02
[[sensor]]
name = "device"
kind = "orientation"
frame = "r_hand"
std_rad = 0.03
"""


@pytest.fixture(scope="module")
def sculler() -> oarlock.Model:
    return oarlock.load_model("sculler")


@pytest.fixture(scope="module")
def every_kind(tmp_path_factory: pytest.TempPathFactory) -> ModelDescription:
    file = tmp_path_factory.mktemp("model") / "own.toml"
    file.write_text('format = 1\nname = "own"\nextends = "sculler"\n' + SENSORS, encoding="utf-8")
    return oarlock.load_model(file).describe()


def test_every_shipped_model_is_described_and_comes_back_from_its_json() -> None:
    for name in model_names():
        description = oarlock.load_model(name).describe()
        assert parts.described(json.dumps(description.to_dict())) == description
        assert description.frames[0].name == "root"


def test_each_kind_of_sensor_has_its_class(every_kind: ModelDescription) -> None:
    kinds = {sensor.kind: type(sensor).__name__ for sensor in every_kind.sensors}
    assert kinds == {
        "imu": "ImuDescription",
        "encoder": "EncoderDescription",
        "range": "RangeDescription",
        "position": "PositionDescription",
        "orientation": "OrientationDescription",
    }
    assert every_kind.inertial_units == tuple(s for s in every_kind.sensors if s.kind == "imu")
    assert every_kind.encoders == tuple(s for s in every_kind.sensors if s.kind == "encoder")


def test_a_dictionary_has_the_keys_of_its_kind_and_no_others(every_kind: ModelDescription) -> None:
    plain = every_kind.to_dict()
    assert list(plain) == sorted(plain)
    reach = next(sensor for sensor in plain["sensors"] if sensor["name"] == "reach")
    assert set(reach) == {
        *("name", "kind", "frame", "joint", "std", "std_m"),
        *("frame_a", "point_a", "frame_b", "point_b"),
    }
    assert reach["frame"] is None and reach["point_a"] == [0.0, 0.1, 0.0]
    assert all("translation" not in joint for joint in plain["joints"])
    free = oarlock.load_model("broad").describe().to_dict()
    assert {"kind", "density", "start_std", "limits"} <= set(free["joints"][0]["translation"])


def test_a_description_is_frozen(sculler: oarlock.Model) -> None:
    description = sculler.describe()
    with pytest.raises(FrozenInstanceError):
        description.name = "other"  # type: ignore[misc]
    assert hash(description) == hash(sculler.describe())


def test_every_field_is_typed_and_documented() -> None:
    found = [part for part in vars(parts).values() if isinstance(part, type) and is_dataclass(part)]
    assert len(found) == 18
    for part in found:
        inherited = {f.name for base in part.__bases__ if is_dataclass(base) for f in fields(base)}
        for name, hint in get_type_hints(part).items():
            assert hint is not Any, f"{part.__name__}.{name}"
            about = cleandoc(part.__doc__ or "")
            assert name in inherited or f"    {name}: " in about, f"{part.__name__}.{name}"
        assert getattr(oarlock.model, part.__name__) is part


def test_a_calibration_shows_in_lengths_places_and_mounts(sculler: oarlock.Model) -> None:
    turned = Rotation.from_rotvec([0.1, -0.2, 0.3]).as_matrix()
    given = Calibration(
        {"l_ua_r": 0.33},
        {"r_forearm": (turned, np.array([0.01, 0.02, 0.03]))},
        parameter_stds={"l_ua_r": 0.004},
    )
    found, nominal = sculler.describe(given), sculler.describe()
    sized = sculler.with_parameters(l_ua_r=0.33).describe()
    lengths = {p.name: (p.value, p.std) for p in found.parameters}
    assert lengths["l_ua_r"] == (0.33, 0.004)
    assert found.frames == sized.frames != nominal.frames
    for own, other in zip(found.sensors, sized.sensors, strict=True):
        if own.name != "r_forearm":
            assert own == other
            continue
        assert isinstance(own, ImuDescription)
        np.testing.assert_array_equal(own.mount.rotation, turned)
        assert own.mount.offset == (0.01, 0.02, 0.03)
    assert sculler.describe() == nominal == sculler.describe(Calibration())


@pytest.mark.parametrize(
    "wrong",
    [
        Calibration({"l_ua_x": 0.3}),
        Calibration(mounts={"r_forarm": (np.eye(3), np.zeros(3))}),
        Calibration(parameter_stds={"l_ua_x": 0.01}),
    ],
)
def test_a_calibration_of_another_model_is_refused(wrong: Calibration, sculler: oarlock.Model) -> None:
    with pytest.raises(DataError, match=r"r_forarm|l_ua_x"):
        sculler.describe(wrong)
