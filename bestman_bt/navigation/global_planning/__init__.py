"""Global planning: costmaps and path planners."""
