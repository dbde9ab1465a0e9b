"""Who can reach a campaign while it runs: nobody from outside this machine."""

import ipaddress

import psutil
import pytest

from pipeline.campaign.cluster import client
from pipeline.config.load import load


def listening() -> set[str]:
    """Addresses that this process and its children take connections on."""
    own = psutil.Process()
    found = [c for p in (own, *own.children(recursive=True)) for c in p.net_connections("inet")]
    return {c.laddr.ip for c in found if c.status == psutil.CONN_LISTEN}


@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_a_campaign_listens_on_loopback_only(kind):
    with client(load([f"cluster={kind}"]).cluster):
        addresses = listening()
    assert addresses
    assert [a for a in addresses if not ipaddress.ip_address(a).is_loopback] == []
