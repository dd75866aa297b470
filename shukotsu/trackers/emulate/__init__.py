"""The emulator: a Polhemus LIBERTY, PATRIOT or FASTRAK made of software, on a pseudo-terminal or TCP port."""
