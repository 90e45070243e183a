"""Bringing a UR arm to rest, arc first: asked of the client process, then past it, and not believed until it is seen."""

import time
from collections.abc import Iterator
from contextlib import suppress

from weldsim.execution.rtde_talk import LinkError
from weldsim.execution.ur_config import UrConfig
from weldsim.execution.ur_dashboard import Dashboard, switch_off
from weldsim.execution.ur_link import Link
from weldsim.execution.ur_process import ClientError
from weldsim.execution.ur_status import Trouble, at_rest, foreign_trouble, program_trouble
from weldsim.execution.ur_stream import Sample, StateStream

PATIENCE = 0.2  # [s] for a conversation that must not hold up a stop
CLIENT_STOP = 0.5  # [s] that the client process may take to bring the arm to rest
CLIENT_END = 1.0  # [s] that it may take to end
STEP = 0.02  # [s]
NOT_OURS = ("foreign_program", "remote_control", "emergency_stop")
"""Troubles after which there is no program of ours to end."""


class Halt:
    """One stop of one connection.

    Attributes:
        trouble: what makes the connection useless from now on, or None.
        notes: what was out of the ordinary, lines of text.
        unseen: whether arc off and arm at rest were not seen in time.
    """

    def __init__(self, link: Link, config: UrConfig, trouble: Trouble | None, last: bool = False) -> None:
        """Asks for arc off and rest at once, without waiting. Args: last: the client process is to end afterwards."""
        self._link, self._config, self._last = link, config, last
        self.trouble = trouble
        self.notes: list[str] = []
        self.unseen = False
        self._forced = False
        self._number: int | None = None
        try:
            self._number = link.client.stop()
        except ClientError as gone:
            self._lose_client(gone)
        self._began = time.monotonic()

    def explain(self, sample: Sample) -> Trouble | None:
        """The trouble, told apart where the dashboard knows more: local control, or a program that is not ours."""
        trouble = self.trouble
        if trouble is None or trouble.rule not in ("program", "arc", "follow"):
            return trouble
        try:
            with Dashboard(self._config.host, PATIENCE) as dashboard:
                remote = dashboard.remote_control() if self._link.series == "e" else None
                other = foreign_trouble(dashboard.ask("programState"))
        except LinkError:
            return trouble
        if remote is False:
            self.trouble = program_trouble(sample, remote) or trouble
        else:
            self.trouble = other or trouble
        return self.trouble

    def wait(self) -> Iterator[Sample]:
        """Every state until arc and arm are seen at rest, or until `stop_timeout` [s]."""
        end = self._began + self._config.stop_timeout
        calm = False
        while not (calm and self._client_done()):
            if time.monotonic() > end:
                self.unseen = not calm
                if calm:
                    self.notes.append("the client did not answer")
                break
            if not calm and time.monotonic() - self._began > CLIENT_STOP:
                self._force()
            try:
                if self._link.stream.wait(STEP):
                    sample = self._link.stream.take()
                    calm = self._calm(sample)
                    yield sample
            except LinkError as lost:
                self._reopen(lost)
        if self._last:
            self._end_client()
        if self.trouble is not None and self.trouble.rule not in NOT_OURS:
            self._end_program()

    def _calm(self, sample: Sample) -> bool:
        """Whether a state that came after the stop was asked for shows arc off and arm at rest."""
        burning = sample.actual_digital_output_bits >> self._config.arc_output & 1
        return not burning and at_rest(sample) and sample.arrived > self._began

    def _client_done(self) -> bool:
        """Whether the client process has done its part, or has been ended because it did not."""
        if self._number is None:
            return True
        try:
            self._link.client.pump()
        except ClientError as gone:
            self._lose_client(gone)
            return True
        if self._link.client.stopped(self._number):
            return True
        if time.monotonic() - self._began > CLIENT_STOP:
            self._link.client.kill()
            self._lose_client(ClientError(f"the client process did not stop within {CLIENT_STOP:g} s and was ended"))
        return self._number is None

    def _lose_client(self, gone: ClientError) -> None:
        self._number = None
        self.notes.append(str(gone))
        if self.trouble is None:
            self.trouble = Trouble("client", f"{gone}; connect again")
        self._force()

    def _force(self) -> None:
        """Past the client: the output off by a program of its own, the control program ended. Once."""
        if self._forced:
            return
        self._forced = True
        told = switch_off(self._config.host, self._config.arc_output, PATIENCE)
        with suppress(LinkError), Dashboard(self._config.host, PATIENCE) as dashboard:
            self.trouble = foreign_trouble(dashboard.ask("programState")) or self.trouble  # that is why the client hears nothing
        ended = self.trouble is not None and self.trouble.rule in NOT_OURS
        ended = ended or self._end_program()
        self.notes.append(
            f"stopped past the client: output {'told' if told else 'NOT told'}, program {'ended' if ended else 'NOT ended'}"
        )

    def _end_program(self) -> bool:
        try:
            with Dashboard(self._config.host, PATIENCE) as dashboard:
                return dashboard.stop_program()
        except LinkError:
            return False

    def _end_client(self) -> None:
        if self._number is not None and not self._link.client.close(CLIENT_END):
            self._end_program()
        self._link.client.kill()

    def _reopen(self, lost: LinkError) -> None:
        """Try for a new stream of states, to see what has become of arm and arc."""
        if self.trouble is None:
            self.trouble = Trouble("link", f"{lost}; connect again")
        self._link.stream.close()
        try:
            self._link.stream = StateStream(self._config.host, PATIENCE)
        except LinkError:
            time.sleep(STEP)
