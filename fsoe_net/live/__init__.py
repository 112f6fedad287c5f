"""A running ``fsn-master``: the process, its client, its console, a scan of its bus, its health.

Add here: values of the control socket, reasons for a health level, code shared by all programs that
watch or control ``fsn-master``, and the result of a run. Do not add: emulated devices and scenarios
(`simulate`), captured frames (`capture`), output for people (`cli`, `report`, `studio`, `ros2`).
"""
