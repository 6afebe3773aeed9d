"""Writes OpenSim models as XML of format 4, which OpenSim 4.0 and later read. Used by exports."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Literal
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike

from oarlock.model.angle_sequence import angles_from_quat
from oarlock.model.rotation import quat_from_matrix
from oarlock.storage.arrays import Floats

Kind = Literal["weld", "pin", "slider", "custom"]
GROUND: Final = "ground"

_VERSION: Final = "40000"
_TAGS: Final = {"weld": "WeldJoint", "pin": "PinJoint", "slider": "SliderJoint", "custom": "CustomJoint"}
_PLACEHOLDER_KG: Final = 0.001
_PLACEHOLDER_KG_M2: Final = 1e-6
_BONE_RADIUS_M: Final = 0.006
_SHORTEST_BONE_M: Final = 1e-3
_MASSES: Final = (
    f" Masses and moments of inertia are placeholders, {_PLACEHOLDER_KG:g} kg and {_PLACEHOLDER_KG_M2:g} kg m2 for "
    "every body: the model is for kinematics, and forces computed from it mean nothing. "
)


@dataclass(frozen=True)
class OsimCoordinate:
    """A generalised coordinate.

    Args:
        name: its name, unique in the model.
        default: default value, rad or m.
        span: range of the slider on the screen, rad or m; values are not clamped.
    """

    name: str
    default: float
    span: tuple[float, float]


@dataclass(frozen=True, eq=False)
class OsimJoint:
    """A joint between two bodies: parent-from-child is parent_from_joint M child_from_joint^-1.

    Args:
        name: its name, unique among the joints.
        kind: M is the identity (weld), a rotation about z (pin), or a translation along x (slider). For `custom` it is
            a translation along x, y and z, if there are six coordinates, and then body-fixed rotations about x, y and
            z.
        parent: body's name, or `ground`.
        child: body's name.
        parent_from_joint: (4, 4), m.
        child_from_joint: (4, 4), m.
        coordinates: none for a weld, one for pin and slider; for `custom` the three angles, then x, y, z if there are
            six.
    """

    name: str
    kind: Kind
    parent: str
    child: str
    parent_from_joint: Floats
    child_from_joint: Floats
    coordinates: tuple[OsimCoordinate, ...] = ()


@dataclass(frozen=True, eq=False)
class OsimBody:
    """A body; `bones` (N, 2, 3) are lines that are drawn in its axes, start and end, m."""

    name: str
    bones: Floats


@dataclass(frozen=True)
class OsimModel:
    """Contents of a model file.

    Args:
        name: name of the model.
        credits: a sentence on its origin.
        gravity_m_s2: (3,) in ground axes.
        bodies: all bodies, parents before children.
        joints: one for each body, in the same order.
        couplers: pairs of coordinates, the second always equal to the first.
        markers: (marker, body): one at the origin of that body.
    """

    name: str
    credits: str
    gravity_m_s2: tuple[float, float, float]
    bodies: tuple[OsimBody, ...]
    joints: tuple[OsimJoint, ...]
    couplers: tuple[tuple[str, str], ...]
    markers: tuple[tuple[str, str], ...]


def osim_text(model: OsimModel) -> str:
    """The file's text, every number with all its digits."""
    document = ElementTree.Element("OpenSimDocument", Version=_VERSION)
    document.append(ElementTree.Comment(_MASSES))
    top = ElementTree.SubElement(document, "Model", name=model.name)
    _leaf(top, "credits", f"{model.credits}{_MASSES.rstrip()}")
    _leaf(top, "length_units", "meters")
    _leaf(top, "force_units", "N")
    _numbers(top, "gravity", model.gravity_m_s2)
    bodies = _set(top, "BodySet")
    for body in model.bodies:
        _body(bodies, body)
    joints = _set(top, "JointSet")
    for joint in model.joints:
        _joint(joints, joint)
    constraints = _set(top, "ConstraintSet")
    for independent, dependent in model.couplers:
        _coupler(constraints, independent, dependent)
    markers = _set(top, "MarkerSet")
    for name, carrier in model.markers:
        _marker(markers, name, carrier)
    ElementTree.indent(document, "\t")
    return ElementTree.tostring(document, encoding="unicode", xml_declaration=True) + "\n"


def _body(parent: ElementTree.Element, body: OsimBody) -> None:
    element = ElementTree.SubElement(parent, "Body", name=body.name)
    bones = [bone for bone in body.bones if np.linalg.norm(bone[1] - bone[0]) > _SHORTEST_BONE_M]
    if bones:
        components = ElementTree.SubElement(element, "components")
        for k, (start, end) in enumerate(bones, start=1):
            _bone(components, f"bone_{k}", start, end)
    _numbers(element, "mass", [_PLACEHOLDER_KG])
    _numbers(element, "mass_center", np.zeros(3))
    _numbers(element, "inertia", [_PLACEHOLDER_KG_M2] * 3 + [0.0] * 3)


