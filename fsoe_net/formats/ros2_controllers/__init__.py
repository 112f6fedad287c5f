"""Parameters of a controller manager and its controllers; read next to a URDF by `check`."""

from __future__ import annotations

from fsoe_net.formats.registry import Format, Signature, Yields

_TITLE = "a controllers.yaml of ros2_control"

FORMAT = Format(
    kind="controllers",
    title=_TITLE,
    expects="YAML with `ros__parameters`, next to the URDF of the robot",
    yields=Yields.NETWORK,
    signatures=(Signature(words=_TITLE, text=rb"^[ \t]+ros__parameters[ \t]*:"),),
)
