"""What tools print about a small bus of our own: whole outputs, to be read whole and cut."""

from __future__ import annotations

# ruff: noqa: W291 - the tools end many lines with a blank

PDOS = """\
SM0: PhysAddr 0x1000, DefaultSize  128, ControlRegister 0x26, Enable 1
SM1: PhysAddr 0x1080, DefaultSize  128, ControlRegister 0x22, Enable 1
SM2: PhysAddr 0x1100, DefaultSize    8, ControlRegister 0x64, Enable 1
  RxPDO 0x1600 "FSoE out"
    PDO entry 0x7000:01,  8 bit, "cmd "quoted""
    PDO entry 0x7001:01,  8 bit, ""
    PDO entry 0x7000:03, 16 bit, "crc"
    PDO entry 0x7000:02, 16 bit, "id"
  RxPDO 0x17f0 ""
    PDO entry 0xf788:00,  8 bit, ""
SM3: PhysAddr 0x1180, DefaultSize    6, ControlRegister 0x20, Enable 1
  TxPDO 0x1a00 ""
    PDO entry 0x6000:01,  8 bit, ""
    PDO entry 0x6001:01,  4 bit, ""
    PDO entry 0x0000:00,  4 bit, "Gap"
    PDO entry 0x6000:03, 16 bit, ""
    PDO entry 0x6000:02, 16 bit, ""
"""

TWO_PDOS = "=== Master 0, Slave 3 ===\n" + PDOS + "=== Master 0, Slave 11 ===\n" + PDOS

CSTRUCT = """\
/* Master 0, Slave {hex}, "{order}"
 * Vendor ID:       0x00000002
 * Product code:    0x077a2c52
 * Revision number: 0x00120000
 */

ec_pdo_entry_info_t {name}_pdo_entries[] = {{
    {{0x7000, 0x01, 8}}, /* cmd */
    {{0x7001, 0x01, 8}},
    {{0x7000, 0x03, 16}}, /* crc */
    {{0x7000, 0x02, 16}}, /* id */
    {{0x6000, 0x01, 8}}, /* cmd */
    {{0x6001, 0x01, 1}}, /* in */
    {{0x0000, 0x00, 7}}, /* Gap */
    {{0x6000, 0x03, 16}}, /* crc */
    {{0x6000, 0x02, 16}}, /* id */
}};

ec_pdo_info_t {name}_pdos[] = {{
    {{0x1600, 4, {name}_pdo_entries + 0}}, /* out */
    {{0x17ff, 0, NULL}}, /* empty */
    {{0x1a00, 5, {name}_pdo_entries + 4}}, /* in */
}};

ec_sync_info_t {name}_syncs[] = {{
    {{0, EC_DIR_OUTPUT, 0, NULL, EC_WD_DISABLE}},
    {{1, EC_DIR_INPUT, 0, NULL, EC_WD_DISABLE}},
    {{2, EC_DIR_OUTPUT, 2, {name}_pdos + 0, EC_WD_ENABLE}},
    {{3, EC_DIR_INPUT, 1, {name}_pdos + 2, EC_WD_DISABLE}},
    {{0xff}}
}};
"""


def cstruct(*positions: int) -> str:
    """The tables of several SubDevices; the comments count in hexadecimal, as the tool does."""
    return "\n".join(
        CSTRUCT.format(hex=f"{n:x}", order="EK1914", name=f"slave_{n}") for n in positions
    )


