"""End of section 4 of the paper: the plane that cuts a hinge's axis at the joint centre."""
