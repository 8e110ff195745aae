"""Converts a robot's model to URDF, for rviz and MoveIt, and computes poses of its links.

Each body that moves is a link, `ROBOT/BODY`, named as in frames of ROS; fixed bodies are drawn in
the world. Meshes are drawn as boxes around them.
"""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
from numpy.typing import NDArray

from o80.frontend.segments import is_own
from o80.view.scene import Scene
from o80.view.world import drawn

if TYPE_CHECKING:
    from o80.frontend.frontend import Frontend

WORLD = "world"
FLOOR, SPHERE, CAPSULE, CYLINDER = 0, 2, 3, 5
SLIDE, HINGE = 2, 3
Numbers = NDArray[np.float64]
Place = tuple[str, Numbers, Numbers]
"""Link, position [m], and quaternion (x, y, z, w) in the world."""


class Links:
    """The links of a robot: its moving bodies."""

    @classmethod
    def of(cls, frontend: "Frontend", robot: str) -> "Links | None":
        """Makes links; None if the robot names no model. Raises Error if it cannot be read."""
        if "model" not in frontend.schema:
            return None
        found = drawn(frontend.schema, frontend.model, trusted=is_own(frontend))
        return None if found is None else cls(Scene(frontend.schema, found), robot)

    def __init__(self, scene: Scene, robot: str) -> None:
        """robot: prefix of the names of links."""
        self._scene, self._robot = scene, robot
        self._names = [f"{robot}/{body}" for body in scene.bodies]

    def places(self, row: bytes) -> Iterator[Place]:
        """Yields observed poses of links in a row, without links whose pose is not known."""
        for name, pose in zip(self._names, self._scene.observed(row), strict=True):
            if np.isfinite(pose).all():
                yield name, pose[:3], pose[[4, 5, 6, 3]]  # MuJoCo begins with w

    def urdf(self, schema: Mapping[str, Any], names: Mapping[int, str]) -> str:
        """Converts the model to URDF. names: joints by their position's offset in a row [bytes]."""
        begins = {"states": schema["row"]["observed"], "extended": schema["row"]["extended"]}
        values = schema["model"]["values"]
        places = {each["name"]: begins[each["from"]] + each["offset"] for each in values}
        shown = {name: names[place] for name, place in places.items() if place in names}
        return tostring(_Urdf(self._scene.model, self._robot, shown).element, encoding="unicode")


class _Urdf:
    """Converts a compiled model of MuJoCo.

    robot: prefix of the links. joints: other names for joints of the model.
    """

    def __init__(self, model: Any, robot: str, joints: Mapping[str, str]) -> None:
        self._model, self._joints, self.element = model, joints, Element("robot", name=robot)
        names = (model.body(body).name or f"body_{body}" for body in range(model.nbody))
        self._frames = [
            f"{robot}/{name}" if weld else WORLD
            for name, weld in zip(names, model.body_weldid, strict=True)
        ]
        links = {each: SubElement(self.element, "link", name=each) for each in self._frames}
        for geom in range(model.ngeom):
            if model.geom_type[geom] != FLOOR and model.geom_group[geom] <= 2:  # it is drawn
                self._add_shape(links[self._frames[model.geom_bodyid[geom]]], geom)
        for body in np.flatnonzero(model.body_weldid):
            self._add_joints(int(body))

    def _standing(self, body: int) -> Numbers:
        """Returns the pose of a body in its link (4, 4)."""
        found = np.eye(4)
        while body and not self._model.body_weldid[body]:
            found = _placed(self._model.body_pos[body], self._model.body_quat[body]) @ found
            body = int(self._model.body_parentid[body])
        return found

    def _add_joints(self, body: int) -> None:
        """Adds the joints of a body one after the other, with links between them."""
        model, frame = self._model, self._frames[body]
        parent = int(model.body_parentid[body])
        link, at = self._frames[parent], np.zeros(3)  # at: position of the link, in the body
        origin = self._standing(parent) @ _placed(model.body_pos[body], model.body_quat[body])
        first = int(model.body_jntadr[body])
        for joint in range(first, first + int(model.body_jntnum[body])):
            name, limited = model.joint(joint).name or f"joint_{joint}", model.jnt_limited[joint]
            kinds = {SLIDE: "prismatic", HINGE: "revolute" if limited else "continuous"}
            kind, behind = kinds.get(int(model.jnt_type[joint]), "floating"), frame
            if model.jnt_pos[joint].any() or joint + 1 < first + model.body_jntnum[body]:
                behind = f"{frame}/{joint}"
                SubElement(self.element, "link", name=behind)
            origin = origin @ _placed(model.jnt_pos[joint] - at)
            made = self._joint(self._joints.get(name, name), kind, (link, behind), origin)
            SubElement(made, "axis", xyz=_text(model.jnt_axis[joint]))
            if limited:
                low, high = map(str, model.jnt_range[joint])
                SubElement(made, "limit", lower=low, upper=high, effort="0", velocity="1")
            link, origin, at = behind, np.eye(4), model.jnt_pos[joint]
        if link != frame:
            self._joint(f"{frame}/fixed", "fixed", (link, frame), origin @ _placed(-at))

    def _joint(self, name: str, kind: str, links: tuple[str, str], origin: Numbers) -> Element:
        made = SubElement(self.element, "joint", name=name, type=kind)
        for end, link in zip(("parent", "child"), links, strict=True):
            SubElement(made, end, link=link)
        _add_origin(made, origin)
        return made

    def _add_shape(self, link: Element, geom: int) -> None:
        model, visual = self._model, SubElement(link, "visual")
        kind, (radius, half, *_) = int(model.geom_type[geom]), model.geom_size[geom]
        origin = self._standing(int(model.geom_bodyid[geom]))
        origin = origin @ _placed(model.geom_pos[geom], model.geom_quat[geom])
        shape = SubElement(visual, "geometry")
        if kind == SPHERE:
            SubElement(shape, "sphere", radius=str(radius))
        elif kind in (CAPSULE, CYLINDER):
            length = 2 * (half + (radius if kind == CAPSULE else 0))
            SubElement(shape, "cylinder", radius=str(radius), length=str(length))
        else:
            centre, sides = np.split(model.geom_aabb[geom], 2)
            SubElement(shape, "box", size=_text(2 * sides))
            origin = origin @ _placed(centre)
        _add_origin(visual, origin)
        material = SubElement(visual, "material", name=f"{link.get('name')}/{geom}")
        SubElement(material, "color", rgba=_text(model.geom_rgba[geom]))


def _add_origin(element: Element, m: Numbers) -> None:
    flat = np.hypot(m[0, 0], m[1, 0])
    roll, yaw = np.arctan2(m[2, 1], m[2, 2]), np.arctan2(m[1, 0], m[0, 0])
    if flat < 1e-9:
        roll, yaw = np.arctan2(-m[1, 2], m[1, 1]), 0.0
    turn = [roll, np.arctan2(-m[2, 0], flat), yaw]
    SubElement(element, "origin", xyz=_text(m[:3, 3]), rpy=_text(turn))


def _placed(position: Numbers, turn: Any = (1, 0, 0, 0)) -> Numbers:
    """Returns the matrix (4, 4) of a position and a quaternion (w first)."""
    found, (w, x, y, z) = np.eye(4), turn
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    found[:3, :3] += 2 * (w * cross + cross @ cross)
    found[:3, 3] = position
    return found


def _text(numbers: Any) -> str:
    return " ".join(f"{number:.9g}" for number in numbers)