XML = """\
<?xml version="1.0" ?>
<EtherCATInfo>
  <!-- Slave 4 -->
  <Vendor>
    <Id>2</Id>
  </Vendor>
  <Descriptions>
    <Devices>
      <Device>
        <Type ProductCode="#x077a2c52" RevisionNo="#x00120000">EK1914 <&></Type>
        <Name><![CDATA[coupler & more]]></Name>
        <Sm Enable="1" StartAddress="#x1000" ControlByte="#x26" DefaultSize="128" />
        <Sm Enable="1" StartAddress="#x1080" ControlByte="#x22" DefaultSize="128" />
        <Sm Enable="1" StartAddress="#x1100" ControlByte="#x64" DefaultSize="8" />
        <Sm Enable="1" StartAddress="#x1180" ControlByte="#x20" DefaultSize="6" />
        <RxPdo Sm="2" Fixed="1" Mandatory="1">
          <Index>#x1600</Index>
          <Name>out & <more></Name>
          <Entry>
            <Index>#x7000</Index>
            <SubIndex>1</SubIndex>
            <BitLen>8</BitLen>
            <Name>cmd < 3 & 4</Name>
            <DataType>UINT8</DataType>
          </Entry>
          <Entry>
            <Index>#x0000</Index>
            <BitLen>8</BitLen>
          </Entry>
        </RxPdo>
        <TxPdo Sm="3" Fixed="1" Mandatory="1">
          <Index>#x1a00</Index>
          <Name></Name>
          <Entry>
            <Index>#x6000</Index>
            <SubIndex>10</SubIndex>
            <BitLen>16</BitLen>
            <Name></Name>
            <DataType>UINT16</DataType>
          </Entry>
        </TxPdo>
      </Device>
    </Devices>
  </Descriptions>
</EtherCATInfo>
"""

SLAVES = """\
 0  0:0      OP          +  EK1100 EtherCAT coupler
 1  0:1      PREOP       E  EL1918, 8 inputs
 2  5:0      SAFEOP+ERROR  +  0x00000002:0x077a2c52
10  65535:0  INIT        +  EP1957
"""

SLAVES_V = """\
=== Master 0, Slave 2 ===
Alias: 5
Device: Main
State: PREOP
Flag: +
Identity:
  Vendor Id:       0x00000002
  Product code:    0x077a2c52
  Revision number: 0x00120000
  Serial number:   0x00000007
DL information:
  FMMU bit operation: no
  Distributed clocks: yes, 64 bit
  DC system time transmission delay: 0 ns
Port  Type  Link  Loop    Signal  NextSlave  RxTime [ns]  Diff [ns]   NextDc [ns]
   0* MII   up    open    yes             -    123456789          0            0
   1  EBUS  up    open    yes             3    123456999        210          150
   2  N/A   down  closed  no              -            -          -            -
   3  N/A   down  closed  no              -            -          -            -
Mailboxes:
  Bootstrap RX: 0x1000/128, TX: 0x1080/128
  Standard  RX: 0x1000/128, TX: 0x1080/128
  Supported protocols: CoE, FoE
General:
  Group: Safety
  Image name: 
  Order number: EK1914
  Device name: EK1914 coupler
  CoE details:
    Enable SDO: yes
    Enable SDO Info: yes
    Enable PDO Assign: no
    Enable PDO Configuration: no
    Enable Upload at startup: yes
    Enable SDO complete access: no
  Flags:
    Enable SafeOp: no
    Enable notLRW: yes
  Current consumption: 0 mA
"""

