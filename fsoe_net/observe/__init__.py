"""Looks at FSoE frames of others: hex, captures, a dissector for Wireshark. Sends nothing."""
