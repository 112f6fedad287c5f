"""A running ``fsn-master``: the process, its client, its console, a scan of its bus, its health.

Add here: values of the control socket, reasons for a level of health, what every program that
watches or controls ``fsn-master`` needs, and the result of a run. Do not add: emulated devices
and scenarios (`simulate`), frames of others (`capture`), output for people (`cli`, `report`,
`studio`, `ros2`).
"""
