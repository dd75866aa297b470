"""The emulator: a Polhemus LIBERTY or PATRIOT made of software, on a pseudo-terminal or TCP port."""
