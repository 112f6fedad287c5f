"""Many machines: metrics of running masters, and incident files as one table.

Needs `prometheus_client` or `duckdb`; commands import it only when asked for. Add here: a metric, a
column of the table. Do not add: levels and reasons (`live`), causes (`incident`).
"""
