"""Many machines: metrics of running masters, and incident files as one table.

Needs `prometheus_client` or `duckdb`; commands import it only when asked for.
"""
