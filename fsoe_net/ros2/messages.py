"""ROS 2 messages as DDS types; only standard messages, so that no interface must be built.

Needs ``cyclonedds``. Names are those of the types in an rmw. Each field has the name, type and
place of the message definition, so the bytes are the same as those of ROS itself. Annotations are
evaluated by ``cyclonedds``, which does not accept strings.
"""

from dataclasses import dataclass, field

from cyclonedds.idl import IdlStruct, types

from fsoe_net.ros2.values import SignalKind


@dataclass
class Stamp(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """Seconds and nanoseconds since 1970, UTC."""

    sec: types.int32 = 0
    nanosec: types.uint32 = 0


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """Time, and coordinate frame."""

    stamp: Stamp = field(default_factory=Stamp)
    frame_id: str = ""


@dataclass
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    """One value of a status."""

    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    """State of one subject; levels are those of `RosLevel`."""

    level: types.byte
    name: str
    message: str
    hardware_id: str
    values: types.sequence[KeyValue]


@dataclass
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    """Statuses at one moment."""

    header: Header
    status: types.sequence[DiagnosticStatus]


@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    """Actual values of joints, in the order of the names."""

    header: Header
    name: types.sequence[str]
    position: types.sequence[types.float64]
    velocity: types.sequence[types.float64]
    effort: types.sequence[types.float64]


@dataclass
class GenericHardwareState(IdlStruct, typename="control_msgs::msg::dds_::GenericHardwareState_"):
    """State of any device; 0 in a field is unknown."""

    health_status: types.uint8 = 0
    error_domain: types.sequence[types.uint8] = field(default_factory=list)
    operational_mode: types.uint8 = 0
    power_state: types.uint8 = 0
    connectivity_status: types.uint8 = 0
    manufacturer: str = ""
    model: str = ""
    firmware_version: str = ""
    state_details: types.sequence[KeyValue] = field(default_factory=list)


@dataclass
class _CanOpenState(IdlStruct, typename="control_msgs::msg::dds_::CANopenState_"):
    node_id: types.uint8
    nmt_state: types.uint8
    dsp_402_state: types.uint8
    last_emcy_code: types.uint32


@dataclass
class EtherCatState(IdlStruct, typename="control_msgs::msg::dds_::EtherCATState_"):
    """AL state of a SubDevice, and its identity as text."""

    slave_position: types.uint16
    vendor_id: str
    product_code: str
    al_state: types.uint8
    has_error: bool
    al_status_code: types.uint16


@dataclass
class _Vda5050State(IdlStruct, typename="control_msgs::msg::dds_::VDA5050State_"):
    order_id: str
    action_status: str
    last_node_id: types.uint32
    driving: bool
    battery_charge: types.float64
    operating_mode: str
    error_type: str
    error_description: str


@dataclass
class HardwareDeviceStatus(IdlStruct, typename="control_msgs::msg::dds_::HardwareDeviceStatus_"):
    """State of one device by the standards that it implements."""

    header: Header
    device_id: str
    hardware_status: types.sequence[GenericHardwareState]
    canopen_states: types.sequence[_CanOpenState] = field(default_factory=list)
    ethercat_states: types.sequence[EtherCatState] = field(default_factory=list)
    vda5050_states: types.sequence[_Vda5050State] = field(default_factory=list)


@dataclass
class HardwareStatus(IdlStruct, typename="control_msgs::msg::dds_::HardwareStatus_"):
    """State of the devices of a bus, as control_msgs 6.5 to 6.8 define it."""

    header: Header
    hardware_id: str
    hardware_device_states: types.sequence[HardwareDeviceStatus]


@dataclass
class _Bool(IdlStruct, typename="std_msgs::msg::dds_::Bool_"):
    data: bool


@dataclass
class _Int64(IdlStruct, typename="std_msgs::msg::dds_::Int64_"):
    data: types.int64


@dataclass
class _UInt64(IdlStruct, typename="std_msgs::msg::dds_::UInt64_"):
    data: types.uint64


@dataclass
class _Float64(IdlStruct, typename="std_msgs::msg::dds_::Float64_"):
    data: types.float64


SIGNALS = {
    SignalKind.BOOL: _Bool,
    SignalKind.SIGNED: _Int64,
    SignalKind.UNSIGNED: _UInt64,
    SignalKind.REAL: _Float64,
}


@dataclass
class TriggerRequest(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Request_"):
    """A request without fields; the header is needed by `rmw_cyclonedds_cpp` to find the caller."""

    client: types.uint64
    number: types.int64
    structure_needs_at_least_one_member: types.uint8 = 0


@dataclass
class TriggerResponse(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Response_"):
    """The answer; ``client`` and ``number`` are those of the request."""

    client: types.uint64
    number: types.int64
    success: bool
    message: str


@dataclass
class _ParameterValue(IdlStruct, typename="rcl_interfaces::msg::dds_::ParameterValue_"):
    """A value with its type: `rcl_interfaces/msg/ParameterType`, 1 bool, 2 integer, 3 double."""

    type: types.uint8
    bool_value: bool
    integer_value: types.int64
    double_value: types.float64
    string_value: str
    byte_array_value: types.sequence[types.byte]
    bool_array_value: types.sequence[bool]
    integer_array_value: types.sequence[types.int64]
    double_array_value: types.sequence[types.float64]
    string_array_value: types.sequence[str]

    def python(self) -> bool | int | float | None:
        """Return its value, or ``None`` if it is neither a bool nor a number."""
        return {1: self.bool_value, 2: self.integer_value, 3: self.double_value}.get(self.type)


@dataclass
class _Parameter(IdlStruct, typename="rcl_interfaces::msg::dds_::Parameter_"):
    """A name and its value."""

    name: str
    value: _ParameterValue


@dataclass
class ParameterResult(IdlStruct, typename="rcl_interfaces::msg::dds_::SetParametersResult_"):
    """Result for one parameter."""

    successful: bool
    reason: str


@dataclass
class SetParametersRequest(IdlStruct, typename="rcl_interfaces::srv::dds_::SetParameters_Request_"):
    """Values to be set, each independently."""

    client: types.uint64
    number: types.int64
    parameters: types.sequence[_Parameter]


@dataclass
class SetParametersResponse(
    IdlStruct, typename="rcl_interfaces::srv::dds_::SetParameters_Response_"
):
    """Result for each parameter, in the same order."""

    client: types.uint64
    number: types.int64
    results: types.sequence[ParameterResult]


@dataclass
class GetSdoRequest(IdlStruct, typename="ethercat_msgs::srv::dds_::GetSdo_Request_"):
    """The object to read."""

    client: types.uint64
    number: types.int64
    master_id: types.int16
    slave_position: types.uint16
    sdo_index: types.uint16
    sdo_subindex: types.uint8
    sdo_data_type: str


@dataclass
class GetSdoResponse(IdlStruct, typename="ethercat_msgs::srv::dds_::GetSdo_Response_"):
    """Its value; not a number without one."""

    client: types.uint64
    number: types.int64
    success: bool
    sdo_return_message: str
    sdo_return_value_string: str
    sdo_return_value: types.float64


@dataclass
class SetSdoRequest(IdlStruct, typename="ethercat_msgs::srv::dds_::SetSdo_Request_"):
    """The object to write; the definition has signed numbers."""

    client: types.uint64
    number: types.int64
    master_id: types.int16
    slave_position: types.int16
    sdo_index: types.int16
    sdo_subindex: types.int16
    sdo_data_type: str
    sdo_value: str


@dataclass
class SetSdoResponse(IdlStruct, typename="ethercat_msgs::srv::dds_::SetSdo_Response_"):
    """Whether it was written."""

    client: types.uint64
    number: types.int64
    success: bool
    sdo_return_message: str


# Of the message definitions, calculated by REP 2016 ("RIHS01"): endpoints announce them.
HASHES: dict[type[IdlStruct], str] = {
    DiagnosticArray: "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    HardwareStatus: "d4d081efebdea6d8863855733ea95c58338ac4ffdb501a9524da4cbbad9927a2",
    JointState: "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    _Bool: "feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
    _Int64: "8cd1048c2f186b6bd9a92472dc1ce51723c0833a221e2b7aecfff111774f4b49",
    _UInt64: "fbdc52018fc13755dce18024d1a671c856aa8b4aaf63adfb095b608f98e8c943",
    _Float64: "705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a",
    TriggerRequest: "d010825374ce8918e72bfd826c82603e60f45419e932ea976f807b74a863a199",
    SetParametersRequest: "130d46386b7e84ea9ecf60608a4d83cbe5e5cb7c6cc5b712b7a4e3a6c254e932",
    SetParametersResponse: "7a0e8140a0b8d98308fa81a5403a766e610af29a239caf54b7553227906fc266",
    TriggerResponse: "2d946c21e2fc3f1e9ca6986a8191d85fcc70097a8bb7771a053564bc47009cdf",
    GetSdoRequest: "46b8c6215ceb76ff22e1265a115b58e59761d28a21d95dee94cdb654f2e9f142",
    GetSdoResponse: "f493b118480c3aff1aeddf91abace8c4b98ad6e2d124ed840d369304245e5661",
    SetSdoRequest: "52167612d7877b9f48ca4e24dee1c0cfef8e62dc3020a16d8bc61794ea92a7a5",
    SetSdoResponse: "cf0086e5419c5b63defcf82b6750dab98c560acf004d3ec1c2f4fa212f617270",
}
