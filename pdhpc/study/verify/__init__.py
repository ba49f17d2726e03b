"""Named checks of the physics, run on the user's own machine by `pdhpc verify`."""
