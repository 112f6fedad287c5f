"""Looks at the machine for what disturbs a real-time cycle; changes nothing."""
