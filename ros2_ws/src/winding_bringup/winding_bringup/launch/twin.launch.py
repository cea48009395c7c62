"""The graph under stock ROS 2 launch, from the same tuple as `winding run`.

    ros2 launch winding_bringup twin.launch.py case:=4 duration:=20.0
    ros2 service call /winding/rig/start std_srvs/srv/Trigger

Where robot_state_publisher is installed, it publishes robot_description and the frames.

launch brings every node up to active; winding begins with the service call. Nothing is recorded
and nothing is supervised here: `ros2 bag record` and `winding run` do that.
"""

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode, Node
from launch_ros.parameter_descriptions import ParameterValue

from winding_core.cable.condition import Condition
from winding_core.machine.axes import MachineAxes
from winding_core.run_options import CameraPlacement
from winding_core.urdf import machine_urdf
from winding_ros import topics
from winding_ros.graph import DEFAULT_NAMESPACE, GRAPH

ARGUMENTS = {
    "namespace": (DEFAULT_NAMESPACE, "namespace of every node"),
    "case": ("4", "row of Table 1"),
    "duration": ("20.0", "simulated length [s]"),
    "speed": ("1.0", "simulated over wall time; 0 as fast as it goes"),
}


def generate_launch_description() -> LaunchDescription:
    """Return one lifecycle node per entry of the graph, sinks first."""
    condition = {
        "use_sim_time": True,
        "case": ParameterValue(LaunchConfiguration("case"), value_type=int),
        "duration": ParameterValue(LaunchConfiguration("duration"), value_type=float),
    }
    own = {
        topics.RIG: {
            "speed": ParameterValue(LaunchConfiguration("speed"), value_type=float),
            "pace_topics": ",".join(spec.answer.name for spec in GRAPH if spec.answer is not None),
        }
    }
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, text) in ARGUMENTS.items()
            ),
            *(
                LifecycleNode(
                    package=spec.package,
                    executable=spec.package,
                    name=spec.name,
                    namespace=LaunchConfiguration("namespace"),
                    parameters=[{**condition, **own.get(spec.name, {})}],
                    # launch_ros 0.26.7 or later.
                    autostart=True,
                    output="screen",
                )
                for spec in GRAPH
            ),
            OpaqueFunction(function=_frames),
        ]
    )


def _frames(context: LaunchContext) -> list[Node]:
    """Return robot_state_publisher with the machine's URDF, where it is installed."""
    try:
        get_package_prefix("robot_state_publisher")
    except PackageNotFoundError:
        return []
    values = {name: LaunchConfiguration(name).perform(context) for name in ("case", "duration")}
    what = Condition(case=int(values["case"]), duration=float(values["duration"])).resolved()
    urdf = machine_urdf(what, MachineAxes(), CameraPlacement())
    return [
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            namespace=LaunchConfiguration("namespace"),
            parameters=[
                {"use_sim_time": True, "robot_description": ParameterValue(urdf, value_type=str)}
            ],
            remappings=[("joint_states", topics.JOINT_STATES.name)],
            output="screen",
        )
    ]
