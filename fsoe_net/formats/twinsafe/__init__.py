"""Exports of TwinSAFE projects."""
