"""A node of ROS 2: frames of a rig come in, clouds, images, ranges and diagnostics go out.

    source /opt/ros/jazzy/setup.bash
    pip install ./reconstruction
    python examples/ros2/spisim_node.py --ros-args -p source:=tcp-listen://:5800

The messages are those of `--to FILE.mcap` (docs/robotics.md). Where the drone is, odom to
base_link, is for the autopilot to say.
"""

import threading

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosidl_runtime_py.set_message import set_message_fields
from rosidl_runtime_py.utilities import get_message

from reconstruction import InputError
from reconstruction.exports import Shot
from spisim_live import Loop, Reception
from spisim_live.links import source_at
from spisim_live.ros.messages import (
    frame_messages,
    map_messages,
    state_message,
    static_messages,
)

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Camera(Node):
    """Publishes what becomes of each frame."""

    def __init__(self):
        super().__init__("spisim")
        self.source = self.declare_parameter("source", "tcp-listen://:5800").value
        self._publishers_of = {}
        self._stream = None
        self._before = None

    def result(self, outcome):
        """One more result."""
        stamp_ns = outcome.time_ns or self._now_ns()
        shot = Shot.of(outcome.result, outcome.stream.setup, stamp_ns)
        if outcome.stream is not self._stream:
            self._stream = outcome.stream
            self._publish(static_messages(shot))
        self._publish(frame_messages(shot))
        self._publish(map_messages(shot))

    def state(self, state):
        """How the stream is, once a second."""
        self._publish([state_message(self._now_ns(), state.numbers, self._before)])
        self._before = state.numbers

    def _now_ns(self):
        return self.get_clock().now().nanoseconds

    def _publish(self, messages):
        for message in messages:
            kind = get_message(message.type)
            if message.topic not in self._publishers_of:
                quality = LATCHED if message.latched else 10
                publisher = self.create_publisher(kind, message.topic, quality)
                self._publishers_of[message.topic] = publisher
            made = kind()
            set_message_fields(made, fields_of(message))
            self._publishers_of[message.topic].publish(made)


def fields_of(message):
    """As rclpy has them: a level of diagnostics is a byte."""
    if message.topic != "/diagnostics":
        return message.fields
    status = [{**each, "level": bytes([each["level"]])} for each in message.fields["status"]]
    return {**message.fields, "status": status}


def main():
    """Publish until the stream ends, or Ctrl-C."""
    rclpy.init()
    node = Camera()
    try:
        reception = Reception(source_at(node.source, followed=False))
        loop = Loop(reception, results=[node.result], states=[node.state])
        threading.Thread(target=reception.run, daemon=True).start()
        loop.run()
    except InputError as error:
        node.get_logger().fatal(str(error))
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
