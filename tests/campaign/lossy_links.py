"""Connections for campaigns."""

from __future__ import annotations

from fsoe_net.campaign.clean_run import TrialConnection
from fsoe_net.campaign.fault_classes import CATALOGUE
from fsoe_net.campaign.trials import CampaignConfig
from fsoe_net.fsoe.config import MainConfig, SubConfig

DRAWN = [name for name in CATALOGUE if name != "bit_errors"]
SIZES = [(1, 1), (2, 2), (6, 4), (1, 14)]


def make_link(
    out=2, inn=2, *, app=b"", watchdog_ms=20, cycle_ns=1_000_000, delay=(1, 1), **factories
) -> TrialConnection:
    def main(connection_id, address):
        return MainConfig(
            connection_id=connection_id,
            address=address,
            watchdog_ms=watchdog_ms,
            safe_out_bytes=out,
            safe_in_bytes=inn,
            app_parameters=app,
        )

    return TrialConnection(
        name=f"link {out}x{inn}",
        main=main(0xABCD, 0x1234),
        sub=SubConfig(
            address=0x1234, safe_out_bytes=out, safe_in_bytes=inn, app_parameter_bytes=len(app)
        ),
        other=main(77, 0x1235),
        cycle_ns=cycle_ns,
        delay_cycles=delay,
        **factories,
    )


def make_config(*sizes, seed=1, **changes) -> CampaignConfig:
    return CampaignConfig(links=(make_link(*(sizes or (2, 2)), **changes),), seed=seed)
