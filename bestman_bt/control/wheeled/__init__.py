"""Control of wheeled bases."""

from bestman_bt.control.wheeled.base_controller import BaseController, BaseControllerParameters

__all__ = ["BaseController", "BaseControllerParameters"]
