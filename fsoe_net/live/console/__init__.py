"""Console of a running ``fsn-master``: its language, its commands, its connection."""
