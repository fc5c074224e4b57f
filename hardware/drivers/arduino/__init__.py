"""Servos on an Arduino that takes frames such as `b090,s090,e090,g000,`."""
