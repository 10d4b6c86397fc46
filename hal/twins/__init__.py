"""Protocol twins: a simulated world that speaks the wire protocols of real controllers, in real time.

Clients of twins import ``TwinProcess``, which imports no simulation; the world is in ``hal.twins.twin_host``.
"""
