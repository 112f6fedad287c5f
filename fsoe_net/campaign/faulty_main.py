"""A main that sends frames with valid CRCs that its sub must reject."""

from __future__ import annotations

import enum
import random
import struct
from dataclasses import replace

from fsoe_net.campaign.channel import SessionIds
from fsoe_net.fsoe.config import MainConfig
from fsoe_net.fsoe.main_instance import MainInstance


class Oddity(enum.Enum):
    """The error, and the answer of the sub (§6 rows 17, 19, 20)."""

    ADDRESS = "another FSoE address: Reset 6"
    CONNECTION_ID = "another ConnID in the data than in the field: Reset 3"
    COMM_LENGTH = "a communication parameter length other than 2: Reset 8"
    WATCHDOG = "a watchdog of 0: Reset 9"
    APP_LENGTH = "another length than it sends: Reset 10"
    MORE = "more application parameters: Reset 1, or 10 with as many frames"


class FaultyMain(MainInstance):
    """Our main with one value of the start-up changed.

    Attributes:
        oddity: The wrong value; used from the next power-up on.
    """

    def __init__(self, config: MainConfig) -> None:
        self.oddity, self.by = Oddity.ADDRESS, 1
        self._right = config
        super().__init__(config, session_ids=SessionIds(3))

    def change(self, rng: random.Random) -> None:
        """Select the error."""
        self.oddity, self.by = rng.choice(list(Oddity)), rng.randrange(1, 0x100)
        app = self._right.app_parameters
        more = bytes(rng.choice((1, 2, 4, 8))) if self.oddity is Oddity.MORE else b""
        self.config = replace(self._right, app_parameters=app + more)

    def _begin(self, payload: bytes) -> bytes:
        values = bytearray(payload)
        # Connection data: ID, address. Parameters: length, watchdog, application length.
        at = {
            ("CONNECTION", Oddity.CONNECTION_ID): 0,
            ("CONNECTION", Oddity.ADDRESS): 2,
            ("PARAMETER", Oddity.COMM_LENGTH): 0,
            ("PARAMETER", Oddity.APP_LENGTH): 4,
        }.get((self.state.name, self.oddity))
        if at is not None:
            (value,) = struct.unpack_from("<H", values, at)
            struct.pack_into("<H", values, at, value ^ self.by)
        elif (self.state.name, self.oddity) == ("PARAMETER", Oddity.WATCHDOG):
            values[2:4] = b"\0\0"
        return super()._begin(bytes(values))
