"""Skills at doors and drawers: finding handles, opening, closing, and what is believed of them."""
