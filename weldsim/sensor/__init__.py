"""How the scene is seen: depth sensors, exact, modelled and recorded."""