def _bone(parent: ElementTree.Element, name: str, start: Floats, end: Floats) -> None:
    """A cylinder with axis y, centred at the origin."""
    length = float(np.linalg.norm(end - start))
    pose = np.eye(4)
    pose[:3, :3] = _rotation_from_y((end - start) / length)
    pose[:3, 3] = 0.5 * (start + end)
    frame = _offset_frame(parent, name, "..", pose)
    geometry = ElementTree.SubElement(frame, "attached_geometry")
    cylinder = ElementTree.SubElement(geometry, "Cylinder", name="line")
    _leaf(cylinder, "socket_frame", "..")
    _numbers(cylinder, "radius", [_BONE_RADIUS_M])
    _numbers(cylinder, "half_height", [0.5 * length])


def _joint(parent: ElementTree.Element, joint: OsimJoint) -> None:
    element = ElementTree.SubElement(parent, _TAGS[joint.kind], name=joint.name)
    _leaf(element, "socket_parent_frame", "in_parent")
    _leaf(element, "socket_child_frame", "in_child")
    if joint.coordinates:
        coordinates = ElementTree.SubElement(element, "coordinates")
        for coordinate in joint.coordinates:
            _coordinate(coordinates, coordinate)
    frames = ElementTree.SubElement(element, "frames")
    _offset_frame(frames, "in_parent", _path(joint.parent), joint.parent_from_joint)
    _offset_frame(frames, "in_child", _path(joint.child), joint.child_from_joint)
    if joint.kind == "custom":
        _spatial_transform(element, [coordinate.name for coordinate in joint.coordinates])


def _coordinate(parent: ElementTree.Element, coordinate: OsimCoordinate) -> None:
    element = ElementTree.SubElement(parent, "Coordinate", name=coordinate.name)
    _numbers(element, "default_value", [coordinate.default])
    _numbers(element, "range", coordinate.span)
    _leaf(element, "clamped", "false")


def _spatial_transform(parent: ElementTree.Element, coordinates: Sequence[str]) -> None:
    element = ElementTree.SubElement(parent, "SpatialTransform")
    axes = [f"{kind}{k}" for kind in ("rotation", "translation") for k in (1, 2, 3)]
    for k, name in enumerate(axes):
        axis = ElementTree.SubElement(element, "TransformAxis", name=name)
        if k < len(coordinates):
            _leaf(axis, "coordinates", coordinates[k])
        _numbers(axis, "axis", np.eye(3)[k % 3])
        function = ElementTree.SubElement(axis, "LinearFunction", name="function")
        _numbers(function, "coefficients", [1.0 if k < len(coordinates) else 0.0, 0.0])


def _coupler(parent: ElementTree.Element, independent: str, dependent: str) -> None:
    name = f"{dependent}_follows_{independent}"
    element = ElementTree.SubElement(parent, "CoordinateCouplerConstraint", name=name)
    held = ElementTree.SubElement(element, "coupled_coordinates_function")
    _numbers(ElementTree.SubElement(held, "LinearFunction"), "coefficients", [1.0, 0.0])
    _leaf(element, "independent_coordinate_names", independent)
    _leaf(element, "dependent_coordinate_name", dependent)


def _marker(parent: ElementTree.Element, name: str, body: str) -> None:
    element = ElementTree.SubElement(parent, "Marker", name=name)
    _leaf(element, "socket_parent_frame", _path(body))
    _numbers(element, "location", np.zeros(3))
    _leaf(element, "fixed", "true")


def _offset_frame(parent: ElementTree.Element, name: str, socket: str, pose: Floats) -> ElementTree.Element:
    element = ElementTree.SubElement(parent, "PhysicalOffsetFrame", name=name)
    _leaf(element, "socket_parent", socket)
    _numbers(element, "translation", pose[:3, 3])
    # body-fixed rotations about x, y, z, OpenSim's convention
    _numbers(element, "orientation", angles_from_quat(quat_from_matrix(pose[None, :3, :3]), "XYZ")[0])
    return element


def _set(parent: ElementTree.Element, tag: str) -> ElementTree.Element:
    return ElementTree.SubElement(ElementTree.SubElement(parent, tag, name=tag.lower()), "objects")


def _path(body: str) -> str:
    return f"/{GROUND}" if body == GROUND else f"/bodyset/{body}"


def _leaf(parent: ElementTree.Element, tag: str, text: str) -> None:
    ElementTree.SubElement(parent, tag).text = text


def _numbers(parent: ElementTree.Element, tag: str, values: Iterable[float] | ArrayLike) -> None:
    # adding 0 converts -0 to 0
    _leaf(parent, tag, " ".join(repr(float(v) + 0.0) for v in np.asarray(values).ravel()))


def _rotation_from_y(direction: Floats) -> Floats:
    """A rotation (3, 3) that maps y to a unit vector."""
    aside = np.eye(3)[int(np.argmin(np.abs(direction)))]
    third = np.cross(aside, direction)
    third /= np.linalg.norm(third)
    return np.stack([np.cross(direction, third), direction, third], axis=1)
