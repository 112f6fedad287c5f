"""What a safety engineer hands in: the configuration as one report, and what changed in it."""
