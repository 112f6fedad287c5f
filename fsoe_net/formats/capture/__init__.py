"""Captures (pcap, pcapng) of a start-up: the bus that a MainDevice set up."""
