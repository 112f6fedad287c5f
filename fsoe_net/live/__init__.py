"""A running ``fsn-master``: what it reports, and how healthy its bus is.

Add here: values of the control socket, rules about the health of a bus, and what every program
that watches or controls ``fsn-master`` needs. Do not add: emulated devices and scenarios (`run`),
file formats (`formats`, `observe`), output for people (`cli`, `report`, `studio`, `ros2`).
"""
