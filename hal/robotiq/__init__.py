"""Robotiq 2F grippers: the socket of their URCap, which needs no SDK, and Modbus TCP (extra ``ur``: pymodbus)."""