# As the tool of IgH 1.6.1 printed it of the emulated coupler of the e-stop cell.
SII_V = """\
SII Area:
  05 00 00 00 00 00 00 00 00 00 00 00 00 00 48 00
  02 00 00 00 52 2c 7a 07 00 00 00 00 00 00 00 00
  00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00
  00 10 80 00 80 10 80 00 04 00 00 00 00 00 00 00
  00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00
  00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00
  00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00
  00 00 00 00 00 00 00 00 00 00 00 00 21 00 01 00
SII Category 0x000a (STRINGS), 4 words
  01 06 65 6b 31 39 31 34
SII Category 0x001e (General), 16 words
  01 00 01 01 00 21 00 00 00 00 00 00 00 00 00 00
  00 00 00 00 00 00 00 00 00 00 00 00 00 00 00 00
SII Category 0x0028 (FMMU), 1 words
  01 02
SII Category 0x0029 (SyncM), 16 words
  00 10 80 00 26 00 01 01 80 10 80 00 22 00 01 02
  00 11 08 00 64 00 01 03 10 11 08 00 20 00 01 04
SII Category 0x0033 (RXPDO), 60 words
  00 16 06 02 00 00 00 00 00 70 01 00 00 08 00 00
  01 70 01 00 00 01 00 00 01 70 02 00 00 01 00 00
  00 00 00 00 00 06 00 00 00 70 03 00 00 10 00 00
  00 70 02 00 00 10 00 00 01 16 07 02 00 00 00 00
  10 70 01 00 00 01 00 00 10 70 02 00 00 01 00 00
  10 70 03 00 00 01 00 00 10 70 04 00 00 01 00 00
  10 70 05 00 00 01 00 00 10 70 06 00 00 01 00 00
  00 00 00 00 00 0a 00 00
SII Category 0x0032 (TXPDO), 52 words
  00 1a 06 03 00 00 00 00 00 60 01 00 00 08 00 00
  01 60 01 00 00 01 00 00 01 60 02 00 00 01 00 00
  00 00 00 00 00 06 00 00 00 60 03 00 00 10 00 00
  00 60 02 00 00 10 00 00 01 1a 05 03 00 00 00 00
  10 60 01 00 00 01 00 00 10 60 02 00 00 01 00 00
  10 60 03 00 00 01 00 00 10 60 04 00 00 01 00 00
  00 00 00 00 00 0c 00 00
"""

CONFIG = """\
Alias: 0
Position: 1
Vendor Id: 0x00000002
Product code: 0x077e3052
Attached slave: 1 (OP)
Watchdog divider: (Default)
Watchdog intervals: (Default)
SM2, Dir: Output, Watchdog: Disable
  PDO 0x1600
    PDO entry 0x7080:01,  8 bit
    PDO entry 0x7081:01,  8 bit
    PDO entry 0x7080:03, 16 bit
    PDO entry 0x7080:02, 16 bit
SM3, Dir: Input, Watchdog: Default
  PDO 0x1a00
    PDO entry 0x6080:01,  8 bit
SDO configuration:
  0x8000:01, 2 byte
    07 01 
  0x8010 C, 20 byte
    00 01 02 03 04 05 06 07 08 09 0a 0b 0c 0d 0e 0f
    10 11 12 13 
IDN configuration:
  None.
DC configuration:
  AssignActivate: 0x0300
         Cycle [ns]   Shift [ns]
  SYNC0      1000000            0
  SYNC1            0            0

"""

DOMAINS = """\
Domain0: LogBaseAddr 0x00000000, Size  33, WorkingCounter 6/6
  SlaveConfig 0:1, SM2 (Output), LogAddr 0x00000000, Size 9
    00 00 00 00 00 00 00 00 00 
  SlaveConfig 0:1, SM3 ( Input), LogAddr 0x00000009, Size 8
    00 00 00 00 00 00 00 00 
  SlaveConfig 0:0, SM2 (Output), LogAddr 0x00000011, Size 8
    00 00 00 00 00 00 00 00 
  SlaveConfig 0:0, SM3 ( Input), LogAddr 0x00000019, Size 8
    00 00 00 00 00 00 00 00 
"""

