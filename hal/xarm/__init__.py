"""UFACTORY xArm through the vendor's SDK (extra ``xarm``), which is imported when a controller is connected."""
