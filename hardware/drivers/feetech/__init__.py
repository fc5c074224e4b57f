"""The driver of bus servos by Feetech: STS3215 and similar servos."""
