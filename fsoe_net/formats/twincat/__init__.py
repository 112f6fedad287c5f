"""TwinCAT projects."""
