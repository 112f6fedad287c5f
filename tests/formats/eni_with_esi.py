"""An ENI joined with the ESI of its devices."""

from __future__ import annotations

from described import bus

from fsoe_net.formats.esi.read import load_esi
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.description import Description
from fsoe_net.model.joined_descriptions import fill_devices

ESI = """<EtherCATInfo><Vendor><Id>2</Id></Vendor><Descriptions><Devices>
<Device Physics="KK"><Type ProductCode="#x1af63052" RevisionNo="#x00130000">LOGIC</Type>
<Name>Logic</Name>
<Sm DefaultSize="256" StartAddress="#x1000" ControlByte="#x26" Enable="1">MBoxOut</Sm>
<Sm DefaultSize="512" StartAddress="#x1100" ControlByte="#x22" Enable="1">MBoxIn</Sm>
<Sm StartAddress="#x1300" ControlByte="#x64" Enable="1">Outputs</Sm>
<Sm StartAddress="#x1e00" ControlByte="#x20" Enable="1">Inputs</Sm>
<RxPdo Fixed="1" Sm="2"><Index>#x1600</Index><Name>a</Name>
<Entry><Index>#x7000</Index><SubIndex>1</SubIndex><BitLen>8</BitLen></Entry></RxPdo>
<RxPdo Sm="2"><Index>#x17f0</Index><Name>b</Name>
<Entry><Index>#xf788</Index><SubIndex>0</SubIndex><BitLen>8</BitLen></Entry></RxPdo>
<Mailbox><CoE PdoAssign="1" PdoConfig="true"/><FoE/></Mailbox>
<Dc><OpMode><Name>DC</Name><AssignActivate>#x300</AssignActivate>
<CycleTimeSync0 Factor="-2">0</CycleTimeSync0><ShiftTimeSync0>-500</ShiftTimeSync0></OpMode></Dc>
</Device>
<Device Physics="YKY"><Type ProductCode="#x07703052" RevisionNo="#x00120000">TERM</Type>
<Name>Terminal</Name></Device>
</Devices></Descriptions></EtherCATInfo>"""


def with_esi() -> Description:
    out = Collector()
    types = load_esi(ESI.encode(), out)
    assert types is not None
    assert out.diagnostics == []
    return fill_devices(bus(2), [types], [])
