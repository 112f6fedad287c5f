"""Descriptions into files of other tools; whatever is written can be read back."""

from fsoe_net.save.describe import describe
from fsoe_net.save.eni import write_eni
from fsoe_net.save.eni_copies import replace_copies

__all__ = ["describe", "replace_copies", "write_eni"]
