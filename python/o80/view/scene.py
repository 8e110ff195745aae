"""The bodies of a MuJoCo model, and their poses in a row."""

import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80._core import Observation
from o80.base.arrays import Image
from o80.base.errors import Error
from o80.base.extras import needed
from o80.view.base64_arrays import packed, packed_indices
from o80.view.foreign_model import compiled
from o80.view.world import Drawn

SHAPES = {0: "plane", 2: "sphere", 3: "capsule", 4: "ellipsoid", 5: "cylinder", 6: "box", 7: "mesh"}
DRAWN_GROUPS = 3  # geoms of groups 0 to 2; the others are shapes for collisions
FREE = 0  # type of the joint of a floating body
USUAL_COLOUR = (0.5, 0.5, 0.5, 1.0)  # of a geom that has none


class Scene:
    """Draws one model. May be used from several threads."""

    def __init__(self, schema: dict[str, Any], drawn: Drawn) -> None:
        """Raises Error if the model cannot be read, MissingExtra without mujoco."""
        described = drawn.described
        self._mujoco: Any = needed("mujoco", "view", "the 3D view")
        self.model: Any = (  #: the compiled model
            self._compiled(drawn.mjcf, described["file"])
            if drawn.trusted
            else compiled(drawn.mjcf, self._mujoco)
        )
        self._data = self._mujoco.MjData(self.model)
        self._lock = threading.Lock()
        self._start: NDArray[np.float64] = np.array(self._data.qpos)
        self._places = [
            place
            for value in described["values"]
            if (place := self._place(value, schema)) is not None
        ]
        weld = self.model.body_weldid
        self._moving = [body for body in range(self.model.nbody) if weld[body] != 0]
        # floating bodies, such as a tracked ball, exist only while a row has their pose
        self._floats = not any(weld[body] == 0 for body in self.model.geom_bodyid)
        self._has_ghost = any(value["from"] == "states" for value in described["values"])
        self.geometry = self._geometry()

    def _compiled(self, mjcf: str, file: str) -> Any:
        try:
            if not mjcf:
                return self._mujoco.MjModel.from_xml_path(file)
            spec = self._mujoco.MjSpec.from_string(mjcf)
            if file:
                spec.modelfiledir = str(Path(file).parent)
            return spec.compile()
        except ValueError as error:
            raise Error(f"the model of the robot cannot be read: {error}") from error

    def _place(self, value: dict[str, Any], schema: dict[str, Any]) -> "_Place | None":
        """Finds where a value goes; None if the model has no such joint or floating body."""
        kind = self._mujoco.mjtObj
        joint = value["what"] == "joint"
        if joint:
            found = self._mujoco.mj_name2id(self.model, kind.mjOBJ_JOINT, value["name"])
        else:
            body = self._mujoco.mj_name2id(self.model, kind.mjOBJ_BODY, value["name"])
            found = int(self.model.body_jntadr[body]) if body >= 0 else -1
        if found < 0 or (not joint and self.model.jnt_type[found] != FREE):
            return None
        row = schema["row"]
        extended = value["from"] == "extended"
        observed = row["extended" if extended else "observed"] + value["offset"]
        desired = observed if extended else row["desired"] + value["offset"]
        address = int(self.model.jnt_qposadr[found])
        follows = None if extended else _following(schema, value["offset"])
        body = int(self.model.jnt_bodyid[found])
        share = None if extended or not joint else _share(schema, value["offset"])
        factor, shift = 1.0, 0.0
        if share is not None and self.model.jnt_limited[found]:
            low, high = (float(end) for end in self.model.jnt_range[found])
            factor = (high - low) / (share[1] - share[0])
            shift = low - share[0] * factor
        count = 1 if joint else 3
        return _Place(
            value["name"], body, address, count, observed, desired, follows, factor, shift
        )

    def poses(self, row: Observation) -> dict[str, Any]:
        """Returns positions and quaternions of moving bodies (bodies, 7), observed and desired."""
        found: dict[str, Any] = {"pose": None, "ghost": None, "not_finite": []}
        with self._lock:
            observed = [place.observed for place in self._places]
            pose = self._pose(row, observed, found["not_finite"])
            found["pose"] = packed(pose.astype(np.float32))
            if self._has_ghost:
                active = row.active
                desired = [place.wanted(active) for place in self._places]
                found["ghost"] = packed(self._pose(row, desired, []).astype(np.float32))
        return found

    @property
    def bodies(self) -> list[str]:
        """Names of the moving bodies; numbers of bodies without a name."""
        names = (self.model.body(body).name for body in self._moving)
        return [name or f"body_{body}" for name, body in zip(names, self._moving, strict=True)]

    def picture(self, row: Observation, renderer: Any, camera: str | int) -> Image:
        """Draws a fresh picture (height, width, 3) of the observed positions."""
        with self._lock:
            self._pose(row, [place.observed for place in self._places], [])
            self._mujoco.mj_camlight(self.model, self._data)
            renderer.update_scene(self._data, camera)
            picture: Image = renderer.render().copy()
            return picture

    def observed(self, row: bytes) -> NDArray[np.float64]:
        """Returns observed positions and quaternions of the moving bodies (bodies, 7)."""
        with self._lock:
            return self._pose(row, [place.observed for place in self._places], [])

    def _pose(self, row: Any, offsets: list[int], not_finite: list[str]) -> NDArray[np.float64]:
        self._data.qpos[:] = self._start
        lost = []
        for place, offset in zip(self._places, offsets, strict=True):
            numbers = np.frombuffer(row, np.float64, place.count, offset)
            if np.isfinite(numbers).all():
                where = slice(place.address, place.address + place.count)
                self._data.qpos[where] = place.factor * numbers + place.shift
            elif self._floats:
                lost.append(self._moving.index(place.body))
            else:
                not_finite.append(place.name)
        self._mujoco.mj_kinematics(self.model, self._data)
        moving = self._moving
        poses = np.hstack([self._data.xpos[moving], self._data.xquat[moving]])
        poses[lost] = np.nan
        return poses

    def _geometry(self) -> dict[str, Any]:
        self._mujoco.mj_kinematics(self.model, self._data)
        model = self.model
        shown = [geom for geom in range(model.ngeom) if self._is_shown(geom)]
        meshes = sorted(
            {int(model.geom_dataid[geom]) for geom in shown if model.geom_type[geom] == 7}
        )
        return {
            "moving": self._moving,
            "bodies": packed(np.hstack([self._data.xpos, self._data.xquat])),
            "geoms": [self._geom(geom) for geom in shown],
            "meshes": {mesh: self._mesh(mesh) for mesh in meshes},
            "centre": [float(number) for number in model.stat.center],
            "extent": float(model.stat.extent),
        }

    def _is_shown(self, geom: int) -> bool:
        model = self.model
        return (
            int(model.geom_type[geom]) in SHAPES
            and model.geom_group[geom] < DRAWN_GROUPS
            and self._colour(geom)[3] > 0
        )

    def _colour(self, geom: int) -> list[float]:
        model = self.model
        material = int(model.geom_matid[geom])
        colour = [float(number) for number in model.geom_rgba[geom]]
        if material >= 0 and np.allclose(colour, USUAL_COLOUR):
            colour = [float(number) for number in model.mat_rgba[material]]
            if model.mat_texid[material].max() >= 0 and np.allclose(colour, 1.0):
                colour = [0.62, 0.64, 0.66, 1.0]  # textures are not drawn
        return colour

    def _geom(self, geom: int) -> dict[str, Any]:
        model = self.model
        return {
            "body": int(model.geom_bodyid[geom]),
            "shape": SHAPES[int(model.geom_type[geom])],
            "size": [float(number) for number in model.geom_size[geom]],
            "pos": [float(number) for number in model.geom_pos[geom]],
            "quat": [float(number) for number in model.geom_quat[geom]],
            "colour": self._colour(geom),
            "mesh": int(model.geom_dataid[geom]),
        }

    def _mesh(self, mesh: int) -> dict[str, str]:
        model = self.model
        vertices = slice(
            model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh]
        )
        faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
        return {
            "vertices": packed(model.mesh_vert[vertices]),
            "faces": packed_indices(model.mesh_face[faces]),
        }


