"""Sends frames in real time, as fast as possible, or one for each command."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from reconstruction.base.errors import InputError
from reconstruction.capture import Provenance, Setup
from spisim.simulation.flight import Camera, Shot, true_poses
from spisim_live import Kind, Message, Pose, Sender, pose_of
from spisim_live.framing import VERSION
from spisim_live.sending import SETUP_EVERY_S
from spisim_serving.drone import Pilot
from spisim_serving.line import POLL_S, Line

STATE_EVERY_S = 1.0


@dataclass
class Tally:
    """Counts of frames and commands.

    Attributes
    ----------
    frames, late, repeated
        Frames sent, those that were ready after their due time, and those sent again on request.
    behind_s
        Sum of all delays, by which the flight takes longer than it should.
    commands, refused, corrupted
        Commands received; those of another version, without a valid pose, or for another frame
        than the next; and those with a wrong checksum.
    stops
        How often an obstacle stopped the drone.
    discarded_bytes
        Bytes that were not part of a message.
    """

    frames: int = 0
    late: int = 0
    behind_s: float = 0.0
    repeated: int = 0
    commands: int = 0
    refused: int = 0
    corrupted: int = 0
    stops: int = 0
    discarded_bytes: int = 0


class Server:
    """Sends the frames of a flight over a line, and passes commands to its pilot.

    Parameters
    ----------
    camera, pilot, line
        Record the frames, decide the motions, and connect to the peer.
    setup, provenance
        Sent before the frames, which have their true poses if the setup has poses.
    maximum
        Number of frames after which the flight ends.
    record, say, states
        Called with every frame, with a sentence for the user, and once a second with the server.
    clock, wait
        Return the time in seconds, and sleep for seconds.
    """

    def __init__(
        self,
        camera: Camera,
        pilot: Pilot,
        line: Line,
        setup: Setup,
        provenance: Provenance,
        *,
        maximum: int | None = None,
        record: Callable[[Shot], None] = lambda shot: None,
        say: Callable[[str], None] = lambda text: None,
        states: Callable[[Server], None] = lambda server: None,
        clock: Callable[[], float] = time.monotonic,
        wait: Callable[[float], object] = time.sleep,
    ) -> None:
        self.tally = Tally()
        self.camera = camera
        self._pilot = pilot
        self._line = line
        self._sender = Sender(setup, provenance, run=1 + secrets.randbelow(2**16 - 1))
        self._poses = setup.poses is not None
        self._period_s = camera.instrument.frame_time_s
        self._maximum = maximum
        self._record = record
        self._say = say
        self._states = states
        self._clock = clock
        self._wait = wait
        self._commanded: Pose | None = None
        self._over = False
        self._trouble: str | None = None
        self._last = b""
        self._state_s = clock()
        self._seen = Tally()

    @property
    def time_s(self) -> float:
        """Simulation time."""
        return self.tally.frames * self._period_s

    def run_at_rate(self) -> None:
        """Send frames in real time until the flight is over."""
        due_s = -float("inf")
        setup_s = -float("inf")
        while not self._ended():
            if self._line.open():
                due_s, setup_s = self._clock(), -float("inf")
            if self.time_s - setup_s >= SETUP_EVERY_S:
                setup_s = self.time_s
                self._line.send(self._sender.setup(self._stamp))
            for received in self._line.messages(0.0):
                self._take(received)
            message = self._frame()
            if message is None:
                break
            due_s += self._period_s
            early_s = due_s - self._clock()
            if early_s >= 0:
                self._wait(early_s)
            else:
                self.tally.late += 1
                self.tally.behind_s -= early_s
                due_s -= early_s
            self._line.send(message)

    def run_at_once(self) -> None:
        """Send all frames as fast as possible, without commands."""
        self._line.open()
        self._line.send(self._sender.setup())
        while not self._ended() and (message := self._frame()) is not None:
            self._line.send(message)

    def run_in_step(self) -> None:
        """Send a frame for each command that requests it, until the flight is over."""
        while not self._ended():
            self._line.give_way()
            if self._line.open():
                self._line.send(self._sender.setup(self._stamp))
            for message in self._line.messages(POLL_S):
                number = self._sender.number
                if not self._take(message) or self._ended():
                    continue
                if message.number == number:
                    frame = self._frame()
                    if frame is None:
                        self._over = True
                        break
                    self._last = frame
                    self._line.send(frame)
                elif self._last and message.number == (number - 1) % 2**32:
                    self.tally.repeated += 1
                    self._line.send(self._last)
                else:
                    self._refuse(f"it requests frame {message.number}; the next is {number}")
            self._over |= self._line.over
            self._state()

    @property
    def _stamp(self) -> int:
        return round(1e9 * self.time_s)

    def _ended(self) -> bool:
        return self._over or self.tally.frames == self._maximum

    def _frame(self) -> bytes | None:
        """Message of the next frame; None when the flight is over."""
        motion = self._pilot.fly(self._commanded, self.time_s, self._period_s)
        self._commanded = None
        if motion is None:
            return None
        trouble = self._pilot.trouble
        if trouble is not None and self._trouble is None:
            self.tally.stops += 1
            self._say(f"{self.time_s:.2f} s: {trouble}")
        self._trouble = trouble
        (shot,) = self.camera.shoot([motion], self._sender.number)
        self._record(shot)
        frame = shot.frame
        if self._poses:
            frame = replace(frame, poses=true_poses([motion]))
        message = self._sender.frame(frame, self._stamp)
        self.tally.frames += 1
        self._state()
        return message

    def _take(self, message: Message) -> bool:
        """Process a message; return whether it is a valid command."""
        self.tally.discarded_bytes = self._line.senders.discarded_bytes
        if message.version != VERSION:
            self._refuse(f"it has version {message.version}; this program reads {VERSION}")
        elif message.payload is None:
            self.tally.corrupted += message.kind == Kind.COMMAND
        elif message.kind == Kind.END:
            self._over = True
        elif message.kind == Kind.COMMAND:
            self.tally.commands += 1
            try:
                self._commanded = pose_of(message.payload) or self._commanded
            except InputError as error:
                self._refuse(str(error))
            return True
        return False

    def _refuse(self, why: str) -> None:
        """Count a refused command, and say why for the 1st, 2nd, 4th, 8th and so on."""
        self.tally.refused += 1
        if self.tally.refused & (self.tally.refused - 1) == 0:
            self._say(f"{self.time_s:.2f} s: command refused: {why}")

    def _state(self) -> None:
        if self._clock() - self._state_s >= STATE_EVERY_S and self.tally != self._seen:
            self._state_s = self._clock()
            self._seen = replace(self.tally)
            self._states(self)

    def end(self) -> None:
        """Tell the peer that no more frames will come."""
        if self._line.is_open:
            self._line.send(self._sender.end(self._stamp))
