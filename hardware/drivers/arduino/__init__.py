"""Servos on an Arduino that receives frames such as `b090,s090,e090,g000,`."""