SOEM = """\
SOEM (Simple Open EtherCAT Master)
Slaveinfo
Starting slaveinfo
ec_init on eth1 succeeded.
1 slaves found and configured.
Calculated workcounter 3

Slave:1
 Name:Drive
 Output size: 64bits
 Input size: 48bits
 State: 4
 Delay: 0[ns]
 Has DC: 1
 DCParentport:0
 Activeports:1.0.0.0
 Configured address: 1001
 Man: 000022d2 ID: 00000302 Rev: 0a500000
 SM0 A:1000 L: 128 F:00010026 Type:1
 SM1 A:1080 L: 128 F:00010022 Type:2
 SM2 A:1100 L:   8 F:00010064 Type:3
 SM3 A:1180 L:   6 F:00010020 Type:4
 FMMU0 Ls:00000000 Ll:   8 Lsb:0 Leb:7 Ps:1100 Psb:0 Ty:02 Act:01
 FMMU1 Ls:00000008 Ll:   6 Lsb:0 Leb:7 Ps:1180 Psb:0 Ty:01 Act:01
 FMMUfunc 0:1 1:2 2:3 3:0
 MBX length wr: 128 rd: 128 MBX protocols : 04
 CoE details: 2f FoE details: 00 EoE details: 00 SoE details: 00
 Ebus current: 0[mA]
 only LRD/LWR:0
PDO mapping according to CoE :
  SM2 outputs
     addr b   index: sub bitl data_type    name
  [0x0000.0] 0x6040:0x00 0x10 UNSIGNED16   Controlword
  [0x0002.0] 0x6770:0x01 0x08 UNSIGNED8    FSoE Command
  [0x0003.0] 0x2620:0x01 0x08 BIT8         
  [0x0004.0] 0x6770:0x03 0x10 UNSIGNED16   
  [0x0006.0] 0x6770:0x02 0x10
  SM3 inputs
     addr b   index: sub bitl data_type    name
  [0x0008.0] 0x6760:0x01 0x08 UNSIGNED8    FSoE Command
  [0x0009.0] 0x2600:0x01 0x08 UNSIGNED8    Safe
  [0x000A.0] 0x6760:0x03 0x10 UNSIGNED16   CRC
  [0x000C.0] 0x6760:0x02 0x10 UNSIGNED16   Connection ID
End slaveinfo, close socket
End program
"""

SOEM_MAP = SOEM[SOEM.index("PDO mapping") : SOEM.index("End slaveinfo")]

LCEC = """\
<masters>
  <master idx="0" appTimePeriod="2000000" refClockSyncCycles="-1">
    <slave idx="0" type="EK1100"/>
    <slave idx="1" type="EL6900" name="logic">
      <modParam name="fsoeSlaveIdx" value="4"/>
      <modParam name="fsoeSlaveIdx" value="2"/>
      <modParam name="stdInName" value="x"/>
    </slave>
    <slave idx="2" type="EL1904"/>
    <slave idx="4" type="EL2904" name="out"/>
    <slave idx="5" type="generic" vid="00000002" pid="1a5f3052" configPdos="true">
      <dcConf assignActivate="300" sync0Cycle="*1" sync0Shift="0"/>
      <sdoConfig idx="8000" subIdx="0a"><sdoDataRaw data="01 02"/></sdoConfig>
      <sdoConfig idx="8000" subIdx="complete"><sdoDataRaw data="01 02"/></sdoConfig>
      <syncManager idx="0" dir="out"/>
      <syncManager idx="2" dir="out">
        <pdo idx="1600">
          <pdoEntry idx="7000" subIdx="10" bitLen="16" halPin="pin" halType="u32"/>
          <pdoEntry idx="0000" subIdx="00" bitLen="8"/>
        </pdo>
      </syncManager>
      <syncManager idx="3" dir="in"/>
    </slave>
  </master>
</masters>
"""

ROS_SLAVES = """\
ethercat_slaves:
  left:
    vendor_id: 0x00000A12
    product_code: 0x00a986fd
    position: 1
    assign_activate: 0x0700
    input_port: 0x6010
  right: {vendor_id: 0x12, product_code: 7, alias: 3, position: 0}
  period_ns: 500000
  run_time: 360000
"""

TWINSAFE = """\
<?xml version="1.0"?>
<Project><FileVersion>1204</FileVersion><SAddress>9</SAddress>
<Groups><Group><Name>G</Name><Vars><Var><Name>RUN</Name></Var></Vars></Group></Groups>
<Links><Link><Alias>a</Alias></Link></Links>
<Connections>
<Connection><Name>Klemme 7 (EL2904)</Name><Mode>Master</Mode><SAddress>4</SAddress>
<SWatchdog>100</SWatchdog><ConId>3</ConId><SafeUserPara><Size>4</Size><Data>06000001</Data>
</SafeUserPara><VendorId>2</VendorId><ModuleIdent>290</ModuleIdent></Connection>
<Connection><Name>x</Name><Mode>Slave</Mode><SAddress>5</SAddress><SWatchdog>200</SWatchdog>
<ConId>1</ConId><VendorId>2</VendorId></Connection>
</Connections></Project>
"""
