"""Ends as a device developer might have built them: right, or with one thing forgotten."""

from __future__ import annotations

from fsoe_net.campaign.channel import SessionIds
from fsoe_net.fsoe.chain import Chain, advance
from fsoe_net.fsoe.event import State
from fsoe_net.fsoe.main_instance import MainInstance
from fsoe_net.fsoe.sub_instance import SubInstance


class _NoCrc(Chain):
    """Takes every frame as right."""

    def receive(self, pdu):
        if not super().receive(pdu):
            self.peer = self.last = pdu.crcs[0]
            self.rx_sequence = advance(self.rx_sequence)
        return True

    def copy(self):
        twin = type(self)()
        for name in Chain.__slots__:
            setattr(twin, name, getattr(self, name))
        return twin


class ignores_crc(SubInstance):  # noqa: N801 - named like a factory
    def __init__(self, config):
        super().__init__(config, session_ids=SessionIds(5))

    def _power_up(self):
        super()._power_up()
        self._chain = _NoCrc()


class watches_changes(SubInstance):  # noqa: N801 - named like a factory
    """Restarts its watchdog only for a frame whose safe data differ from those before."""

    def __init__(self, config):
        super().__init__(config, session_ids=SessionIds(5))

    def _power_up(self):
        super()._power_up()
        self._before = b""

    def _answer_data(self, pdu):
        start_ns, same = self._watchdog_start_ns, pdu.safe_data == self._before
        answer = super()._answer_data(pdu)
        if same:
            self._watchdog_start_ns = start_ns
        self._before = pdu.safe_data
        return answer


class main_ignores_crc(MainInstance):  # noqa: N801 - named like a factory
    def __init__(self, config):
        super().__init__(config, session_ids=SessionIds(5))

    def _power_up(self):
        super()._power_up()
        self._chain = _NoCrc()


class ignores_sequence(SubInstance):  # noqa: N801 - named like a factory
    """Takes any data frame again that was right once."""

    def __init__(self, config):
        super().__init__(config, session_ids=SessionIds(5))

    def _power_up(self):
        super()._power_up()
        self._once = {}

    def _new_frame(self, received):
        pdu = super()._new_frame(received)
        if pdu is None or self.state is not State.DATA:
            return pdu
        chain = self._chain
        if pdu in self._once and not chain.copy().receive(pdu):
            chain.last, chain.peer, chain.rx_sequence = self._once[pdu]
        else:
            self._once = {**self._once, pdu: (chain.last, chain.peer, chain.rx_sequence)}
        return pdu


class ignores_address(SubInstance):  # noqa: N801 - named like a factory
    def __init__(self, config):
        super().__init__(config, session_ids=SessionIds(5))

    def _new_frame(self, received):
        if self.state is State.CONNECTION and len(self._told) >= 4:
            self._told[2:4] = self.config.address.to_bytes(2, "little")
        return super()._new_frame(received)


class ignores_watchdog(SubInstance):  # noqa: N801 - named like a factory
    def __init__(self, config):
        super().__init__(config, session_ids=SessionIds(5))

    def _watchdog_expired(self):
        return False


class _Stranger:
    """Shows no more than a foreign implementation must: cannot fork, tells no state."""

    kind: type

    def __init__(self, config):
        self._end = self.kind(config, session_ids=SessionIds(5))

    def step(self, now_ns, received):
        return self._end.step(now_ns, received)

    def power_cycle(self):
        self._end.power_cycle()
        self._end._session_ids.value = 5

    @property
    def received_safe_data(self):
        return self._end.received_safe_data

    @property
    def data_valid(self):
        return self._end.data_valid


class strange_sub(_Stranger):  # noqa: N801 - named like a factory
    kind = SubInstance


class strange_main(_Stranger):  # noqa: N801 - named like a factory
    kind = MainInstance


class strange_sub_that_takes_data(strange_sub):  # noqa: N801 - named like a factory
    def set_safe_data(self, data):
        self._end.set_safe_data(data)

    @property
    def enable(self):
        return self._end.enable

    @enable.setter
    def enable(self, value):
        self._end.enable = value


class dead_sub(strange_sub):  # noqa: N801 - named like a factory
    def step(self, now_ns, received):
        return None


class raising_sub(strange_sub):  # noqa: N801 - named like a factory
    def step(self, now_ns, received):
        raise ValueError("division by cucumber")


def no_end(_config):
    return object()


not_callable = 3
