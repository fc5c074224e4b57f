"""A model of a bus with servos by Feetech."""
