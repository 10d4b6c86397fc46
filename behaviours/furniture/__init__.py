"""Skills for doors and drawers: finding handles, opening, closing, and updating beliefs."""
