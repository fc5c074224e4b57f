"""The arm: lifecycle, connection, write guard, schedules and the streamer."""
