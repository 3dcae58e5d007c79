"""What the arms do: operations as phases, built from the plan and from what is sensed."""