@dataclass(frozen=True)
class _Place:
    """Place of a value in a row, and in qpos."""

    name: str
    body: int
    address: int
    count: int
    observed: int
    desired: int
    follows: int | None  #: the actuator, if it follows its observed state without a command
    factor: float  #: from the numbers of the row to those in qpos
    shift: float

    def wanted(self, active: NDArray[np.bool_]) -> int:
        """Returns where the desired value is: at the observed one while the actuator follows."""
        idle = self.follows is not None and not bool(active[self.follows])
        return self.observed if idle else self.desired


def _following(schema: dict[str, Any], offset: int) -> int | None:
    """Returns the actuator of a value in the states, if it follows when idle."""
    found = None
    for index, actuator in enumerate(schema["actuators"]):
        if actuator["offset"] <= offset:
            found = index if actuator["when_idle"] == "follow" else None
    return found


def _share(schema: dict[str, Any], offset: int) -> tuple[float, float] | None:
    """Returns the bounds of an actuator whose state has no unit, such as a gripper, or None."""
    for actuator in schema["actuators"]:
        fields = schema["groups"][actuator["group"]]["type"]["fields"]
        low, high = actuator["limits"][0]["minimum"], actuator["limits"][0]["maximum"]
        is_share = actuator["offset"] == offset and fields[0]["unit"] == "1"
        if is_share and None not in (low, high) and low < high:
            return low, high
    return None
