"""States of robots as a launcher sees them."""

from fleetloop.robot_states import RobotState


def robot(name: str, **changes) -> RobotState:
    """A robot that drives, with other values as they are given."""
    state = RobotState(
        robot=name,
        phase="driving",
        tick=7,
        x_e_m=-0.0123,
        y_e_m=0.5,
        theta_e_rad=0.1,
        right_wheel_N_m=0.31,
        left_wheel_N_m=-0.52,
        neighbour_age_s=0.01,
        neighbours={"r1": 0.01},
        bus=name,
        bus_frames_per_s=420.0,
        bus_load=0.34,
        right_drive="CLOSED_LOOP_CONTROL",
        left_drive="CLOSED_LOOP_CONTROL",
    )
    return state._replace(**changes)
