"""Universal Robots through ur-rtde (extra ``ur``), which runs in a separate process while connected."""
