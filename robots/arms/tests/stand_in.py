"""Stand-in for the published model of the SO-101."""


def stand_in() -> str:
    """Makes a model of about the published one's size, with the same names."""
    bodies, end, servos = "", "", ""
    for joint, place, axis, limit in (
        ("shoulder_pan", "0.04 0 0.06", "0 0 -1", 1.9198),
        ("shoulder_lift", "0.03 0 0.06", "0 1 0", 1.7453),
        ("elbow_flex", "0.03 0 0.11", "0 1 0", 1.69),
        ("wrist_flex", "0.135 0 0", "0 1 0", 1.658),
        ("wrist_roll", "0.06 0 0", "1 0 0", 2.7438),
        ("gripper", "0.05 0 0", "0 0 1", 1.0),
    ):
        bodies += (
            f'<body pos="{place}"><joint name="{joint}" axis="{axis}" damping="1" '
            f'range="{-limit} {limit}"/><geom size="0.02" mass="0.1"/>'
        )
        end += "</body>"
        servos += (
            f'<position name="{joint}" joint="{joint}" kp="300" kv="9" inheritrange="1" '
            'forcerange="-6 6"/>'
        )
    return (
        '<mujoco><compiler angle="radian"/><option timestep="0.002" integrator="implicitfast"/>'
        f'<worldbody>{bodies}<site name="gripperframe" pos="0.05 0 0"/>{end}</worldbody>'
        f"<actuator>{servos}</actuator></mujoco>"
    )
